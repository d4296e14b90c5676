"""A drive in pieces: what each slip and each rest says of every nuisance and every fault.

A block is a stretch of readings without a pause.  All that the tests need of it is the Gram matrix
of its white innovations and their derivatives by every unknown number; what has been seen of a
drive is the sum of its blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.linearisation import LinearisedDrive
from clutchest.inference.map_fit import Fitter
from clutchest.inference.noise_model import NoiseModel
from clutchest.inference.unknowns import Problem, Rows, Unknown
from clutchest.models.effects import Effect
from clutchest.progress import Progress
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

PAUSE, LONGEST = 2.0, 5.0  # s: a longer pause ends a block, and so does its own length
FAR = 5.0  # standard deviations from its neighbours; such a reading is left out
STRETCH = 3000  # readings that are fitted together when the colour of their noise is learned


@dataclass(frozen=True, slots=True)
class Blocks:
    """One drive, block after block.

    ``begin``, ``end`` s (B); ``count`` of readings (B); ``gram`` (B, 1 + m, 1 + m) of the white
    innovations, as they would be with every θ at 0, and their derivatives by each of ``thetas`` (m)
    in its unit.
    """

    thetas: tuple[Unknown, ...]
    begin: Floats
    end: Floats
    count: NDArray[np.int64]
    gram: Floats

    def __len__(self) -> int:
        return len(self.end)

    def pause(self, k: int) -> float:
        """Time from the block before to block ``k``, s."""
        return float(self.begin[k] - self.begin[k - 1]) if k else 0.0

    def index(self, owner: str, key: str) -> int:
        """Where a number stands among ``thetas``."""
        return next(i for i, t in enumerate(self.thetas) if (t.owner, t.key) == (owner, key))


def blocks_of(
    signals: Signals,
    vehicle: Vehicle,
    effects: Sequence[Effect],
    progress: Progress | None = None,
    present: Mapping[int, float] = MappingProxyType({}),
) -> Blocks:
    """The blocks of one drive, ``effects`` among what may be wrong.

    The equations are linearised at the numbers that suit the whole drive best; these numbers
    themselves are taken back again, so that every block can be judged by the blocks before alone.
    Gains are at 0 there, but for those that are ``present``: index among the thetas → first size,
    in units, from which the one that suits the drive best is found.
    """
    problem = Problem(signals, vehicle, effects, progress)
    drive = problem.drives[0]
    thetas = problem.thetas
    if not len(drive.t):
        nothing = np.zeros(0)
        size = 1 + len(thetas)
        return Blocks(thetas, nothing, nothing, np.zeros(0, np.int64), np.zeros((0, size, size)))
    if progress:
        progress("finding where to linearise", None)
    fitter = Fitter(problem)
    start = np.zeros(len(thetas))
    start[list(present)] = list(present.values())
    theta = fitter.settle(start).theta
    if present:
        theta = fitter.most_probable(np.append(problem.nuisances, list(present)), theta).theta
    rows = problem.linearise(theta, {})[0]
    rows.r[:] -= rows.psi @ theta  # at zero
    return _blocks(drive, thetas, rows)


def _blocks(drive: LinearisedDrive, thetas: tuple[Unknown, ...], rows: Rows) -> Blocks:
    which = pieces(drive.t)
    stretches = drive.stretches
    rest, level = _local(rows, which)
    noise_model = NoiseModel.fit([stretches], [rest * level])
    near = np.abs(noise_model.whiten(stretches, rest)) < FAR
    white = noise_model.whiten(stretches, rows.table) * near[:, None]
    order = np.argsort(which, kind="stable")
    edges = np.searchsorted(which[order], np.arange(which.max() + 2))
    gram, begin, end = [], [], []
    for a, b in pairwise(edges.tolist()):
        own = order[a:b]
        gram.append(white[own].T @ white[own])
        begin.append(drive.t[own].min())
        end.append(drive.t[own].max())
    return Blocks(thetas, np.array(begin), np.array(end), np.diff(edges), np.array(gram))


def pieces(t: Floats) -> NDArray[np.int64]:
    """The block (K), counted from 0, of readings at times ``t`` (K) in any order."""
    order = np.argsort(t, kind="stable")
    found, block = np.zeros(len(t), np.int64), 0
    begin = last = t[order[0]]
    for k in order:
        if t[k] - last > PAUSE or t[k] - begin > LONGEST:
            block, begin = block + 1, t[k]
        found[k], last = block, t[k]
    return found


def _local(rows: Rows, which: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """What is left of the innovations (K) when every stretch of some blocks has been fitted by
    itself, and by how much it is smaller for that (K): the colour of noise, whatever drifts or
    jumps from stretch to stretch."""
    rest, level = rows.r.copy(), np.ones(len(rows.r))
    for own in np.array_split(np.argsort(which, kind="stable"), max(len(which) // STRETCH, 1)):
        psi = rows.psi[own]
        inner = psi.T @ psi
        weight = np.linalg.inv(inner + np.eye(len(inner)))
        rest[own] -= psi @ (weight @ (psi.T @ rows.r[own]))
        taken = float(np.trace(weight @ inner))
        level[own] = np.sqrt(len(own) / max(len(own) - taken, 1.0))
    return rest, level
