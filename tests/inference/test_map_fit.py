"""The most probable numbers, of small problems with known answers and of a drive."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import chi2

import clutchest
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import SETTLED, improve, most_probable, settle, without
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import UnknownParameter
from clutchest.models import machine_of
from clutchest.signals import Floats
from made_up import PERIOD, MadeUp, objective_of

TIME = np.arange(400) * PERIOD


def decay(theta: Floats) -> Floats:
    """Amplitude and rate with priors, and a gain that adds a wave."""
    amplitude, rate, wave = theta
    return 8.0 * (1 + 0.2 * amplitude) * np.exp(-TIME * (1 + 0.3 * rate)) + wave * np.sin(3 * TIME)


@pytest.mark.parametrize("seed", range(5))
def test_optimum_is_that_of_least_squares(seed):
    rng = np.random.default_rng(seed)
    true = np.array([*rng.standard_normal(2), rng.uniform(-1.5, 1.5)])
    data = decay(true) + rng.standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (-2.0, 2.0)})
    begin, best = problem.objective.linearise_at(np.zeros(3)), problem.reference(np.zeros(3))
    for derivatives in (True, False):  # where they are not asked for, it ends sooner
        fit = improve(problem.objective, begin, problem.all, derivatives=derivatives)
        assert 2 * best.cost - 1e-9 <= fit.cost < 2 * best.cost + SETTLED
        # what is left to gain is worth less than that many standard deviations of anything
        off = fit.theta - best.x
        assert off @ (best.jac.T @ best.jac) @ off < 2 * SETTLED


def test_what_is_nearly_linear_is_fitted_by_few_derivatives(monkeypatch):
    """Several steps to the optimum, all by the derivatives of the start."""
    true = np.array([0.5, -0.6, 0.8])
    data = decay(true) + 0.01 * np.random.default_rng(8).standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (-2.0, 2.0)})
    begin = problem.objective.linearise_at(true + 0.4)
    made, again = [], Objective.relinearise

    def counted(self, lin, theta, shapes=None, active=None):
        made.append(active is None or len(active) > 0)
        return again(self, lin, theta, shapes, active)

    monkeypatch.setattr(Objective, "relinearise", counted)
    fit = improve(problem.objective, begin, problem.all, derivatives=False, chords=4)
    best = problem.reference(true)
    assert 2 * best.cost - 1e-9 <= fit.cost < 2 * best.cost + SETTLED
    assert sum(made) == 0 and len(made) >= 2


def test_a_fit_goes_on_from_one_without_derivatives():
    data = decay(np.array([0.5, -1.0, 0.8])) + np.random.default_rng(6).standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (-2.0, 2.0)})
    objective = problem.objective
    begin = objective.linearise_at(np.zeros(3))
    bare = objective.relinearise(begin, np.zeros(3), active=NO_DERIVATIVES)
    found = improve(objective, bare, problem.all)
    np.testing.assert_allclose(found.theta, improve(objective, begin, problem.all).theta)


def test_numbers_that_are_not_free_stay():
    rng = np.random.default_rng(7)
    data = decay(np.array([1.0, -1.0, 1.0])) + rng.standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (-2.0, 2.0)})
    begin = np.array([0.0, 0.3, 2.5])  # the last one further than is plausible
    fit = most_probable(problem.objective, np.array([0]), begin)
    np.testing.assert_array_equal(fit.theta[1:], begin[1:])
    alone = MadeUp(lambda a: decay(np.array([a[0], 0.3, 2.5])), data, ("amplitude",))
    assert fit.theta[0] == pytest.approx(alone.reference(np.zeros(1)).x[0], abs=0.05)


def test_without_a_gain_the_others_begin_where_they_end():
    """Where all is linear, that of two readings that a gain and a number explain together."""
    rng = np.random.default_rng(9)
    waves = np.column_stack([np.sin(3 * TIME), np.sin(3 * TIME + 0.1), np.cos(TIME)])
    data = 50.0 * waves @ [0.2, 0.7, -0.3] + rng.standard_normal(len(TIME))
    law = MadeUp(lambda theta: 50.0 * waves @ theta, data, ("a", "b", "c"), {"b": (-2.0, 2.0)})
    objective, (a, b, c) = law.objective, law.all
    best = most_probable(objective, law.all, np.zeros(3))
    there = without(objective, objective.linearise_at(best.theta), np.array([a, c]), np.array([b]))
    alone = most_probable(objective, np.array([a, c]), np.zeros(3))
    assert there[b] == 0.0
    np.testing.assert_allclose(there, alone.theta, atol=1e-6)
    plain = np.where(law.all == b, 0.0, best.theta)
    assert objective.linearise_at(plain).cost > 50.0 * objective.linearise_at(there).cost


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_a_gain_stops_at_its_bound(end):
    """Data ask for three times the largest plausible size; the others make the best of that."""
    rng = np.random.default_rng(8)
    data = decay(np.array([0.0, 0.0, 3.0 * end])) + rng.standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (-1.0, 1.0)})
    fit = most_probable(problem.objective, problem.all, np.zeros(3))
    best = problem.reference(np.zeros(3))
    assert fit.theta[2] == end
    assert best.x[2] == pytest.approx(end)
    np.testing.assert_allclose(fit.theta, best.x, atol=0.1)
    assert fit.cost < 2 * best.cost + SETTLED


def test_a_gain_that_begins_outside_of_its_bounds_comes_in():
    """No damping makes its step shorter than it is far out."""
    rng = np.random.default_rng(10)
    data = friction(np.array([0.0, -0.6])) + rng.standard_normal(len(TIME))
    problem = MadeUp(friction, data, ("start", "change"), {"change": (-1.0, 1.0)})
    fit = most_probable(problem.objective, problem.all, np.array([25.0, 40.0]))
    best = problem.reference(np.zeros(2))
    assert -1.0 <= fit.theta[1] <= 1.0
    assert fit.cost < 2 * best.cost + SETTLED


def test_a_one_sided_gain_stays_absent():
    rng = np.random.default_rng(9)
    data = decay(np.array([0.0, 0.0, -1.0])) + rng.standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (0.0, 1.0)})
    fit = most_probable(problem.objective, problem.all, np.zeros(3))
    assert fit.theta[2] == 0.0


def friction(theta: Floats) -> Floats:
    """Torque in standard deviations, by what friction was at the start (prior 0.02) and its change
    (unit 0.5): data know their product only."""
    start, change = theta
    return 200.0 * (1 + 0.02 * start) * (1 + 0.5 * change) * np.exp(-TIME)


@pytest.mark.parametrize("begin", [(0.0, 0.0), (12.0, -1.0), (-20.0, 0.4), (25.0, 0.9)])
def test_a_bent_valley_is_followed_to_its_end(begin):
    """Along it, the prior of the start is all that tells: from up to 25 standard deviations off."""
    rng = np.random.default_rng(10)
    data = friction(np.array([0.0, -0.6])) + rng.standard_normal(len(TIME))
    problem = MadeUp(friction, data, ("start", "change"), {"change": (-1.0, 1.0)})
    fit = most_probable(problem.objective, problem.all, np.array(begin))
    best = problem.reference(np.zeros(2))
    assert fit.cost < 2 * best.cost + SETTLED
    np.testing.assert_allclose(fit.theta, best.x, atol=0.25)


def banana(theta: Floats) -> Floats:
    """Rosenbrock's valley: it climbs to walls at every full step."""
    across, along = theta
    bend = 10.0 * (along - across**2)
    return np.concatenate([np.repeat(bend, 8), np.repeat(2.0 * (across - 2.0), 8)])


