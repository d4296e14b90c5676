"""Slow wander: what states that are constant in the equations, and wander in truth, do to readings.

In a healthy vehicle friction wanders with humidity, and the bias of a torque report with the fuel.
Such a random walk is a sum of sines with independent normal coefficients (its Karhunen-Loève
expansion: M. Loève, Probability Theory II, 1978, section 37), and readings scatter along what each
of these does to them.  How far a state wanders in one log is estimated from it, up to what is
stated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import softmax

from clutchest.inference.input_noise_covariance import main_directions, shown
from clutchest.inference.linearisation import Modulation, modulated
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.unknowns import StateWander, of_compiled
from clutchest.signals import Floats

TERMS = 64  # of a walk: of its variance at the end of a drive, 1/300 is left out
# Shares of what is stated that are as likely before any data: every half octave, and none.
SHARES = np.append(0.0, 2.0 ** (np.arange(-10, 1) / 2.0))
SWEEPS = 2  # over the states, of each given the others


def random_walk(t: Floats, density: float) -> Floats:
    """A random walk at times ``t`` (K) s, 0 at the first, as columns (K, TERMS), each to be taken a
    number of times that is normal, of variance 1; ``density`` unit/√s."""
    since, whole = t - t[0], max(t[-1] - t[0], 1e-9)
    rate = (np.arange(TERMS) + 0.5) * np.pi / whole
    walk = np.outer(since, rate)
    np.sin(walk, out=walk)  # in place: of an hour, 50 MiB
    walk *= density * np.sqrt(2.0 / whole) / rate
    return walk


def wander_directions(
    drive: PreparedDrive, numbers: ModelNumbers, at: OperatingPoint, densities: Mapping[str, float]
) -> list[Floats]:
    """What the wander of each state by its density, unit/√s, does to the readings of a drive at
    these ``numbers``, in their standard deviations: columns (K, c), each to be taken a number of
    times that is normal, of variance 1."""
    line, thetas = drive.line, list(of_compiled(drive.compiled, {}))
    span, columns = np.diff(line.t, prepend=line.t[0])[:, None], []
    for state, density in densities.items():
        rates = random_walk(line.t, density)
        rates[1:] = np.diff(rates, axis=0)
        rates[0] = 0.0
        rates /= np.where(span > 0.0, span, np.inf)
        theta = np.full(TERMS, thetas.index(StateWander(state)))
        does = modulated(drive, numbers, at, theta, Modulation(rates, np.arange(TERMS)))
        does /= drive.readings.std[:, None]
        columns.append(main_directions(does))
    return columns


def scattering(
    drives: Sequence[PreparedDrive], wander: Sequence[Sequence[Floats]], share: Floats
) -> list[Floats]:
    """Directions (K, c) in which each drive's innovations scatter, by noise of the inputs and where
    every state wanders as its ``share`` of what is stated: those of ``wander``, state by state,
    without directions that hardly show at such a share."""
    return [
        np.column_stack([drive.readings.input_noise, *map(shown, own, share)])
        for drive, own in zip(drives, wander, strict=True)
    ]


@dataclass(frozen=True, slots=True)
class WanderingDrive:
    """Products of one drive's white innovations with their derivatives, (1 + m, 1 + m): ``known``;
    and of these with the directions of every state that wanders, (c, 1 + m): ``shared``; and of
    the directions, (c, c): ``own``.  ``state`` (c): the index of that of each direction, of so
    many ``states``."""

    known: Floats
    shared: Floats
    own: Floats
    state: NDArray[np.int64]
    states: int

    @classmethod
    def of(cls, table: Floats, columns: Sequence[Floats]) -> WanderingDrive:
        """From innovations and derivatives (K, 1 + m) and the columns (K, c) of every state."""
        state = np.repeat(np.arange(len(columns)), [own.shape[1] for own in columns])
        shared = np.vstack([own.T @ table for own in columns])
        own = np.block([[a.T @ b for b in columns] for a in columns])
        return cls(table.T @ table, shared, own, state, len(columns))

    def beside(self, free: NDArray[np.int64]) -> WanderingDrive:
        """The same with no more than the ``free`` unknowns (indices)."""
        kept = np.append(0, 1 + free)
        return replace(self, known=self.known[np.ix_(kept, kept)], shared=self.shared[:, kept])

    def scattered(self, share: Floats) -> tuple[Floats, float]:
        """``known`` where innovations scatter by each state's ``share``, and ln of the determinant
        of their covariance."""
        size = share[self.state]
        root = cho_factor(np.eye(len(size)) + size[:, None] * self.own * size, lower=True)
        shared = size[:, None] * self.shared
        explained = shared.T @ cho_solve(root, shared)
        return self.known - explained, 2.0 * float(np.log(np.diag(root[0])).sum())


def probable_shares(drives: Sequence[WanderingDrive]) -> Floats:
    """By which share of what is stated each state wanders: its root mean square, given the data,
    whatever the unknowns are that have a prior of variance 1."""
    share = np.full(drives[0].states, 0.5)
    for _ in range(SWEEPS):
        for i in range(len(share)):
            tried = np.tile(share, (len(SHARES), 1))
            tried[:, i] = SHARES
            weight = softmax([probability(drives, each) for each in tried])
            share[i] = np.sqrt(weight @ SHARES**2)
    return share


def probability(drives: Sequence[WanderingDrive], share: Floats) -> float:
    """ln(probability) of all drives with these shares, up to a constant."""
    parts = [drive.scattered(share) for drive in drives]
    known = np.sum([own for own, _ in parts], axis=0)
    spread = sum(wide for _, wide in parts)
    root = cho_factor(known[1:, 1:] + np.eye(len(known) - 1), lower=True)
    explained = known[0, 1:] @ cho_solve(root, known[1:, 0])
    spread += 2.0 * float(np.log(np.diag(root[0])).sum())
    return float(-(known[0, 0] - explained + spread) / 2.0)
