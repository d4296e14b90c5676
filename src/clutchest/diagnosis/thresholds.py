"""Thresholds from a false-alarm rate, on residuals as coloured as they were measured.

A test on block residuals depends on how much each block tells, which no formula for the run length
knows.  So the test itself is run on drawn residuals: as much information per block as was measured,
in the order in which it came, and normal numbers of the measured level that remember each other as
much as measured.  Peaks of a likelihood ratio fall off exponentially; where the rate asked for is
rarer than what was drawn, the exponential of all high peaks is carried on, as flat as they allow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from clutchest.diagnosis.sequential import cusum, glr, peaks
from clutchest.inference.noise_model import median_std
from clutchest.signals import Floats

DRAWN = 800_000  # blocks
STRETCH = 30  # blocks of measured information that stay together
WINDOW = 64  # blocks that a fault may lie back
FEWEST = 100  # alarms that are counted rather than extrapolated to
ALONE = 0.1  # share of the blocks that peaks and what lies close to them may take up
FEW = 50  # blocks from which level and colour are measured
SHRUNK = 300  # blocks that stand for "white and of variance 1", as the equations promise


@dataclass(frozen=True, slots=True)
class Autoregression:
    """How residuals depart from white ones of variance 1: ``level`` their standard deviation (at
    least 1), ``memory`` the correlation of one with the next (at least 0)."""

    level: float = 1.0
    memory: float = 0.0

    @classmethod
    def of(cls, z: Floats) -> Autoregression:
        """From residuals (n) by their median size and by how often neighbours agree in sign: what
        few faulty ones among them do does not count."""
        if len(z) < FEW:
            return cls()
        share = len(z) / (len(z) + SHRUNK)
        size = median_std(z)
        level = float(np.sqrt(share * size**2 + 1.0 - share))
        signs = np.sign(z - np.median(z))
        agree = float(np.mean(signs[1:] == signs[:-1]))
        memory = np.sin(np.pi * (agree - 0.5)) * share
        return cls(max(level, 1.0), float(np.clip(memory, 0.0, 0.9)))


Test = Callable[[Floats, Floats], Floats]  # (scores, information per block) → path


def glr_path(
    score: Floats, information: Floats, low: float, high: float, one_sided: bool = False
) -> tuple[Floats, np.ndarray]:
    """Log-likelihood ratio (n) of the likeliest fault and the block it began with (n), its size
    from ``low`` to ``high`` either way."""
    path, begun = np.zeros(len(score)), np.zeros(len(score), np.int64)
    glr(score, information, low, high, one_sided, WINDOW, path, begun)
    return path, begun


def cusum_path(
    score: Floats, information: Floats, size: float, one_sided: bool = False
) -> tuple[Floats, np.ndarray]:
    """The same for a fault of one ``size``, either way: Page's test."""
    drift = size**2 * information / 2.0
    path, begun = np.zeros(len(score)), np.zeros(len(score), np.int64)
    cusum(size * score - drift, 0.0, path, begun)
    if one_sided:
        return path, begun
    other, first = np.zeros(len(score)), np.zeros(len(score), np.int64)
    cusum(-size * score - drift, 0.0, other, first)
    return np.maximum(path, other), np.where(other > path, first, begun)


def drawn(
    information: Floats, noise_model: Autoregression, blocks: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Scores and information (blocks) of a healthy vehicle: stretches of what was measured, and
    normal residuals of this colour."""
    length = min(STRETCH, len(information))
    firsts = rng.integers(len(information), size=blocks // length + 1)
    rows = (firsts[:, None] + np.arange(length)).reshape(-1)[:blocks] % len(information)
    told = information[rows]
    z = rng.standard_normal(blocks)
    if noise_model.memory > 0.0:
        _remember(z, noise_model.memory)
    return noise_model.level * z * np.sqrt(told), told


@njit(cache=True)
def _remember(z, memory):  # type: ignore[no-untyped-def]
    fresh = np.sqrt(1.0 - memory**2)
    for k in range(1, len(z)):
        z[k] = memory * z[k - 1] + fresh * z[k]


def threshold(
    test: Test, information: Floats, noise_model: Autoregression, per_block: float, seed: int = 1
) -> float:
    """What ``test`` exceeds ``per_block`` times a block in a healthy vehicle."""
    rng = np.random.default_rng(seed)
    path = test(*drawn(information, noise_model, DRAWN, rng))
    return from_path(path, per_block)


def from_path(path: Floats, per_block: float) -> float:
    """The threshold that a long healthy ``path`` exceeds ``per_block`` times a block."""
    wanted = per_block * len(path)
    levels = np.arange(0.0, float(path.max()) - 0.5, 0.5)
    if not len(levels):
        return 0.5
    risen = [peaks(path, level, WINDOW) for level in levels]
    many = np.array([len(found) for found in risen])
    # the lowest level whose peaks stand alone; below the level of most of them they run together
    alone = (many * WINDOW < ALONE * len(path)) & (levels >= levels[np.argmax(many)])
    base, found = levels[np.argmax(alone)], risen[int(np.argmax(alone))]
    if wanted >= FEWEST:
        return float(np.sort(found)[-min(round(wanted), len(found))])
    # exponential (maximum likelihood), its mean excess longer by one standard error
    excess = float(np.mean(found - base)) * (1.0 + 1.0 / np.sqrt(len(found)))
    return float(base + excess * np.log(max(len(found) / wanted, 1.0)))
