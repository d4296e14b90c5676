"""What a healthy vehicle is stated to be off by: what it does to readings, and how it counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.discovery.candidates import candidates
from clutchest.generator import Mismatch
from clutchest.generator.structure import CURVE_POINTS, DEEPEST, Structure
from clutchest.inference.covariates import covariates
from clutchest.inference.objective import NO_SHAPES, Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import score_test
from clutchest.models.error_curve import ErrorCurve
from clutchest.models.error_term_effects import error_term_effects
from clutchest.vehicle import HealthyGain, SmoothError, Vehicle, dump_vehicle, load_vehicle

TRUCK = clutchest.load_vehicle("truck")
STATED = SmoothError("torque", "slave_position", 1.0, 0.8)


def bent(seed: int, seconds: float) -> clutchest.Signals:
    """A drive of a truck whose torque curve is off by up to six percent."""
    depth = np.linspace(0.0, DEEPEST, CURVE_POINTS)
    curve = tuple(0.06 * np.cos(np.pi * depth / 4.0))
    mismatch = Mismatch(structure=Structure(curve=curve))
    return clutchest.simulate(TRUCK, "city", seed, duration=seconds, mismatch=mismatch)


def problem_of(signals: clutchest.Signals, vehicle: Vehicle) -> Problem:
    effects = error_term_effects(vehicle.machine)
    return Problem.of(signals, vehicle, effects, discrepant=True)


def test_they_come_back_from_a_file_as_stated(tmp_path) -> None:
    two = (STATED, SmoothError("torque, added", "temp_disc", 20.0, 30.0))
    gains = (HealthyGain("heat_split", "fraction", 0.02), HealthyGain("wear", "rate", 0.01))
    path = tmp_path / "own.toml"
    dump_vehicle(replace(TRUCK, healthy=gains, smooth_errors=two), path)
    again = load_vehicle(path)
    assert set(again.healthy) >= set(gains) and again.smooth_errors == two
    assert all(gain.std == 0.0 for gain in again.healthy if gain not in gains)


def test_parts_left_out_act_as_far_as_the_machine_says_unless_the_file_does(tmp_path) -> None:
    parts = TRUCK.machine.unmodelled
    usual = {f"{name}.{n.key}": n.healthy for name, part in parts.items() for n in part.gains}
    assert {gain.gain: gain.std for gain in TRUCK.healthy} == usual and min(usual.values()) > 0.0
    path = tmp_path / "own.toml"
    dump_vehicle(replace(TRUCK, healthy=()), path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("slip = 0.0", "slip = 0.1"), encoding="utf-8")
    own = {gain.gain: gain.std for gain in load_vehicle(path).healthy}
    assert own == {**dict.fromkeys(usual, 0.0), "flywheel.slip": 0.1}


def test_parts_left_out_are_no_candidates_and_no_covariates() -> None:
    signals = clutchest.simulate(TRUCK, "launches", 5, duration=60.0)
    effects = tuple(TRUCK.machine.effects.values())
    problem = Problem.of(signals, TRUCK, effects, discrepant=True)
    states = {s.name for part in TRUCK.machine.unmodelled.values() for s in part.states}
    assert states <= {state.name for state in problem.compiled.model.states}
    assert set(problem.effects) == set(TRUCK.machine.effects)
    assert not {c.name for c in candidates(problem)} & set(TRUCK.machine.unmodelled)
    (drive,) = problem.drives
    assert not set(covariates(drive, drive.at_nominal)) & states
    without = Problem.of(signals, replace(TRUCK, healthy=()), effects, discrepant=True)
    assert len(without.compiled.model.states) == len(problem.compiled.model.states) - len(states)


@pytest.mark.slow
def test_any_curve_as_smooth_as_stated_lies_within_their_directions() -> None:
    """Of what such a curve does to innovations, by the equations with the curve in them, next to
    nothing is left beside the directions."""
    signals = clutchest.simulate(TRUCK, "launches", 5, duration=120.0)
    problem = problem_of(signals, replace(TRUCK, estimation={}, smooth_errors=(STATED,)))
    at, nought = [drive.at_nominal for drive in problem.drives], np.zeros(len(problem.thetas))
    ((along,),) = problem.discrepancy_directions(nought, NO_SHAPES, at)
    knots = np.linspace(38.0, 48.0, 60)
    values = 0.1 * np.sin((knots - 41.0) / 0.9)
    curve = ErrorCurve("torque", "slave_position", tuple(knots), tuple(values))
    curved = problem_of(
        signals,
        replace(TRUCK, curves={"curve_1": curve}, effects={"curve_1": {"size": 1.0}}),
    )
    (plain,), (off,) = (
        each.linearise(np.zeros(len(each.thetas)), NO_SHAPES, np.zeros(0, np.int64))
        for each in (problem, curved)
    )
    change = off.r - plain.r
    left = change - along @ np.linalg.lstsq(along, change, rcond=None)[0]
    assert np.linalg.norm(change) > 5.0
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(change)


@pytest.mark.slow
def test_without_an_error_term_among_the_effects_there_is_none() -> None:
    signals = clutchest.simulate(TRUCK, "launches", 5, duration=120.0)
    stated = replace(TRUCK, smooth_errors=(STATED,))
    assert STATED not in Problem.of(signals, stated, (), discrepant=True).discrepancies
    assert STATED in problem_of(signals, stated).discrepancies


def test_a_healthy_part_acts_as_the_gain_and_takes_its_share_of_the_information() -> None:
    """Of a gain that healthy vehicles have with a variance s², the information I about a cause
    becomes I / (1 + s² I), wherever the nuisances stand."""
    signals = clutchest.simulate(TRUCK, "launches", 5, duration=120.0)
    effect = TRUCK.machine.effects["heat_split"]
    stated = replace(TRUCK, estimation={}, healthy=(HealthyGain("heat_split", "fraction", 0.3),))
    problem = Problem.of(signals, stated, (effect,), discrepant=True)
    (gain,), theta = problem.gains, np.zeros(len(problem.thetas))
    theta[problem.nuisances] = np.random.default_rng(1).normal(0.0, 0.5, len(problem.nuisances))
    fit, part = (
        Objective.of(problem).linearise_at(theta),
        problem.index("healthy heat_split.fraction"),
    )
    assert part in problem.nuisances and list(problem.tolerances([gain])) == [part]
    scale = 0.3 / problem.units[gain]
    np.testing.assert_allclose(fit.psi[:, part], scale * fit.psi[:, gain], rtol=1e-12)
    moved = np.zeros(len(theta))
    moved[part], same = 1.0, np.zeros(len(theta))
    same[gain] = scale
    (by_part,), (by_gain,) = (problem.linearise(theta + off, NO_SHAPES) for off in (moved, same))
    np.testing.assert_allclose(by_part.r, by_gain.r, rtol=1e-12)

    def information(nuisances: np.ndarray) -> float:
        prior, columns = Objective.of(problem).prior, fit.psi[:, [gain]]
        (whole,) = score_test(fit, nuisances, prior, columns, (False,), 1, 10).information.ravel()
        return float(whole)

    alone = information(np.setdiff1d(problem.nuisances, part))
    assert scale**2 * alone > 0.5  # it matters
    assert information(problem.nuisances) == pytest.approx(alone / (1.0 + scale**2 * alone))


@pytest.mark.slow
def test_a_curve_that_is_off_is_a_finding_unless_so_much_is_stated() -> None:
    signals, wide = bent(3, 900.0), replace(STATED, std=6.0, length=2.0)
    assert clutchest.discover(signals, replace(TRUCK, smooth_errors=(wide,))).verdict == "none"
    unstated = replace(TRUCK, smooth_errors=())
    assert clutchest.discover(signals, unstated).verdict != "none"
