"""What no named cause explains: an error of one equation as a free curve over one quantity.

Each curve's coefficients have a prior of one plausible error, so that its score test is one for a
variance: is there any error of this kind at all?  Its null has its maximum on the boundary, and is
drawn, not looked up.  Over time, the curve stands for process noise in the equation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from clutchest.discovery.drivers import KNOTS, drivers, hats, knots
from clutchest.discovery.probes import PREFIX
from clutchest.discovery.score import among, cleared, redrawn
from clutchest.identify.maximum import Fitter, Look
from clutchest.identify.problem import Problem
from clutchest.signals import Floats

DRAWS = 1000
DOUBTFUL = 0.05  # p-value of a single curve from which its scatter is looked at
BLOCK_TIME = 2.0  # s
ENTRIES = 1e7  # of derivatives, held at a time


@dataclass(frozen=True, slots=True)
class Curve:
    """An error of ``equation`` as a curve over ``driver``.

    ``at`` its knots, ``coefficients`` the most probable ones (units of the probe) with their
    ``covariance``; ``given_back`` by how much each free number had stood in for it;
    ``statistic`` in the sense of −2 ln(probability), ``rank`` how many of its coefficients the
    data know, ``p`` alone and ``p_value`` among all curves.
    """

    equation: str
    driver: str
    at: Floats
    coefficients: Floats
    covariance: Floats
    given_back: Floats
    statistic: float
    rank: float
    p: float
    p_value: float

    @property
    def worth(self) -> float:
        """Its statistic less what noise alone gives it."""
        return self.statistic - 2.0 * self.rank

    @property
    def evidence(self) -> float:
        """2 ln of the Bayes factor against no such error: a curve with more freedom pays for it."""
        return self.statistic + float(np.linalg.slogdet(self.covariance)[1])


def curves(
    problem: Problem, fitter: Fitter, look: Look, free: NDArray[np.int64], seed: int
) -> list[Curve]:
    """Every curve over every driver, the likeliest first, beside what is ``free`` at ``look``."""
    found, least, blocks = [], np.ones(DRAWS), problem.blocks(BLOCK_TIME)
    for left, tables in _left_over(problem, fitter, look):
        c = cleared(look, free, fitter.prior, left)
        rng = np.random.default_rng(seed)  # every portion meets the same draws of noise
        null = rng.standard_normal((DRAWS, len(c.away))) @ c.away
        null += redrawn(look.r, c.pure, DRAWS, rng)
        for owner, driver, at, columns in tables:
            pure, information = c.pure[:, columns], c.information[np.ix_(columns, columns)]
            covariance = np.asarray(np.linalg.inv(information + np.eye(len(columns))), np.float64)
            rank = float(np.trace(covariance @ information))
            if rank < 0.1:
                continue
            best = covariance @ c.score[columns]
            statistic = float(c.score[columns] @ best)
            if chi2.sf(statistic, rank) < DOUBTFUL:
                statistic /= _unrest(pure, look.r + pure @ best, blocks, covariance, rank)
            drawn = np.einsum("ki,ij,kj->k", null[:, columns], covariance, null[:, columns])
            least = np.minimum(least, chi2.sf(drawn, rank))
            found.append(Curve(
                owner.removeprefix(PREFIX), driver, at, best, covariance,
                c.weight[:, columns] @ best, statistic, rank,
                float(chi2.sf(statistic, rank)), 1.0,
            ))  # fmt: skip
        del left, c, pure  # before the next ones are made
    least = np.sort(least)
    named = [replace(curve, p_value=float(among(least, curve.p))) for curve in found]
    return sorted(named, key=lambda curve: -curve.evidence)


def _unrest(
    pure: Floats, rest: Floats, blocks: NDArray[np.int64], covariance: Floats, rank: float
) -> float:
    """How much more the scores of ``pure`` (K, c) scatter from block to block than noise at its
    mean level makes them: where inputs move fast, their noise and timing weigh more."""
    each = np.zeros((int(blocks.max()) + 1, pure.shape[1]))
    np.add.at(each, blocks, pure * rest[:, None])
    return max(1.0, float(np.trace(covariance @ (each.T @ each))) / rank)


Table = tuple[str, str, Floats, NDArray[np.int64]]  # probe, driver, knots, columns


def _left_over(
    problem: Problem, fitter: Fitter, look: Look
) -> Iterator[tuple[Floats, list[Table]]]:
    """Derivatives (K, C) of the white innovations by every coefficient of every curve; some of the
    drivers at a time, as many as memory likes."""
    owners = [t.owner for t in problem.thetas]
    probes = [k for k, owner in enumerate(owners) if owner.startswith(PREFIX)]
    values = [drivers(drive) for drive in problem.drives]
    acts = np.concatenate([drive.acts for drive in problem.drives]).astype(float)
    acts = acts if acts.any() else np.ones(len(acts))
    bent = {}
    for name in (n for n in values[0] if all(n in v for v in values)):
        at = knots(name, np.concatenate([v[name] for v in values]), acts)
        if at is not None:
            bent[name] = at
    readings = sum(len(drive.rows) for drive in problem.drives)
    portion = max(round(ENTRIES / max(readings * len(probes) * KNOTS, 1)), 1)
    for some in (list(bent.items())[i : i + portion] for i in range(0, len(bent), portion)):
        bases = [np.column_stack([hats(v[name], at) for name, at in some]) for v in values]
        tables, begin = [], 0
        for k in probes:
            for name, at in some:
                tables.append((owners[k], name, at, np.arange(begin, begin + len(at))))
                begin += len(at)
        yield fitter.modulated(look, probes, bases), tables
