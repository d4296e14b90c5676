"""Model discrepancy: what the equations of a healthy machine are off by, and what that does to
readings.

No machine is its model (M. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", J. R.
Stat. Soc. B 63, 2001).  States that are constant in the equations wander, and a curve is off by a
percent here and there.  The vehicle file states how far; readings scatter along what each of these
does to them, and such directions count for less.  How far a state wanders in one log is estimated
from it, up to what is stated; smooth errors of equations, which one log shows once, count as
stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import softmax

from clutchest.inference.cores import fits_at_once, shared
from clutchest.inference.input_noise_covariance import main_directions, shown
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.smooth_errors import smooth_error
from clutchest.inference.wander import wander_of
from clutchest.signals import Floats
from clutchest.vehicle import SmoothError
from clutchest.vehicle.state_uncertainty import Wander

# Shares of what is stated that are as likely before any data: every half octave, and none.
SHARES = np.append(0.0, 2.0 ** (np.arange(-10, 1) / 2.0))
WIDE = 64  # numbers that a discrepancy holds of every event
SWEEPS = 2  # over the states, of each given the others

Discrepancy = Wander | SmoothError


def directions_of(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    discrepancies: Sequence[Discrepancy],
) -> list[Floats]:
    """What each discrepancy does to the readings of a drive at these ``numbers``, in their standard
    deviations: columns (K, c), each to be taken a number of times that is normal, of variance 1."""

    def directions(each: Discrepancy) -> Floats:
        if isinstance(each, Wander):
            scatter = wander_of(drive, numbers, at, each)
        else:
            scatter = smooth_error(drive, numbers, at, each)
        scatter /= drive.readings.std[:, None]
        return main_directions(scatter)

    each = WIDE * len(drive.line.t)
    return shared(directions, discrepancies, fits_at_once(each, each))


def scattering(
    drives: Sequence[PreparedDrive], directions: Sequence[Sequence[Floats]], share: Floats
) -> list[Floats]:
    """Directions (K, c) in which each drive's innovations scatter, by noise of the inputs and where
    every discrepancy has its ``share`` of what is stated: those of ``directions``, one after the
    other, without those that hardly show at such a share."""
    return [
        np.column_stack([drive.readings.input_noise, *map(shown, own, share)])
        for drive, own in zip(drives, directions, strict=True)
    ]


@dataclass(frozen=True, slots=True)
class ScatteredDrive:
    """Products of one drive's white innovations with their derivatives, (1 + m, 1 + m): ``known``;
    and of these with the directions of every discrepancy, (c, 1 + m): ``shared``; and of
    the directions, (c, c): ``own``.  ``of`` (c): the index of that of each direction."""

    known: Floats
    shared: Floats
    own: Floats
    of: NDArray[np.int64]

    @classmethod
    def along(cls, table: Floats, columns: Sequence[Floats]) -> ScatteredDrive:
        """From innovations and derivatives (K, 1 + m) and every discrepancy's columns (K, c)."""
        of = np.repeat(np.arange(len(columns)), [own.shape[1] for own in columns])
        shared = np.vstack([own.T @ table for own in columns])
        own = np.block([[a.T @ b for b in columns] for a in columns])
        return cls(table.T @ table, shared, own, of)

    def beside(self, free: NDArray[np.int64]) -> ScatteredDrive:
        """The same with no more than the ``free`` unknowns (indices)."""
        kept = np.append(0, 1 + free)
        return replace(self, known=self.known[np.ix_(kept, kept)], shared=self.shared[:, kept])

    def scattered(self, share: Floats) -> tuple[Floats, float]:
        """``known`` where innovations scatter by each discrepancy's ``share``, and ln of the
        determinant of their covariance."""
        size = share[self.of]
        root = cho_factor(np.eye(len(size)) + size[:, None] * self.own * size, lower=True)
        shared = size[:, None] * self.shared
        explained = shared.T @ cho_solve(root, shared)
        return self.known - explained, 2.0 * float(np.log(np.diag(root[0])).sum())


def probable_shares(
    drives: Sequence[ScatteredDrive], discrepancies: Sequence[Discrepancy]
) -> Floats:
    """By which share of what is stated each state wanders: its root mean square, given the data,
    whatever the unknowns are that have a prior of variance 1; 1 of smooth errors."""
    wander = np.array([isinstance(each, Wander) for each in discrepancies])
    share = np.where(wander, 0.5, 1.0)
    for _ in range(SWEEPS):
        for i in np.flatnonzero(wander):
            tried = np.tile(share, (len(SHARES), 1))
            tried[:, i] = SHARES
            weight = softmax([probability(drives, each) for each in tried])
            share[i] = np.sqrt(weight @ SHARES**2)
    return share


def probability(drives: Sequence[ScatteredDrive], share: Floats) -> float:
    """ln(probability) of all drives with these shares, up to a constant."""
    parts = [drive.scattered(share) for drive in drives]
    known = np.sum([own for own, _ in parts], axis=0)
    spread = sum(wide for _, wide in parts)
    strength, directions = np.linalg.eigh(known[1:, 1:] + np.eye(len(known) - 1))
    strength = np.maximum(strength, 1.0)  # less than their prior's is what rounding made of it
    explained = float(np.sum((known[0, 1:] @ directions) ** 2 / strength))
    spread += float(np.log(strength).sum())
    return float(-(known[0, 0] - explained + spread) / 2.0)