@pytest.mark.parametrize("begin", [(-1.2, 1.0), (0.0, 0.0), (-3.0, 9.0)])
def test_rosenbrocks_valley(begin):
    problem = MadeUp(
        banana, np.zeros(16), ("across", "along"), {"across": (-9, 9), "along": (-9, 9)}
    )
    fit = most_probable(problem.objective, problem.all, np.array(begin))
    assert fit.cost < SETTLED
    np.testing.assert_allclose(fit.theta, [2.0, 4.0], atol=0.2)


def coloured(n: int, seed: int) -> Floats:
    """AR(1) noise, each reading 0.8 of the one before and news of deviation 1."""
    return lfilter([1.0], [1.0, -0.8], np.random.default_rng(seed).standard_normal(n + 100))[100:]


def test_settling_learns_the_colour():
    """Noise of another level and colour than the file says: the fit's own uncertainty knows."""
    n = 6000
    wave = np.sin(np.arange(n) * PERIOD)
    clean = 0.5 / (1 - 0.8) / 5.0 / np.sqrt(wave @ wave)  # what slow noise leaves of the size
    total = 0.0
    for seed in range(20):
        data = 2.0 * wave + 0.5 * coloured(n, seed)
        problem = MadeUp(lambda theta: 5.0 * theta[0] * wave, data, ("size",))
        _, fit = settle(problem.objective, np.zeros(1))
        white = fit.r
        assert np.mean(white**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / n))
        assert abs(white[1:] @ white[:-1]) / (white @ white) < 4 / np.sqrt(n)
        std = 1 / np.sqrt(fit.information[0, 0] + 1.0)
        assert std == pytest.approx(clean, rel=0.1)
        total += ((fit.theta[0] - 0.4) / std) ** 2
    assert chi2.ppf(0.0005, 20) < total < chi2.ppf(0.9995, 20)


