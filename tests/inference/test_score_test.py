"""Scores of causes, on regressions whose answers are known.

Innovations r of K readings answer to nuisances by ψ and to causes by columns; all is linear, and
noise is normal with variance 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import binomtest, kstest, norm

from clutchest.discovery.search import LEVEL
from clutchest.inference.score_test import (
    DRAWS,
    GROUPS,
    ScoreTest,
    family_wise,
    resampled_scores,
    score_test,
)
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

NUISANCES = 5
PRIOR = np.array([1.0, 1.0, 1.0, 0.0, 0.0])  # the last two are free
ONE_SIDED = (False, True, False, True, False, False, True, False)


@dataclass(frozen=True)
class Regression:
    """``psi`` (K, n) and ``columns`` (K, C); causes resemble each other and the nuisances."""

    psi: Floats
    columns: Floats

    @classmethod
    def of(cls, readings: int, seed: int) -> Regression:
        rng = np.random.default_rng(seed)
        psi = 0.2 * rng.standard_normal((readings, NUISANCES))
        common = rng.standard_normal((readings, 2))
        columns = common @ rng.standard_normal((2, len(ONE_SIDED)))
        columns += psi @ rng.normal(size=(NUISANCES, len(ONE_SIDED))) * 3.0
        return cls(psi, 0.3 * columns + 0.1 * rng.standard_normal(columns.shape))

    def at(self, r: Floats, theta: Floats) -> Linearisation:
        return Linearisation(theta, {}, r, self.psi, 0.0, (), ())

    def score_test(self, fit: Linearisation, draws: int = DRAWS) -> ScoreTest:
        every = np.arange(NUISANCES)
        return score_test(fit, every, PRIOR, self.columns, ONE_SIDED, 3, draws)

    def fitted(self, noise: Floats, true: Floats) -> Linearisation:
        """At the most probable nuisances, where the truth is ``true`` (n)."""
        r = noise - self.psi @ true  # at θ = 0; ψ is the derivative of r
        inner = self.psi.T @ self.psi + np.diag(PRIOR)
        theta = -np.linalg.solve(inner, self.psi.T @ r)
        return self.at(r + self.psi @ theta, theta)


def generalised(regression: Regression, fit: Linearisation) -> tuple[Floats, Floats]:
    """Score and information where nuisances with a prior are part of the noise, V = 1 + ψψᵀ, and
    the others are estimated: generalised least squares, written down."""
    known, free = PRIOR > 0, PRIOR == 0
    psi = regression.psi
    V = np.eye(len(psi)) + psi[:, known] @ np.diag(1 / PRIOR[known]) @ psi[:, known].T
    inverse = np.linalg.inv(V)
    U = psi[:, free]
    weighed = inverse @ U
    left = inverse - weighed @ np.linalg.solve(U.T @ weighed, weighed.T)
    at_zero = fit.r - psi @ fit.theta
    return -regression.columns.T @ left @ at_zero, regression.columns.T @ left @ regression.columns


def test_what_nuisances_all_but_take_up_keeps_its_digits():
    """A sensor's offset, beside the zero position at the start: one part in 10^13 is its own."""
    rng = np.random.default_rng(2)
    regression = Regression.of(2000, 2)
    own = 0.1 * rng.standard_normal(regression.columns.shape)
    columns = 1e5 * regression.psi @ rng.normal(size=(NUISANCES, len(ONE_SIDED))) + own
    fit = regression.at(rng.standard_normal(2000), rng.standard_normal(NUISANCES))
    every = np.arange(NUISANCES)
    found = score_test(fit, every, np.zeros(NUISANCES), columns, ONE_SIDED, 3, 10)
    q, _ = np.linalg.qr(regression.psi)
    left = own - q @ (q.T @ own)
    np.testing.assert_allclose(found.information, left.T @ left, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("where", ["zero", "fitted", "anywhere"])
def test_scores_are_those_of_generalised_least_squares(where):
    """Wherever the nuisances stand: a score takes them as free."""
    rng = np.random.default_rng(1)
    regression = Regression.of(300, 1)
    noise, true = rng.standard_normal(300), rng.standard_normal(NUISANCES)
    fit = regression.fitted(noise, true)
    if where != "fitted":
        theta = np.zeros(NUISANCES) if where == "zero" else rng.standard_normal(NUISANCES)
        fit = regression.at(noise - regression.psi @ (true - theta), theta)
    found = regression.score_test(fit, draws=10)
    score, information = generalised(regression, fit)
    np.testing.assert_allclose(found.score, score, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.information, information, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.z, score / np.sqrt(np.diag(information)), atol=1e-6)


def test_a_score_points_to_the_cause():
    """Score over information estimates a cause's size, as a fit of it with all nuisances does."""
    regression, size = Regression.of(3000, 2), 0.4
    noise = np.random.default_rng(2).standard_normal(3000)
    fit = regression.fitted(noise - regression.columns[:, 4] * size, np.zeros(NUISANCES))
    found = regression.score_test(fit, draws=10)
    estimate = found.score[4] / found.information[4, 4]
    table = np.column_stack([regression.psi, regression.columns[:, 4]])
    inner = table.T @ table + np.diag([*PRIOR, 0.0])
    at_zero = fit.r - regression.psi @ fit.theta
    assert estimate == pytest.approx(-np.linalg.solve(inner, table.T @ at_zero)[-1], rel=1e-6)
    assert abs(estimate - size) < 3.3 / found.std[4]


def test_null_draws_scatter_as_the_information_says():
    """Of innovations with mean square 1; nuisances as their priors have them."""
    regression = Regression.of(3000, 3)
    r = np.random.default_rng(3).standard_normal(3000)
    r = (r - r.mean()) / r.std()
    draws = 10_000
    found = regression.score_test(regression.at(r, np.zeros(NUISANCES)), draws)
    white = np.linalg.solve(np.linalg.cholesky(found.information), found.null.T)
    count = len(ONE_SIDED)
    assert np.all(np.abs(white.mean(axis=1)) < 4 / np.sqrt(draws))
    off = white @ white.T / draws - np.eye(count)
    assert np.all(np.abs(off) < 4 * np.sqrt((1 + np.eye(count)) / draws))
    # and the priors are a part of it that matters
    apart = replace(regression, psi=np.zeros_like(regression.psi))
    alone = apart.score_test(apart.at(r, np.zeros(NUISANCES)), 10).information
    assert np.all(np.diag(found.information) < 0.9 * np.diag(alone))


def test_null_draws_have_the_tails_of_the_innovations():
    """A cause that one reading tells of is judged by how far off one reading may be."""
    rng = np.random.default_rng(4)
    r = rng.standard_t(3, 4000) / np.sqrt(3)
    columns = np.zeros((4000, 2))
    columns[7, 0], columns[:, 1] = 1.0, 1.0
    fit = Linearisation(np.zeros(1), {}, r - r.mean(), np.zeros((4000, 1)), 0.0, (), ())
    found = score_test(fit, np.array([0]), np.ones(1), columns, (False, False), 5, 20_000)
    far = np.mean(np.abs(found.null / found.std) > 4.0, axis=0)
    assert far[0] == pytest.approx(np.mean(np.abs(r - r.mean()) > 4.0), abs=3e-3)
    assert far[0] > 10 * far[1]


def test_readings_of_a_long_record_are_drawn_in_groups_and_scatter_as_alone():
    """Columns that vary slowly, as curves over a covariate do, and one that one reading tells of;
    innovations with tails, and a mean that their number makes visible."""
    rng, readings, draws = np.random.default_rng(6), 5 * GROUPS + 17, 20_000
    along = np.linspace(-1.0, 1.0, readings)
    columns = np.column_stack([np.exp(-(((along - at) / 0.2) ** 2)) for at in (-0.9, 0.0, 0.3)])
    columns = np.column_stack([columns, np.arange(readings) == 7])
    r = 0.01 + rng.standard_t(3, readings) / np.sqrt(3)
    null = resampled_scores(r, columns, draws, rng)
    white = np.linalg.solve(np.linalg.cholesky(columns.T @ columns * np.mean(r**2)), null.T)
    off = white[:3] @ white[:3].T / draws - np.eye(3)
    assert np.all(np.abs(off) < 4 * np.sqrt((1 + np.eye(3)) * (1 / draws + 1 / GROUPS)))
    assert np.all(np.abs(white[:3].mean(axis=1)) < 4 * np.sqrt(1 / draws + 1 / GROUPS))
    far = np.mean(np.abs(white) > 4.0, axis=1)
    assert far[3] == pytest.approx(np.mean(np.abs(r) > 4.0 * r.std()), abs=3e-3)
    assert far[3] > 10 * far[0]


def test_draws_repeat_themselves():
    regression = Regression.of(300, 5)
    fit = regression.fitted(np.random.default_rng(5).standard_normal(300), np.zeros(NUISANCES))
    np.testing.assert_array_equal(regression.score_test(fit).null, regression.score_test(fit).null)
    assert regression.score_test(fit).null.shape == (DRAWS, len(ONE_SIDED))


def test_p_family_wise_is_uniform_where_nothing_acts():
    """400 made-up drives, nuisances drawn from their priors or wherever they like."""
    rng, count = np.random.default_rng(6), 400
    regression = Regression.of(400, 6)
    found = []
    for _ in range(count):
        true = rng.standard_normal(NUISANCES) * np.where(PRIOR > 0, 1.0, 20.0)
        scores = regression.score_test(regression.fitted(rng.standard_normal(400), true), draws=400)
        found.append(float(scores.p_family_wise(scores.p_alone(scores.z).min())))
    assert kstest(found, "uniform").pvalue > 1e-3
    assert np.mean(np.array(found) < 0.05) == pytest.approx(0.05, abs=3.3 * np.sqrt(0.05 / count))


def normal_board(draws: int = DRAWS, causes: int = 10, one_sided: bool = False) -> ScoreTest:
    """Causes that have nothing to do with each other, no score."""
    null = np.random.default_rng(7).standard_normal((draws, causes))
    return ScoreTest(np.zeros(causes), np.eye(causes), np.full(causes, one_sided), null)


def test_p_values_of_independent_causes():
    """1 − (1 − p)^C, also far below what draws can count."""
    scores = normal_board()
    for p, wide in [
        (0.02, 3.3 * np.sqrt(0.2 / 2000) / 0.2),
        (0.002, 0.5),
        (1e-4, 1.0),
        (1e-8, 1.0),
    ]:
        expected = -np.expm1(10 * np.log1p(-p))
        assert scores.p_family_wise(p) == pytest.approx(expected, rel=wide)


def test_p_family_wise_is_carried_on_without_a_jump():
    scores = normal_board()
    p = np.concatenate([np.geomspace(1e-200, 1e-6, 500), np.geomspace(1e-6, 1.0, 20_000)])
    found = scores.p_family_wise(p)
    assert np.all(np.diff(found) >= 0.0) and np.all((found >= 0.0) & (found <= 1.0))
    assert np.all(found >= p * (1 - 1e-9))  # more causes, more chances
    last = scores.least[DRAWS // 100 - 1]  # the smallest share that is counted
    assert scores.p_family_wise(last) == 0.01
    assert scores.p_family_wise(last * (1 - 1e-9)) == pytest.approx(0.01)
    tiny = p < 1e-6
    np.testing.assert_allclose(found[tiny] / p[tiny], found[0] / p[0])
    assert scores.p_family_wise(0.0) == 0.0
    # of curves, p may be a bound far above 1, and no draw need be likely
    assert family_wise(np.zeros(DRAWS), 1e20) == 1.0


@pytest.mark.parametrize("one_sided", [False, True])
@pytest.mark.parametrize("level", [0.05, 0.01])
def test_a_threshold_is_where_the_level_is_reached(level, one_sided):
    scores = normal_board(one_sided=one_sided)
    z = scores.threshold(level)
    for cause in range(len(z)):
        p = scores.p_alone(np.where(np.arange(len(z)) == cause, z, 0.0))[cause]
        assert scores.p_family_wise(p * (1 + 1e-6)) == pytest.approx(level, abs=1.5 / DRAWS)
    sides = 1 if one_sided else 2
    exact = norm.isf(-np.expm1(np.log1p(-level) / 10) / sides)
    assert z[0] == pytest.approx(exact, abs=0.15)


def test_one_sided_causes_take_no_negative_score():
    scores = ScoreTest(
        np.array([-9.0, -9.0, 2.0]),
        np.eye(3),
        np.array([True, False, True]),
        np.random.default_rng(8).standard_normal((2000, 3)),
    )
    p = scores.p_alone(scores.z)
    assert p[0] > 0.999 and p[1] < 1e-15
    assert p[2] == pytest.approx(norm.sf(2.0))
    assert scores.p_family_wise(p[0]) == pytest.approx(1.0)
    assert scores.threshold(0.01)[0] < scores.threshold(0.01)[1]


def test_causes_without_a_trace_never_win():
    """Their score is no more than rounding, however small its own unit; others do not notice."""
    regression = Regression.of(600, 9)
    rng = np.random.default_rng(9)
    fit = regression.fitted(rng.standard_normal(600), rng.standard_normal(NUISANCES))
    plain = regression.score_test(fit)
    dead = np.column_stack(
        [
            np.zeros(600),
            1e-7 * rng.standard_normal(600),
            regression.psi[:, 4],
        ]
    )  # nothing at all, next to nothing, and what a free nuisance does as well
    more = score_test(
        fit,
        np.arange(NUISANCES),
        PRIOR,
        np.column_stack([regression.columns, dead]),
        (*ONE_SIDED, True, False, False),
        3,
    )
    assert np.all(np.isinf(more.std[-3:])) and np.all(more.z[-3:] == 0.0)
    p = more.p_alone(more.z)
    assert np.all(p[-3:] >= 0.5)
    np.testing.assert_allclose(more.z[:-3], plain.z, atol=1e-9)
    for level in (0.05, 0.01):
        np.testing.assert_allclose(
            more.threshold(level)[:-3], plain.threshold(level), atol=0.25
        )  # other draws
    assert more.p_family_wise(p[-3:]).min() > 0.9


def test_without_readings_nothing_is_claimed():
    nothing = Regression(np.zeros((0, NUISANCES)), np.zeros((0, len(ONE_SIDED))))
    found = nothing.score_test(nothing.at(np.zeros(0), np.zeros(NUISANCES)), 10)
    assert not found.z.any() and not found.null.any()


def test_false_findings_are_as_rare_as_discovery_promises():
    """The level at which a search names a cause: below 1 % of logs in which none acts."""
    rng = np.random.default_rng(11)
    regression, logs = Regression.of(150, 11), 3000
    reference = regression.score_test(regression.fitted(rng.standard_normal(150), np.zeros(5)))
    findings = 0
    for _ in range(logs):
        true = np.where(PRIOR > 0, rng.standard_normal(NUISANCES), 0.0)
        fit = regression.fitted(rng.standard_normal(150), true)
        z = regression.score_test(fit, draws=1).z
        findings += bool(reference.p_family_wise(reference.p_alone(z).min()) <= LEVEL)
    assert binomtest(findings, logs, 0.01, "greater").pvalue > 1e-3
    assert binomtest(findings, logs, 0.004, "less").pvalue > 1e-3  # nor does it hardly ever look


def test_what_a_nuisance_of_another_spread_may_be_off_by_counts_in_the_null():
    """Scores scatter as their information says, whatever the nuisance's precision."""
    regression = Regression.of(2000, seed=4)
    fit = regression.at(np.random.default_rng(1).standard_normal(2000), np.zeros(NUISANCES))
    for prior in (PRIOR, np.array([1e-3, 1.0, 400.0, 0.0, 0.0])):
        every = np.arange(NUISANCES)
        found = score_test(fit, every, prior, regression.columns, ONE_SIDED, 3, 4000)
        np.testing.assert_allclose(found.null.std(axis=0) / found.std, 1.0, atol=0.06)
