"""Thresholds from a false-alarm rate, for residuals as autocorrelated as measured.

The run length of a test on block residuals depends on the information in each block, for which
there is no formula.  So the test is run on simulated residuals: the measured information per block
in stretches of its own order, and normal numbers of the measured level and autocorrelation.  Peaks
of a likelihood ratio have an exponential tail; where the wanted rate is below what was simulated,
the exponential fitted to all high peaks is extrapolated, its mean one standard error longer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clutchest.diagnosis.sequential import cusum, glr, peaks
from clutchest.inference.noise_model import median_std
from clutchest.native import compiled
from clutchest.signals import Floats

SIMULATED = 800_000  # blocks
LOWEST = 0.5  # threshold, where healthy vehicles hardly ever reach even 0
STRETCH = 30  # consecutive blocks of measured information
WINDOW = 64  # blocks between a fault's onset and its detection by the GLR, at most
COUNTED = 100  # alarms from which a threshold is counted rather than extrapolated
ISOLATED = 0.1  # share of the blocks within a window of a peak, at most
FEWEST = 50  # blocks from which level and autocorrelation are estimated
PRIOR_BLOCKS = 300  # weight of the prior: white and of variance 1


@dataclass(frozen=True, slots=True)
class Autoregression:
    """AR(1) model of block residuals: ``level`` their standard deviation (at least 1),
    ``coefficient`` their autocorrelation at lag 1 (at least 0)."""

    level: float = 1.0
    coefficient: float = 0.0

    @classmethod
    def of(cls, z: Floats) -> Autoregression:
        """Robust estimate from residuals (n), by their median magnitude and by how often
        neighbours agree in sign: a few faulty ones among them have no influence."""
        if len(z) < FEWEST:
            return cls()
        share = len(z) / (len(z) + PRIOR_BLOCKS)
        std = median_std(z)
        level = float(np.sqrt(share * std**2 + 1.0 - share))
        signs = np.sign(z - np.median(z))
        agree = float(np.mean(signs[1:] == signs[:-1]))
        coefficient = np.sin(np.pi * (agree - 0.5)) * share
        return cls(max(level, 1.0), float(np.clip(coefficient, 0.0, 0.9)))


Test = Callable[[Floats, Floats], Floats]  # (scores, information per block) → path


def glr_path(
    score: Floats, information: Floats, low: float, high: float, one_sided: bool = False
) -> tuple[Floats, np.ndarray]:
    """Generalised log-likelihood ratio (n) and the maximising onset (n) of a fault whose size is
    from ``low`` to ``high``, of either sign unless ``one_sided``."""
    path, begun = np.zeros(len(score)), np.zeros(len(score), np.int64)
    glr(score, information, low, high, one_sided, WINDOW, path, begun)
    return path, begun


def cusum_path(
    score: Floats, information: Floats, size: float, one_sided: bool = False
) -> tuple[Floats, np.ndarray]:
    """The same for a fault of one known ``size``: Page's test."""
    drift = size**2 * information / 2.0
    path, begun = np.zeros(len(score)), np.zeros(len(score), np.int64)
    cusum(size * score - drift, 0.0, path, begun)
    if one_sided:
        return path, begun
    other, first = np.zeros(len(score)), np.zeros(len(score), np.int64)
    cusum(-size * score - drift, 0.0, other, first)
    return np.maximum(path, other), np.where(other > path, first, begun)


def simulated(
    information: Floats, noise_model: Autoregression, blocks: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Scores and information (blocks) of a healthy vehicle: stretches of the measured information,
    normal residuals by the noise model."""
    length = min(STRETCH, len(information))
    firsts = rng.integers(len(information), size=blocks // length + 1)
    rows = (firsts[:, None] + np.arange(length)).reshape(-1)[:blocks] % len(information)
    resampled = information[rows]
    z = rng.standard_normal(blocks)
    if noise_model.coefficient > 0.0:
        _autocorrelate(z, noise_model.coefficient)
    return noise_model.level * z * np.sqrt(resampled), resampled


@compiled
def _autocorrelate(z, coefficient):  # type: ignore[no-untyped-def]
    innovation = np.sqrt(1.0 - coefficient**2)
    for k in range(1, len(z)):
        z[k] = coefficient * z[k - 1] + innovation * z[k]


def threshold(
    test: Test, information: Floats, noise_model: Autoregression, per_block: float, seed: int = 1
) -> float:
    """The threshold that ``test`` exceeds ``per_block`` times per block in a healthy vehicle."""
    rng = np.random.default_rng(seed)
    path = test(*simulated(information, noise_model, SIMULATED, rng))
    return from_path(path, per_block)


def from_path(path: Floats, per_block: float) -> float:
    """The threshold that a long healthy ``path`` exceeds ``per_block`` times per block."""
    wanted = per_block * len(path)
    levels = np.arange(0.0, float(path.max()) - 0.5, 0.5)
    if not len(levels):
        return LOWEST
    maxima = [peaks(path, level, WINDOW) for level in levels]
    counts = np.array([len(of_level) for of_level in maxima])
    # the lowest level whose peaks are isolated; below the level of most peaks they merge
    isolated = (counts * WINDOW < ISOLATED * len(path)) & (levels >= levels[np.argmax(counts)])
    base, highest = levels[np.argmax(isolated)], maxima[int(np.argmax(isolated))]
    if wanted >= COUNTED:
        return max(float(np.sort(highest)[-min(round(wanted), len(highest))]), LOWEST)
    # exponential (maximum likelihood), its mean excess longer by one standard error
    excess = float(np.mean(highest - base)) * (1.0 + 1.0 / np.sqrt(len(highest)))
    return max(float(base + excess * np.log(max(len(highest) / wanted, 1.0))), LOWEST)
