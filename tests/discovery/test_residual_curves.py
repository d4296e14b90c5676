"""Curves of what no named cause explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import clutchest
from clutchest.discovery.curve_evidence import SCALES, covariance, evidence, expected
from clutchest.discovery.nuisances import Nuisances
from clutchest.discovery.residual_curves import (
    CandidateCurve,
    CurvesAt,
    curves,
    places,
)
from clutchest.discovery.several_errors import CurveColumns, evidence_joined
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import Projection
from clutchest.models.error_term_effects import error_term_effects


def test_evidence_is_twice_the_logarithm_of_the_bayes_factor() -> None:
    """Of data y = X c + noise with c ~ N(0, s²), s any of SCALES, by the marginal likelihoods
    themselves; many scores at once as each alone."""
    rng = np.random.default_rng(5)
    healthy = multivariate_normal(np.zeros(40), np.eye(40))
    for columns in (1, 3, 8):
        x, none = rng.standard_normal((40, columns)), np.zeros((columns, columns))
        y = rng.standard_normal((4, 40)) + rng.standard_normal((4, columns)) @ x.T
        each = [
            multivariate_normal(np.zeros(40), np.eye(40) + s**2 * x @ x.T).logpdf(y) for s in SCALES
        ]
        factor = 2.0 * (np.log(np.mean(np.exp(each), axis=0)) - healthy.logpdf(y))
        np.testing.assert_allclose(evidence(y @ x, x.T @ x, none), factor, rtol=1e-9)
        np.testing.assert_allclose(evidence(y[2] @ x, x.T @ x, none), factor[2], rtol=1e-9)
        means = [np.linalg.solve(x.T @ x + np.eye(columns) / s**2, x.T @ y[2]) for s in SCALES]
        weights = np.exp(np.array(each)[:, 2] - np.max(np.array(each)[:, 2]))
        weights /= weights.sum()
        mean, off = expected(y[2] @ x, x.T @ x, none)
        np.testing.assert_allclose(mean, weights @ means, rtol=1e-9)
        second = sum(
            w * (np.linalg.inv(x.T @ x + np.eye(columns) / s**2) + np.outer(m, m))
            for w, s, m in zip(weights, SCALES, means, strict=True)
        )
        np.testing.assert_allclose(off.T @ off, second - np.outer(mean, mean), atol=1e-12)


def test_a_faint_direction_is_no_evidence() -> None:
    """Two columns that are all but one: their difference holds only noise, which may go with what
    is left of the data."""
    rng = np.random.default_rng(6)
    shared, noise = rng.standard_normal((2, 400))
    x = np.column_stack([shared, shared + 1e-3 * noise])
    y = 30.0 * noise / np.linalg.norm(noise)
    score, information = 1e3 * y @ x, 1e6 * x.T @ x
    assert evidence(score, information, np.zeros((2, 2))) > 500.0
    assert evidence(score, information, 1e-5 * information) > 500.0  # of itself: all of it is told
    assert evidence(score, information, 1e-5 * 1e6 * np.eye(2) * np.sum(shared**2)) < 5.0


@pytest.mark.slow
def test_the_noise_of_a_current_that_settles_at_once_is_no_error_of_the_motor() -> None:
    """A straight curve over the motor's torque is its torque constant, but for the voltage's noise
    that the current of the one has and the mean current of the other has not.  Innovations that go
    with the difference by 9 standard deviations, as the angle's do, are no error."""
    vehicle = clutchest.load_vehicle("alsd_rig")
    signals = clutchest.simulate(vehicle, "rig-ramps", 31, duration=20.0)
    effects = error_term_effects(vehicle.machine)
    problem = with_fitted_gains(Problem.of(signals, vehicle, effects, discrepant=True))
    objective = Objective.of(problem)
    at = CurvesAt.of(objective, objective.white_at(problem.begin))
    tables = [t for t in at.every() if (t.term, t.covariate) == ("motor", "motor_torque")]
    nuisances = problem.nuisances, objective.prior
    ((columns, _),) = at.derivatives(tables)
    left = Projection.of(at.fit, *nuisances).out_of(columns)
    faint = left.pure @ np.linalg.eigh(left.information)[1][:, 0]
    fit = replace(at.fit, r=at.fit.r - 9.0 * faint / np.linalg.norm(faint))
    (curve,) = replace(at, fit=fit).tested(Nuisances(fit, *nuisances), tables, 3)
    assert curve.worth < 0.0
    assert curve.p_value > 0.01
    nothing = [tables[0]._replace(negligible=1e9)]  # it is none, but it has been looked at
    (curve,) = replace(at, fit=fit).tested(Nuisances(fit, *nuisances), nothing, 3)
    assert not curve.coefficients.any()


