"""The truck paper's identification as procedures: what they find, what they say they cannot."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import clutchest
from clutchest.cli import app
from clutchest.errors import ClutchestError
from clutchest.generator.generate import draw
from clutchest.identify import identify_vehicle, procedures
from clutchest.identify.fit import Fit
from clutchest.identify.likelihood import most_probable, problem_of
from clutchest.inference.objective import Objective
from clutchest.inference.problem import FURTHEST, Problem
from clutchest.vehicle import load_vehicle

SEED, OTHER = 3001, 3002
TRUCK = load_vehicle("truck")
VALUES = {key: p.value for key, p in TRUCK.parameters.items()}
TRUTH, _ = draw(VALUES, {key: p.spread for key, p in TRUCK.parameters.items()}, SEED)


def run(name: str, signals, vehicle=TRUCK, holdout=None) -> Fit:
    return identify_vehicle(name, signals, vehicle, lambda text, share: None, holdout)


def drive(scenario: str, seed: int = SEED, **options):
    """Another drive of the same truck."""
    return clutchest.simulate(TRUCK, scenario, seed, truck_seed=SEED, **options)


@pytest.fixture(scope="module")
def ramps():
    return drive("ramps", duration=100.0)


def holds(fit: Fit, keys) -> None:
    """Every one of ``keys`` is determined, right within four standard deviations, and surer than
    before."""
    for key in keys:
        found, before = fit.parameters[key], TRUCK.parameters[key]
        assert found.determined, key
        assert found.prior_std == before.spread and found.std < 0.8 * before.spread
        assert abs(found.value - TRUTH[key]) < 4 * found.std, key
        assert found.low < found.value < found.high


@pytest.mark.parametrize(
    ("name", "determined"),
    [
        ("torque-curve", ("torque_cubic", "kiss_point")),
        ("disc", ("expansion_disc", "heat_capacity_disc", "conductance_disc_body")),
    ],
)
def test_ramps_tell_of_curve_and_disc(name, determined, ramps):
    fit = run(name, ramps)
    holds(fit, determined)
    assert fit.validation is None and any("not validated" in w for w in fit.warnings)


def test_what_ramps_do_not_tell_stays_where_it_was(ramps):
    fit = run("torque-curve", ramps)
    loose = fit.parameters["torque_quadratic"]
    assert not loose.determined and loose.value == TRUCK.parameters["torque_quadratic"].value
    assert loose.std == loose.prior_std and "not identifiable from these logs" in loose.why
    assert any("do not determine torque_quadratic" in warning for warning in fit.warnings)
    assert fit.vehicle.parameters["torque_quadratic"] == TRUCK.parameters["torque_quadratic"]


def test_a_drive_without_slip_tells_nothing():
    still = drive("closed", duration=60.0)
    fit = run("disc", still)
    assert not any(found.determined for found in fit.parameters.values())
    assert fit.vehicle == TRUCK
    (warning,) = (w for w in fit.warnings if "do not determine" in w)
    assert all(key in warning for key in ("expansion_disc", "heat_capacity_disc"))


@pytest.mark.slow
def test_found_numbers_pay_on_another_drive(ramps):
    fit = run("disc", ramps, holdout=drive("ramps", OTHER, duration=100.0))
    found = fit.validation
    assert found is not None and found.gained > 0
    assert found.error("torque").after <= 1.02 * found.error("torque").before
    wrong = replace(TRUCK.parameters["conductance_disc_body"], value=60.0, spread=0.5)
    misled = replace(TRUCK, parameters={**TRUCK.parameters, "conductance_disc_body": wrong})
    from clutchest.identify.validation import validate

    lost = validate(drive("ramps", OTHER, duration=100.0), TRUCK, misled)
    torque, position = lost.error("torque"), lost.error("zero_position")
    assert lost.gained < -20.0 and torque.after > 1.2 * torque.before
    assert position.after > 2.0 * position.before


def test_numbers_that_are_held_stay(ramps):
    problem = problem_of(ramps, TRUCK).holding("conductance_disc_body")
    held = problem.index("conductance_disc_body")
    posterior = most_probable(problem)
    assert posterior.theta[held] == 0.0 and posterior.covariance[held, held] == 0.0
    assert posterior.of("conductance_disc_body") == (126.0, 0.0)
    assert posterior.of("reference_temp") is None  # no spread


def test_bounds_are_those_of_the_equations(ramps):
    problem = problem_of(ramps, TRUCK)
    objective = Objective.of(problem)
    low, high = objective.low, objective.high
    at = problem.index("torque_cubic")
    assert high[at] == pytest.approx(21.0 / 0.42) and low[at] == -np.inf  # the curve rises


def test_in_discovery_no_number_is_further_off_than_can_be_believed(ramps):
    objective = Objective.of(problem := Problem.of(ramps, TRUCK, (), discrepant=True))
    at = problem.index("torque_cubic")
    assert (objective.low[at], objective.high[at]) == (-FURTHEST, FURTHEST)


def test_without_any_spread_nothing_is_fitted(ramps):
    exact = {key: replace(p, spread=0.0) for key, p in TRUCK.parameters.items()}
    with pytest.raises(ClutchestError, match=r"none of expansion_disc.* has a spread"):
        run("disc", ramps, replace(TRUCK, parameters=exact))


def test_zero_position_needs_its_signal():
    signals = drive("closed", duration=30.0)
    without = replace(signals, signals={n: s for n, s in signals.items() if n != "slave_position"})
    with pytest.raises(ClutchestError, match="no zero position is read"):
        run("thermal", without)


def test_noise_takes_no_holdout(ramps):
    with pytest.raises(ClutchestError, match="'noise' takes no holdout"):
        run("noise", ramps, holdout=ramps)


def test_all_are_in_the_paper_s_order():
    names = ["noise", "torque-curve", "expansion", "thermal", "disc", "all"]
    assert list(procedures(TRUCK.machine)) == names


def test_command_writes_fit_vehicle_and_picture(tmp_path):
    log, other, out = tmp_path / "a.log", tmp_path / "b.log", tmp_path / "out"
    for path, seed in ((log, SEED), (other, OTHER)):
        clutchest.simulated.write_simulation(
            path, TRUCK, "ramps", seed, truck_seed=SEED, duration=60.0
        )
    result = CliRunner().invoke(
        app,
        [
            "identify",
            "disc",
            str(log),
            "--holdout",
            str(other),
            "--vehicle",
            "truck",
            "--out",
            str(out),
        ],
    )
    assert result.exit_code == 0, result.output
    told = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    assert told["validation"]["logs"] == ["b.log"] and told["logs"] == ["a.log"]
    kinds = [
        f"{name}_{when}" for name in ("torque", "zero_position") for when in ("before", "after")
    ]
    assert list(told["validation"]) == ["logs", *kinds, "gained"]
    found = load_vehicle(out / "vehicle.toml")
    for key, fitted in told["parameters"].items():
        assert {"value", "std", "prior_std", "determined"} <= set(fitted)
        assert found.parameters[key].value == fitted["value"]
        assert found.parameters[key].spread == fitted["std"]
        assert found.parameters[key].source == "clutchest identify disc, a.log"
    assert found.parameters["expansion_body"] == TRUCK.parameters["expansion_body"]
    assert (out / "torque.png").stat().st_size > 10_000
    same = CliRunner().invoke(
        app, ["identify", "disc", str(log), "--holdout", str(log), "--vehicle", "truck"]
    )
    assert same.exit_code != 0


@pytest.mark.slow
def test_cool_down_tells_of_heat_and_expansion(tmp_path):
    """Zero position alone; several logs are fitted together."""
    signals = drive("cooldown")
    thermal = run("thermal", signals, holdout=drive("heating", OTHER, duration=600.0))
    holds(thermal, ("heat_capacity_body", "conductance_engine_body", "conductance_body_housing"))
    assert (
        thermal.validation is not None
        and thermal.validation.error("zero_position").after is not None
    )
    expansion = run("expansion", signals)
    holds(expansion, ("expansion_body",))
    thermal.draw(tmp_path)
    assert (tmp_path / "zero_position.png").stat().st_size > 10_000
    together = replace(signals, later=(drive("ramps"),))
    joint = run("all", together)
    holds(joint, ("heat_capacity_body", "expansion_body", "conductance_disc_body", "torque_cubic"))
    for key in ("heat_capacity_body", "expansion_body"):  # more logs never make it less sure
        assert (
            joint.parameters[key].std
            < 1.05 * (thermal if key != "expansion_body" else expansion).parameters[key].std
        )
    assert np.isfinite([p.value for p in joint.parameters.values()]).all()


@pytest.mark.statistics
@pytest.mark.parametrize("name", ["torque-curve", "disc"])
def test_two_standard_deviations_hold_the_truth(name):
    """60 trucks; the whole statistic is that of benchmarks/identify.py."""
    errors = []
    for seed in range(5000, 5060):
        truth, _ = draw(VALUES, {key: p.spread for key, p in TRUCK.parameters.items()}, seed)
        fit = run(name, clutchest.simulate(TRUCK, "ramps", seed))
        errors += [
            (p.value - truth[key]) / p.std for key, p in fit.parameters.items() if p.determined
        ]
    assert 0.90 < np.mean(np.abs(errors) <= 2.0) <= 0.99
    assert abs(np.mean(errors)) < 0.3
