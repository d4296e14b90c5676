"""What no named cause explains: an error of one equation as a free curve over one quantity.

Each curve's coefficients have a prior of one plausible error, so that its score test is one for a
variance: is there any error of this kind at all?  Its null has its maximum on the boundary, and is
drawn, not looked up.  Over time, the curve stands for process noise in the equation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from clutchest.discover.drivers import drivers, hats, knots
from clutchest.discover.probes import PREFIX
from clutchest.discover.score import BLOCK
from clutchest.identify.linearised import Problem
from clutchest.identify.maximum import Fitter, Look
from clutchest.signals import Floats

DRAWS = 1000


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


def curves(
    problem: Problem, fitter: Fitter, look: Look, free: NDArray[np.int64], seed: int
) -> list[Curve]:
    """Every curve over every driver, best first, beside what is ``free`` at ``look``."""
    owners = [t.owner for t in problem.thetas]
    probes = [k for k, owner in enumerate(owners) if owner.startswith(PREFIX)]
    left, tables = _left_over(problem, fitter, look, free, probes)
    psi = look.psi[:, free]
    prior = fitter.prior[free]
    inner = psi.T @ psi
    inverse = np.linalg.inv(inner + np.diag(prior + 1e-9))
    pull = psi.T @ look.r + prior * look.theta[free]
    shared = psi.T @ left
    weight = inverse @ shared
    score = -(left.T @ look.r - weight.T @ pull)
    null = _null(look, left - psi @ weight, (shared - inner @ weight)[prior > 0.0], seed)
    found, least = [], np.ones(len(null))
    for owner, driver, at, columns in tables:
        part = left[:, columns]
        information = part.T @ part - shared[:, columns].T @ weight[:, columns]
        information = (information + information.T) / 2.0
        covariance = np.asarray(np.linalg.inv(information + np.eye(len(columns))), np.float64)
        rank = float(np.trace(covariance @ information))
        if rank < 0.1:
            continue
        statistic = float(score[columns] @ covariance @ score[columns])
        drawn = np.einsum("ki,ij,kj->k", null[:, columns], covariance, null[:, columns])
        least = np.minimum(least, chi2.sf(drawn, rank))
        found.append(Curve(
            owner.removeprefix(PREFIX), driver, at, covariance @ score[columns], covariance,
            weight[:, columns] @ (covariance @ score[columns]), statistic, rank,
            float(chi2.sf(statistic, rank)), 1.0,
        ))  # fmt: skip
    least = np.sort(least)
    known = max(len(least) // 100, 1)
    named = []
    for curve in found:
        count = int(np.searchsorted(least, curve.p, side="right"))
        among = count / len(least) if count >= known else (
            curve.p * known / len(least) / max(least[known - 1], 1e-300))  # fmt: skip
        named.append(replace(curve, p_value=min(among, 1.0)))
    return sorted(named, key=lambda curve: -curve.worth)


Table = tuple[str, str, Floats, NDArray[np.int64]]  # probe, driver, knots, columns


def _left_over(
    problem: Problem, fitter: Fitter, look: Look, free: NDArray[np.int64], probes: list[int]
) -> tuple[Floats, list[Table]]:
    """Derivatives (K, C) of the white innovations by every coefficient of every curve."""
    values = [drivers(drive) for drive in problem.drives]
    names = [n for n in values[0] if all(n in v for v in values)]
    parts, tables, begin = [], [], 0
    for name in names:
        joined = np.concatenate([v[name] for v in values])
        acts = np.concatenate([drive.acts for drive in problem.drives]).astype(float)
        at = knots(name, joined, acts if acts.any() else np.ones(len(acts)))
        if at is None:
            continue
        bases = [hats(v[name], at) for v in values]
        parts.append(fitter.modulated(look, probes, bases))
        for k in probes:
            columns = np.arange(begin, begin + len(at))
            tables.append((problem.thetas[k].owner, name, at, columns))
            begin += len(at)
    return np.concatenate(parts, axis=1), tables


def _null(look: Look, left: Floats, away: Floats, seed: int) -> Floats:
    """Scores (DRAWS, C) of data without any error beyond noise and nuisances."""
    rng = np.random.default_rng(seed)
    null = rng.standard_normal((DRAWS, len(away))) @ away
    r = look.r.astype(np.float32)
    for begin in range(0, len(left), BLOCK):
        piece = left[begin : begin + BLOCK].astype(np.float32)
        drawn = rng.integers(len(r), size=(DRAWS, len(piece)), dtype=np.int32)
        null += r[drawn] @ piece
    return np.asarray(null, np.float64)
