"""Scores: how strongly each cause pulls at the data once everything known has had its share.

Around the most probable nuisances all is linear: the innovations r answer to θ by ψ.  A cause's
score is what is left of ψᵀr after nuisances, at the price of their priors, have explained what
they can (Rao's efficient score); its information is what is left of ψᵀψ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from clutchest.identify.maximum import Look
from clutchest.signals import Floats

DRAWS = 2000  # of the null
BLOCK = 4096  # readings drawn at a time
ABSENT = 1e-6  # information below which a cause leaves no trace (in squared standard deviations)


@dataclass(frozen=True, slots=True)
class Board:
    """Scores of C causes at one look.

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
        return np.where(self.one_sided, norm.sf(z), 2.0 * norm.sf(np.abs(z)))

    @property
    def least(self) -> Floats:
        """The smallest p-value of each null draw, sorted (DRAWS)."""
        return np.sort(self.p_alone(self.null / self.std).min(axis=1))

    def p_among_all(self, p: Floats | float) -> Floats:
        """Chance that noise gives a p-value as small as ``p`` to any cause.

        Counted among the draws; where they are too few, carried on in proportion to p from the
        smallest share that they still tell.
        """
        least = self.least
        count = np.searchsorted(least, p, side="right")
        known = max(round(0.01 * len(least)), 1)  # draws below which counting is too coarse
        carried = np.asarray(p) * known / len(least) / max(least[known - 1], 1e-300)
        return np.where(count >= known, count / len(least), np.minimum(carried, 1.0))

    def threshold(self, level: float) -> Floats:
        """The z (C) at which a cause is found at the family-wise ``level``."""
        least = self.least
        p = least[max(int(level * len(least)) - 1, 0)]
        return np.where(self.one_sided, norm.isf(p), norm.isf(p / 2.0))


def board(
    look: Look,
    nuisances: NDArray[np.int64],
    prior: Floats,
    columns: Floats,
    one_sided: Sequence[bool],
    seed: int,
    draws: int = DRAWS,
) -> Board:
    """Scores at ``look`` of causes whose derivatives are ``columns`` (K, C).

    ``nuisances`` indices of all that is free to explain the data, ``prior`` (m) their precision.
    """
    psi = look.psi[:, nuisances]
    inner = psi.T @ psi
    shared = psi.T @ columns  # (n, C)
    inverse = np.linalg.inv(inner + np.diag(prior[nuisances] + 1e-9))
    weight = inverse @ shared  # (n, C)
    pull = psi.T @ look.r + prior[nuisances] * look.theta[nuisances]
    score = -(columns.T @ look.r - weight.T @ pull)
    information = columns.T @ columns - shared.T @ weight
    left = columns - psi @ weight  # what of each cause no nuisance takes up
    known = prior[nuisances] > 0.0
    null = np.zeros((draws, columns.shape[1]))
    rng = np.random.default_rng(seed)
    for begin in range(0, len(left), BLOCK):
        piece = left[begin : begin + BLOCK].astype(np.float32)
        drawn = rng.integers(len(look.r), size=(draws, len(piece)), dtype=np.int32)
        null += look.r.astype(np.float32)[drawn] @ piece
    # nuisances as their priors have them, and what the fit makes of them
    away = (shared - (inner @ weight))[known]
    null += rng.standard_normal((draws, int(known.sum()))) @ away
    return Board(score, information, np.array(one_sided), null)
