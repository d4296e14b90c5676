"""Fault tests of the equations: one per fault, on residuals that are white in a healthy vehicle.

Two tests share a monitor's false alarms.  Has a fault *begun*?  A GLR over its size and its onset
within the last blocks, with a threshold simulated for this drive.  Was a fault present *from the
start*?  The likelihood ratio of a fault of any plausible size to none over the whole drive, which
by Ville's inequality exceeds 1/α in a healthy vehicle with a probability of at most α, at any time.

One more test knows no fault: whether a block as a whole is further off than noise explains
(chi-square of its whitened innovations).  What no known fault explains shows there.  The level of
healthy noise scatters a little between states of motion, which thousands of readings would show.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, log_ndtr

from clutchest.diagnosis.blocks import Blocks
from clutchest.diagnosis.recursive_residuals import (
    RecursiveResiduals,
    onset_scores,
    recursive_residuals,
)
from clutchest.diagnosis.thresholds import Autoregression, glr_path, threshold
from clutchest.models.fault import ModelFault
from clutchest.models.machine import Machine
from clutchest.signals import Floats

SHORTEST_H = 0.25  # h; a shorter drive counts as this long
SCATTER = 0.04  # of the mean square of healthy residuals, from block to block
LEAST = 0.25  # of the smallest size that matters: the lower bound of the GLR's size


@dataclass(frozen=True, slots=True)
class FaultTestResult:
    """One fault over a drive of B blocks.

    ``begins``, ``was`` (B) the statistics of both tests over their thresholds ``begins_at`` and
    ``was_at`` (log-likelihood ratios); ``onset`` (B) the block in which the likeliest fault began;
    ``detectable`` the size (in the gain's unit) that half of such drives would detect, None where
    no plausible one is; ``d_prime`` of one ``unit`` of the gain over the whole drive, and the d′
    ``needed`` for detection.
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

    @property
    def excess(self) -> float:
        """By how much a log-likelihood ratio exceeds its threshold at most."""
        begins = (self.begins.max() - 1.0) * self.begins_at
        return float(max(begins, (self.was.max() - 1.0) * self.was_at))


@dataclass(frozen=True, slots=True)
class FaultTestResults:
    """The blocks of a drive of ``machine``, their residuals and the results of all its faults.

    ``columns``: each fault's index among the thetas; ``misfit`` (B): −ln p of each block over its
    threshold ``misfit_at``.
    """

    machine: Machine
    blocks: Blocks
    residuals: RecursiveResiduals
    columns: tuple[int, ...]
    faults: tuple[FaultTestResult, ...]
    noise_model: Autoregression
    hours: float
    misfit: Floats
    misfit_at: float

    @property
    def misfit_detected(self) -> int | None:
        """The first block that no healthy vehicle explains."""
        rows = np.flatnonzero(self.misfit > 1.0)
        return int(rows[0]) if len(rows) else None


def run_fault_tests(
    blocks: Blocks, machine: Machine, per_1000h: float, hours: float
) -> FaultTestResults:
    """Test every block of a drive of ``hours`` h for every fault of its ``machine``."""
    faults = machine.faults
    columns = tuple(blocks.index(f"{f.effect.name}.{f.key}") for f in faults)
    residuals = recursive_residuals(blocks, columns)
    if not len(blocks):
        return FaultTestResults(
            machine, blocks, residuals, columns, (), Autoregression(), hours, np.zeros(0), np.inf
        )
    whole = onset_scores(blocks, columns, residuals.before, 0, len(blocks))
    information = residuals.information
    informative = information.max(axis=1) > 0.0
    best = np.argmax(information / np.maximum(information.max(axis=0), 1e-12), axis=1)
    noise_model = Autoregression.of(residuals.z[np.arange(len(blocks)), best][informative])
    hours = max(hours, SHORTEST_H)
    chance = per_1000h / 2.0 * hours / 1000.0
    results = []
    for i, fault in enumerate(faults):
        unit = blocks.thetas[columns[i]].unit
        series = _Series(
            residuals.z[:, i], information[:, i], whole.score[:, i], whole.information[:, i, i]
        )
        results.append(_result(fault, unit, series, noise_model, chance))
    misfit_at = log(len(blocks) / (2.0 * chance))
    ratio = residuals.chi_square / np.maximum(residuals.count, 1) / noise_model.level**2
    misfit = surprise(ratio, residuals.count) / misfit_at
    return FaultTestResults(
        machine, blocks, residuals, columns, tuple(results), noise_model, hours, misfit, misfit_at
    )


def surprise(ratio: Floats, count: NDArray[np.int64]) -> Floats:
    """−ln p (B) of blocks whose mean square is ``ratio`` (B) times that of healthy noise, of
    ``count`` (B) readings each: chi-square, of as many fewer degrees of freedom as make up for a
    level that scatters from block to block."""
    freedom = 1.0 / (1.0 / np.maximum(count, 1) + SCATTER**2 / 2.0)
    with np.errstate(divide="ignore"):  # beyond 700, infinite
        return np.asarray(-np.log(chdtrc(freedom, ratio * freedom)))


@dataclass(frozen=True, slots=True)
class _Series:
    """One fault block by block (B): residual ``z`` and its ``information``; ``score`` and
    information ``total`` of the fault's presence from the start."""

    z: Floats
    information: Floats
    score: Floats
    total: Floats


def _result(
    fault: ModelFault, unit: float, series: _Series, noise_model: Autoregression, chance: float
) -> FaultTestResult:
    low, one_sided = LEAST * fault.size / unit, fault.gain.one_sided
    z, information = series.z, series.information
    begins_at = (
        threshold(
            lambda s, i: glr_path(s, i, low, 1.0, one_sided)[0],
            information,
            noise_model,
            chance / len(z),
        )
        if information.max() > 0.0
        else np.inf
    )
    begins, onset = glr_path(z * np.sqrt(information), information, low, 1.0, one_sided)
    was_at = log(1.0 / chance)
    ratio = mixture_ratio(series.score / noise_model.level, series.total, one_sided)
    # a fault of size b is detected in half of such drives where b² · information reaches this
    needed = float(np.sqrt(2.0 * min(begins_at, was_at + log(2.0))))
    d_prime = float(np.sqrt(max(series.total[-1], 0.0)))
    size = needed / d_prime * unit if d_prime > 0.0 else np.inf
    return FaultTestResult(
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


def mixture_ratio(score: Floats, information: Floats, one_sided: bool) -> Floats:
    """Log-likelihood ratio (n) to no fault of a fault whose size is normal with one unit."""
    spread = 1.0 + np.maximum(information, 0.0)
    ratio = (score**2 / spread - np.log(spread)) / 2.0
    if one_sided:
        ratio = ratio + np.log(2.0) + log_ndtr(score / np.sqrt(spread))
    return np.asarray(ratio)
