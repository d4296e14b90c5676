"""Tests of what only the equations show: one per fault, on residuals that are white in health.

Two questions share a monitor's false alarms.  Has something *begun*?  The likeliest size and onset
within the last blocks (GLR), against a threshold drawn for this drive.  Was something there *from
the beginning*?  The likelihood of the whole drive with a fault of any plausible size over that
without, which by Ville's inequality exceeds 1/α in a healthy vehicle with a chance of at most α,
however long one watches.

One more test asks nothing of faults: whether a block as a whole lies further off than noise carries
it (chi-square of its squared innovations).  What no known fault explains shows there.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from scipy.stats import chi2, norm

from clutchest.diagnosis.blocks import Blocks
from clutchest.diagnosis.faults import ModelFault
from clutchest.diagnosis.predicted import Predicted, predicted, since
from clutchest.diagnosis.thresholds import Autoregression, glr_path, threshold
from clutchest.signals import Floats

SHORTEST = 0.25  # h; a shorter drive counts as this long
LEAST = 0.25  # of the smallest size that matters: what the GLR looks for


@dataclass(frozen=True, slots=True)
class Judged:
    """One fault over a drive.

    ``begins``, ``was`` (B) the statistics of both questions over their thresholds ``begins_at`` and
    ``was_at`` (log-likelihood ratios); ``onset`` (B) the block with which the likeliest fault
    began; ``detectable`` the size (in the gain's unit) that would reach the threshold, by
    all that the drive tells, None where no plausible one does.
    """

    fault: ModelFault
    begins: Floats
    was: Floats
    begins_at: float
    was_at: float
    onset: np.ndarray
    unit: float
    detectable: float | None
    needed: float
    d_prime: float

    @property
    def detected(self) -> int | None:
        """The first block at which either test fails."""
        rows = np.flatnonzero((self.begins > 1.0) | (self.was > 1.0))
        return int(rows[0]) if len(rows) else None

    @property
    def status(self) -> str:
        """``passed``, ``failed`` or ``not run``."""
        if self.detected is not None:
            return "failed"
        return "not run" if self.detectable is None else "passed"


@dataclass(frozen=True, slots=True)
class Watched:
    """A drive's blocks, their residuals and what became of every fault; ``misfit`` (B) minus the
    logarithm of the chance of each block over its threshold ``misfit_at``."""

    blocks: Blocks
    residuals: Predicted
    columns: tuple[int, ...]
    faults: tuple[Judged, ...]
    noise_model: Autoregression
    hours: float
    misfit: Floats
    misfit_at: float

    @property
    def misfit_detected(self) -> int | None:
        """The first block that no healthy clutch explains."""
        rows = np.flatnonzero(self.misfit > 1.0)
        return int(rows[0]) if len(rows) else None


def watch(
    blocks: Blocks, faults: tuple[ModelFault, ...], per_1000h: float, hours: float
) -> Watched:
    """Judge every block of a drive of ``hours`` h, one after the other."""
    columns = tuple(blocks.index(f.make().name, f.key) for f in faults)
    if not len(blocks):
        nothing = predicted(blocks, columns)
        return Watched(blocks, nothing, columns, (), Autoregression(), hours, np.zeros(0), np.inf)
    residuals = predicted(blocks, columns)
    whole = since(blocks, columns, residuals.before, 0, len(blocks))
    told = residuals.information
    seen = told.max(axis=1) > 0.0
    best = np.argmax(told / np.maximum(told.max(axis=0), 1e-12), axis=1)
    noise_model = Autoregression.of(residuals.z[np.arange(len(blocks)), best][seen])
    hours = max(hours, SHORTEST)
    chance = per_1000h / 2.0 * hours / 1000.0
    found = [
        _judged(
            fault,
            residuals.z[:, i],
            told[:, i],
            whole.score[:, i],
            whole.information[:, i, i],
            blocks.thetas[columns[i]].unit,
            noise_model,
            chance,
        )
        for i, fault in enumerate(faults)
    ]
    misfit_at = log(len(blocks) / (2.0 * chance))
    misfit = -chi2.logsf(residuals.surprise / noise_model.level**2, residuals.count) / misfit_at
    return Watched(blocks, residuals, columns, tuple(found), noise_model, hours, misfit, misfit_at)


def _judged(
    fault: ModelFault,
    z: Floats,
    told: Floats,
    score: Floats,
    whole: Floats,
    unit: float,
    noise_model: Autoregression,
    chance: float,
) -> Judged:
    number = fault.number
    low, one_sided = LEAST * fault.size / unit, number.one_sided
    begins_at = (
        threshold(
            lambda s, i: glr_path(s, i, low, 1.0, one_sided)[0], told, noise_model, chance / len(z)
        )
        if told.max() > 0.0
        else np.inf
    )
    begins, onset = glr_path(z * np.sqrt(told), told, low, 1.0, one_sided)
    was_at = log(1.0 / chance)
    ratio = _mixture(score / noise_model.level, whole, one_sided)
    # a fault of size b shows in half of such drives where b² · information reaches this
    needed = float(np.sqrt(2.0 * min(begins_at, was_at + log(2.0))))
    d_prime = float(np.sqrt(max(whole[-1], 0.0)))
    size = needed / d_prime * unit if d_prime > 0.0 else np.inf
    return Judged(
        fault,
        begins / begins_at,
        ratio / was_at,
        begins_at,
        was_at,
        onset,
        unit,
        size if size <= unit else None,
        needed,
        d_prime,
    )


def _mixture(score: Floats, information: Floats, one_sided: bool) -> Floats:
    """Log-likelihood ratio (n) of a fault whose size is normal, of one unit, to none."""
    spread = 1.0 + np.maximum(information, 0.0)
    ratio = (score**2 / spread - np.log(spread)) / 2.0
    if one_sided:
        ratio = ratio + np.log(2.0) + norm.logcdf(score / np.sqrt(spread))
    return np.asarray(ratio)