def test_readings_far_off_are_left_out():
    n, rng = 6000, np.random.default_rng(11)
    wave, noise = np.sin(np.arange(n) * PERIOD), coloured(n, 11)
    spikes = rng.choice(n // 20, 10, replace=False) * 20
    noise[spikes] += 40.0
    law = MadeUp(lambda theta: 5.0 * theta[0] * wave, 2.0 * wave + 0.5 * noise, ("size",))
    objective, fit = settle(law.objective, np.zeros(1))
    weights = objective.weights[0]
    assert np.all(weights[spikes] == 0.0) and np.all(fit.r[spikes] == 0.0)
    echoes = np.unique(np.clip(np.add.outer(spikes, np.arange(13)), 0, n - 1))
    assert np.all(np.delete(weights, echoes) == 1.0)
    std = 1 / np.sqrt(fit.information[0, 0] + 1.0)
    assert abs(fit.theta[0] - 0.4) < 3.3 * std


@pytest.mark.parametrize("seed", range(3))
def test_the_first_fit_in_loud_noise_knows_that_it_is_loud(seed):
    """Noise of 30 times the stated level: data weigh as little against priors as they should, and
    steps are worth as much, before the noise model is estimated."""
    loud = 30.0 * np.random.default_rng(seed).standard_normal(len(TIME))
    data = friction(np.array([0.0, -0.6])) + loud
    problem = MadeUp(friction, data, ("start", "change"), {"change": (-1.0, 1.0)})
    _, fit = settle(problem.objective, np.zeros(2), gains=[1], turns=0)
    level = np.std(fit.raw[0].r)
    assert level == pytest.approx(30.0, rel=0.1)
    assert np.mean(fit.r**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(TIME)))
    scaled = MadeUp(lambda at: friction(at) / level, data / level, problem.names, problem.bounds)
    np.testing.assert_allclose(fit.theta, scaled.reference(np.zeros(2)).x, atol=0.01)


def test_a_fit_is_judged_within_its_span():
    """Noise outside of what derivatives can make is no part of the cost."""
    rng = np.random.default_rng(12)
    data = decay(np.array([0.5, 0.5, 0.0])) + rng.standard_normal(len(TIME))
    problem = MadeUp(decay, data, ("amplitude", "rate", "wave"), {"wave": (-2.0, 2.0)})
    objective = problem.objective
    free = most_probable(objective, problem.all, np.zeros(3))
    objective = objective.with_span([objective.linearise_at(free.theta).psi])
    span = cast(Floats, objective.span)
    np.testing.assert_allclose(span.T @ span, np.eye(span.shape[1]), atol=1e-9)
    again = most_probable(objective, problem.all, free.theta)
    # as many numbers as the span has: all within it is explained, but for the priors
    assert again.cost < 3.0 + np.sum(again.theta[:2] ** 2)
    assert free.cost > 300.0
    np.testing.assert_allclose(again.theta, free.theta, atol=0.1)


@pytest.fixture(scope="module")
def drive() -> Problem:
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "city", 4, duration=300.0)
    return Problem.of(signals, truck, tuple(machine_of("dry_clutch").effects.values()))


def test_nuisances_of_a_drive_reach_the_same_optimum_from_elsewhere(drive):
    """From where the file stands, and from two standard deviations off in every number."""
    objective, home = settle(Objective.of(drive), np.zeros(len(drive.thetas)))
    best = most_probable(objective, drive.nuisances, home.theta)
    assert objective.linearise_at(np.zeros(len(drive.thetas))).cost > best.cost + 50.0
    precision = objective.linearise_at(best.theta).information + np.diag(objective.prior)
    free = np.ix_(drive.nuisances, drive.nuisances)
    rng = np.random.default_rng(1)
    for _ in range(2):
        begin = np.zeros(len(drive.thetas))
        begin[drive.nuisances] = rng.choice([-2.0, 2.0], len(drive.nuisances))
        fit = most_probable(objective, drive.nuisances, begin)
        off = (fit.theta - best.theta)[drive.nuisances]
        assert abs(fit.cost - best.cost) < 4 * SETTLED
        assert off @ precision[free] @ off < 4 * SETTLED


