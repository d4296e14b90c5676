"""Score tests of causes, with nuisances projected out, and the separability d′ of causes.

Around the most probable nuisances all is linear: the innovations r respond to θ by ψ.  A cause's
score is what is left of ψᵀr after nuisances, at the price of their priors, have explained what
they can (Rao's efficient score); its information is what is left of ψᵀψ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from clutchest.inference.linear_solve import add_product
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

DRAWS = 2000  # of the null
BLOCK, BLOCKS = 512, 16  # readings drawn at a time at most, and times at least
COUNTED = 20  # draws of so many a share is known to a fifth or so
GROUPS = 1 << 14  # readings of a longer record are drawn in as many groups
ABSENT = 1e-6  # information below which a cause leaves no trace (in squared standard deviations)
# In 2 Δ ln L: a rival that fits worse than the best by less is not excluded at 95 %, one-sided.
NOT_EXCLUDED = 1.645**2


@dataclass(frozen=True, slots=True)
class ScoreTest:
    """Scores of C causes at one linearisation.

    ``score`` (C) and ``information`` (C, C), nuisances taken out; ``one_sided`` (C); ``null``
    (DRAWS, C) scores of data in which no cause acts: innovations drawn from those at hand, through
    the same ψ, and nuisances from their priors.
    """

    score: Floats
    information: Floats
    one_sided: NDArray[np.bool_]
    null: Floats

    @property
    def std(self) -> Floats:
        """Standard deviation of each score (C), inf where a cause leaves no trace."""
        diagonal = np.diag(self.information)
        return np.where(diagonal > ABSENT, np.sqrt(np.maximum(diagonal, ABSENT)), np.inf)

    @property
    def z(self) -> Floats:
        """Scores in standard deviations (C)."""
        return self.score / self.std

    def p_alone(self, z: Floats) -> Floats:
        """Chance of such a ``z`` (…, C) by noise, each cause by itself."""
        return np.where(self.one_sided, ndtr(-z), 2.0 * ndtr(-np.abs(z)))

    @property
    def least(self) -> Floats:
        """The smallest p-value of each null draw, sorted (DRAWS)."""
        return np.sort(self.p_alone(self.null / self.std).min(axis=1))

    def p_family_wise(self, p: Floats | float) -> Floats:
        """Chance that noise gives a p-value as small as ``p`` to any cause."""
        return family_wise(self.least, p)

    @property
    def least_p(self) -> float:
        """The smallest family-wise p-value of a cause, 1 without any."""
        p = self.p_alone(self.z)
        return float(self.p_family_wise(p.min())) if len(p) else 1.0

    def threshold(self, level: float) -> Floats:
        """The z (C) at which a cause is significant at the family-wise ``level``."""
        least = self.least
        p = least[max(int(level * len(least)) - 1, 0)]
        return np.where(self.one_sided, -ndtri(p), -ndtri(p / 2.0))


def score_test(
    lin: Linearisation,
    nuisances: NDArray[np.int64],
    prior: Floats,
    columns: Floats,
    one_sided: Sequence[bool],
    seed: int,
    draws: int = DRAWS,
) -> ScoreTest:
    """Scores at ``lin`` of causes whose derivatives are ``columns`` (K, C).

    ``nuisances`` indices of all that is free to explain the data, ``prior`` (m) their precision.
    """
    c = Projection.of(lin, nuisances, prior).out_of(columns.copy())
    rng = np.random.default_rng(seed)
    null = resampled_scores(lin.r, c.pure, draws, rng)
    null += rng.standard_normal((draws, len(c.away))) @ c.away
    return ScoreTest(c.score, c.information, np.array(one_sided), null)


@dataclass(frozen=True, slots=True)
class Projected:
    """Columns (K, C) with what n nuisances can explain of them taken out.

    ``weight`` (n, C) by how much each nuisance stands in for a column, ``pure`` (K, C) what none
    takes up, ``score`` (C) and its ``information`` (C, C); ``away`` (q, C): how scores respond to
    the nuisances that have a prior, each in its standard deviations.
    """

    weight: Floats
    pure: Floats
    score: Floats
    information: Floats
    away: Floats


@dataclass(frozen=True, slots=True)
class Apart:
    """Of each of C columns with nuisances taken out: ``score`` (C), its ``variance`` (C), and
    ``away`` (q, C) as :class:`Projected` has it."""

    score: Floats
    variance: Floats
    away: Floats


@dataclass(frozen=True, slots=True)
class Projection:
    """Takes out of columns what nuisances explain of them: of innovations ``r`` (K), nuisances
    ``theta`` (n) of precision ``known`` (n), by which the derivatives are ``psi`` (K, n)."""

    r: Floats
    psi: Floats
    theta: Floats
    known: Floats
    information: Floats

    @classmethod
    def of(cls, lin: Linearisation, nuisances: NDArray[np.int64], prior: Floats) -> Projection:
        """At ``lin``, of ``nuisances`` (n) of precision ``prior`` (m)."""
        psi = lin.by(nuisances)
        return cls(lin.r, psi, lin.theta[nuisances], prior[nuisances], psi.T @ psi)

    def out_of(self, columns: Floats) -> Projected:
        """Of ``columns`` (K, C), which are used up."""
        weight, priced, score = self._taken_out_of(columns)
        information = columns.T @ columns + weight.T @ priced
        return Projected(weight, columns, score, information, self._away(priced))

    def apart(self, columns: Floats) -> Apart:
        """The same of each column by itself, and of its information the variance alone."""
        weight, priced, score = self._taken_out_of(columns)
        variance = np.einsum("kc,kc->c", columns, columns) + (weight * priced).sum(axis=0)
        return Apart(score, variance, self._away(priced))

    def _away(self, priced: Floats) -> Floats:
        """How scores respond to what each nuisance that has a prior is off by, in its standard
        deviations (q, C); ``priced`` (n, C) by its precision."""
        some = self.known > 0.0
        return np.asarray(priced[some] / np.sqrt(self.known[some, None]))

    def _taken_out_of(self, columns: Floats) -> tuple[Floats, Floats, Floats]:
        """What nuisances explain of ``columns`` (K, C) taken out of them in place; how much each
        nuisance stands in for a column (n, C), the same by its precision, and scores (C).

        Information is made of sums of squares of what is left, not of differences: nuisances may
        take up all but a billionth of a column.
        """
        inner = self.information + np.diag(self.known + 1e-9)
        weight = np.asarray(np.linalg.solve(inner, self.psi.T @ columns), np.float64)
        add_product(columns, self.psi, -weight)
        priced = self.known[:, None] * weight
        return weight, priced, priced.T @ self.theta - columns.T @ self.r


def resampled_scores(r: Floats, pure: Floats, draws: int, rng: np.random.Generator) -> Floats:
    """Scores (draws, C) of ``pure`` (K, C) on innovations resampled from ``r`` (K)."""
    null = np.zeros((draws, pure.shape[1]))
    if not len(r):
        return null
    grouped = _in_groups(pure, rng)
    block = max(min(BLOCK, len(r) // BLOCKS), 1)
    # runs of a shuffled copy, which cost no more than reading them; no two blocks of a draw, and
    # no two draws of a block, begin at the same place but by chance
    shuffled = rng.permutation(r.astype(np.float32))
    runs = sliding_window_view(np.append(shuffled, shuffled[: block - 1]), block)
    for begin in range(0, len(grouped), block):
        piece = grouped[begin : begin + block]
        null += runs[rng.integers(len(r), size=draws), : len(piece)] @ piece
    return null


def _in_groups(pure: Floats, rng: np.random.Generator) -> NDArray[np.float32]:
    """Rows of ``pure`` (K, C), and where they are many, sums of GROUPS of them, each row with a
    random sign: scores of noise on these rows scatter as on all, to 1 in sqrt(GROUPS / 2)."""
    if len(pure) < 2 * GROUPS:
        return pure.astype(np.float32)
    grouped = np.zeros((GROUPS, pure.shape[1]), np.float32)
    for begin in range(0, len(pure), GROUPS):
        piece = pure[begin : begin + GROUPS]
        sign = rng.choice(np.array([-1.0, 1.0]), len(piece))
        grouped[: len(piece)] += piece * sign[:, None]
    return grouped


def family_wise(least: Floats, p: Floats | float) -> Floats:
    """Chance of a p-value as small as ``p`` anywhere; ``least``: that of each null draw, sorted.

    Counted among the draws; where they are too few, carried on in proportion to p from the
    smallest share that is resolved.
    """
    count = np.searchsorted(least, p, side="right")
    # draws below which counting is too coarse; the tail may be flatter than p beyond them
    known = min(max(round(0.01 * len(least)), 1), COUNTED)
    carried = np.minimum(p, 1.0) * known / len(least) / max(least[known - 1], 1e-300)
    return np.where(count >= known, count / len(least), np.minimum(carried, 1.0))


def d_prime(
    information: Floats, one_sided: Sequence[bool] | NDArray[np.bool_], i: int, size: float, k: int
) -> float:
    """Separability of cause ``i`` of ``size`` from cause ``k``, in standard deviations.

    ``information`` (C, C) with nuisances projected out, sizes in units of each gain; cause ``k``
    takes the size that resembles cause ``i`` most, from −1 (0 where ``one_sided``) to 1.
    """
    rival = 0.0
    if information[k, k] > 0.0:
        best = size * information[i, k] / information[k, k]
        rival = float(np.clip(best, 0.0 if one_sided[k] else -1.0, 1.0))
    squared = (
        size**2 * information[i, i]
        - 2.0 * size * rival * information[i, k]
        + rival**2 * information[k, k]
    )
    return float(np.sqrt(max(squared, 0.0)))