def test_coefficients_have_no_variance_where_the_data_inform_too_little() -> None:
    """Of two directions, the faint one stays at 0, the other has its variance of before."""
    information, negligible = np.diag([4.0, 0.1]), np.diag([1.0, 1.0])
    np.testing.assert_allclose(covariance(information, negligible), np.diag([0.2, 0.0]))
    np.testing.assert_allclose(covariance(information, 0.0 * negligible), np.diag([0.2, 1.0 / 1.1]))


@pytest.mark.slow
def test_no_error_is_sought_over_a_speed_that_is_held() -> None:
    """A rig's slip is held at one speed: what it moves about that is the torque's doing, and an
    error's of its equation."""
    vehicle = clutchest.load_vehicle("alsd_rig")
    for scenario, sought in (("rig-ramps", False), ("slip-oil-sweep", True)):
        signals = clutchest.simulate(vehicle, scenario, 31, duration=20.0)
        problem = Problem.of(signals, vehicle, error_term_effects(vehicle.machine))
        objective = Objective.of(problem)
        at = CurvesAt.of(objective, objective.white_at(np.zeros(len(problem.thetas))))
        assert ("slip_speed" in {table.covariate for table in at.every()}) is sought
        assert "motor_torque" in {table.covariate for table in at.every()}


class Sheared:
    """Oil that is sheared between plates which do not touch."""

    def law(self):
        def act(seen: Mapping[str, float]) -> dict[str, float]:
            gap = max(seen["free_play"] - seen["plate"], 0.0)
            return {"film": (gap > 0.0) * seen["slip_speed"] / (0.2 + gap / 1e-4)}

        return act

    def readings(self, true):
        return true


@pytest.mark.slow
def test_drag_in_the_open_gap_is_an_error_of_the_torque_over_slip_and_gap() -> None:
    vehicle = clutchest.load_vehicle("alsd_rig")
    signals = clutchest.simulate(vehicle, "coast", 31, duration=20.0, outsider=Sheared())
    problem = with_fitted_gains(
        Problem.of(signals, vehicle, error_term_effects(vehicle.machine), discrepant=True)
    )
    objective = Objective.of(problem)
    fit = objective.white_at(problem.begin)
    found = curves(objective, fit, Nuisances(fit, problem.nuisances, objective.prior), seed=3)
    assert (found[0].equation, found[0].covariate) == ("torque", "slip_speed")
    at = CurvesAt.of(objective, fit)
    place = places(problem)
    tables = {
        c.covariate: CandidateCurve(
            c.error_term, c.equation, place[c.error_term], c.covariate, c.at
        )
        for c in found
        if c.error_term == "drag"
    }
    over = [tables[name] for name in ("slip_speed", "gap", "oil_temp")]
    ((columns, some),) = at.derivatives(over)
    each = [(table, columns[:, own]) for table, own in some]
    parts = [CurveColumns(by, n) for (_, by), n in zip(each, at.negligible(each), strict=True)]
    joined = evidence_joined(Nuisances(fit, problem.nuisances, objective.prior), parts)
    assert joined.which[:2] == (0, 1)


def test_a_position_is_a_covariate_however_far_from_zero_it_moves() -> None:
    """A plate moves by less than a fifth of what its sensor reads; an engine that idles, held by
    its governor, by as little."""
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "launches", 5, duration=60.0)
    problem = Problem.of(signals, truck, error_term_effects(truck.machine))
    objective = Objective.of(problem)
    at = CurvesAt.of(objective, objective.linearise_at(np.zeros(len(problem.thetas))))
    (bends,) = at.bends("slave_position")
    assert np.ptp(bends) < 0.2 * bends.max()
    over = {(table.term, table.covariate) for table in at.every()}
    assert ("disc_heat, exchanged", "slave_position") in over
    assert not at._regulated("slave_position", bends)
    assert at._regulated("engine_speed", bends)