def test_a_ridge_is_not_crept_along():
    """Two numbers take turns, and derivatives are off by something that has nothing to do with
    either: each plain step goes a sixth of the way."""

    def law(theta: Floats) -> Floats:
        total, difference = theta[0] + theta[1], theta[0] - theta[1]
        return np.concatenate([np.full(200, 3.0 * total), np.full(200, 0.5 * difference)])

    data = law(np.array([2.0, -2.0])) + np.random.default_rng(3).standard_normal(400)
    problem, evaluations = MadeUp(law, data, ("one", "other")), 0

    def residuals(theta: Floats) -> tuple[Floats, Floats]:
        nonlocal evaluations
        evaluations += 1
        r, psi = problem.residuals(theta)
        off = 1.118 * (-1.0) ** np.arange(200)
        psi[200:] += off[:, None] * np.array([1.0, -1.0])
        return r, psi

    objective = objective_of(
        residuals, (UnknownParameter("one", 1.0), UnknownParameter("other", 1.0))
    )
    begin = objective.linearise_at(np.zeros(2))
    evaluations = 0
    fit = improve(objective, begin, problem.all)
    assert evaluations <= 7
    assert fit.cost < 2 * problem.reference(np.zeros(2)).cost + 2 * SETTLED


def test_a_drives_optimum_is_that_of_least_squares(drive):
    """SciPy's own steps and differences, on the innovations as they come."""
    objective = Objective.of(drive)
    wanted = {
        "start of temp_body",
        "start of zero_position",
        "start of friction",
        "friction_speed.slope",
    }
    free = np.array([k for k, t in enumerate(drive.thetas) if str(t) in wanted])
    directions = drive.drives[0].readings.input_noise  # unknown numbers of their own, to SciPy
    n = len(free)

    def residuals(part: Floats) -> Floats:
        theta = np.zeros(len(drive.thetas))
        theta[free] = part[:n]
        (rows,) = drive.linearise(theta, {}, NO_DERIVATIVES)
        left = rows.r + directions @ part[n:]
        return np.concatenate([left, np.sqrt(objective.prior[free]) * part[:n], part[n:]])

    fit = most_probable(objective, free, np.zeros(len(drive.thetas)))
    begin = np.concatenate([fit.theta[free] + 0.5, np.zeros(directions.shape[1])])
    best = least_squares(residuals, begin, x_scale="jac", ftol=1e-6)
    off = fit.theta[free] - best.x[:n]
    assert fit.cost < 2 * best.cost + 2 * SETTLED
    assert off @ np.linalg.inv(np.linalg.inv(best.jac.T @ best.jac)[:n, :n]) @ off < 4 * SETTLED


def test_a_linearisation_is_a_function_of_what_is_handed_over(drive):
    """Whatever was linearised before: derivatives at the same numbers and operating point are the
    same to the last digit, and those at an operating point of other numbers are others."""
    objective, home = Objective.of(drive), np.zeros(len(drive.thetas))
    far, gain = home.copy(), drive.index("friction_level.change")
    far[gain] = -0.4 / drive.units[gain]
    gains = drive.gains
    first = objective.linearise_at(home)
    away = objective.linearise_at(far)
    np.testing.assert_array_equal(objective.linearise_at(home).psi, first.psi)
    again = objective.relinearise(first, home)
    taken_in = objective.relinearise(away, home)
    np.testing.assert_array_equal(taken_in.r, first.r)  # innovations depend on the numbers alone
    length = np.linalg.norm(first.psi[:, gains], axis=0)
    responds = length > 0.0

    def off(psi: Floats) -> float:
        difference = np.linalg.norm((psi - first.psi)[:, gains], axis=0)
        return float(np.max(difference[responds] / length[responds]))

    assert off(taken_in.psi) > 0.01
    assert off(again.psi) < 0.2 * off(taken_in.psi)


def test_a_column_that_counts_twice_is_as_if_it_came_twice():
    problem = MadeUp(
        decay, decay(np.zeros(3)), ("amplitude", "rate", "wave"), {"wave": (-2.0, 2.0)}
    )
    apart = np.eye(len(TIME), 2)
    columns = np.column_stack([apart[:, 0], apart @ [0.9, np.sqrt(0.19)]])
    least = 0.12  # once each, the second direction holds 0.1 of both; else more
    assert problem.objective.with_span([columns], least).in_span(columns).shape == (1, 2)
    twice = problem.objective.with_span([columns, columns[:, :1]], least).span
    counted = problem.objective.with_span([columns], least, [np.array([2.0, 1.0])]).span
    assert twice is not None and counted is not None and twice.shape == (len(TIME), 2)
    np.testing.assert_allclose(np.abs(twice.T @ counted), np.eye(2), atol=1e-12)
