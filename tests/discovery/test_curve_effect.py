"""Curves as effects of a vehicle file."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from clutchest.discovery.extension import can_be_stated, stated
from clutchest.discovery.residual_curves import Curve
from clutchest.models import machine_in_file, shipped_machines
from clutchest.models.curve_effect import covariates_of_curve, curve_effects
from clutchest.models.dry_clutch import MACHINE
from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.effects import Effect
from clutchest.models.error_curve import ErrorCurve, free_name, matrix, numbers_of
from clutchest.vehicle import load_vehicle
from equations import argument_names, evaluator

TRUCK = {key: value.value for key, value in load_vehicle("truck").parameters.items()}
AT = np.array([38.0, 42.0, 46.0, 50.0])
TALL = np.array([0.0, 1.0, -1.0, 2.0])
OFF = np.array([[0.1, 0.2, 0.0, 0.0], [0.0, 0.0, 0.3, -0.4]])
RESIDUAL = Curve("torque", "torque", "slave_position", AT, TALL, OFF, 0.0, 0.0, 0.0)
CURVE = stated(RESIDUAL)


def effect_of(curve: ErrorCurve, name: str = "curve_1") -> Effect:
    return curve_effects(name, curve, MACHINE)[0]


def deviations_at(curve: ErrorCurve, position: float) -> float:
    """All deviations together, one standard deviation each."""
    return float(np.interp(position, AT, curve.deviations.sum(axis=0)))


def test_a_curve_is_stated_as_it_was_estimated():
    assert CURVE.knots == tuple(AT) and CURVE.values == tuple(TALL)
    np.testing.assert_allclose(CURVE.covariance, OFF.T @ OFF, atol=1e-12)
    assert CURVE.deviations.shape == (2, 4)
    np.testing.assert_allclose(CURVE.deviations.T @ CURVE.deviations, OFF.T @ OFF, atol=1e-9)


@pytest.mark.parametrize(
    ("position", "value"), [(37.0, 0.0), (41.0, 0.75), (45.0, -0.5), (52.0, 2.0)]
)
def test_a_reading_is_corrected_by_a_curve_over_the_reading_itself(position, value):
    curve = replace(CURVE, error_term="sensor:slave_position")
    model = DRY_CLUTCH.with_effects((effect_of(curve),))
    values = {name: 1.0 for group in argument_names(model) for name in group}
    values |= {"slave_position": position, "curve_1.size": 0.5}
    made = evaluator(model, ["slave_position"])(values)
    error = 0.5 * value + deviations_at(curve, position)  # both deviations stand at 1
    assert made["slave_position"] == pytest.approx(position - 0.1 * error)


def test_a_curve_over_a_quantity_that_is_known_before_is_followed():
    model = DRY_CLUTCH.with_effects((effect_of(CURVE),))
    plain = evaluator(DRY_CLUTCH, ["sliding_torque"])
    values = {name: 1.0 for group in argument_names(model) for name in group} | TRUCK
    values |= {"slave_position": 41.0, "zero_position": 38.4, "engine_speed": 150.0}
    values |= {"temp_body": 70.0, "temp_disc": 70.0}
    known = {name for group in argument_names(DRY_CLUTCH) for name in group}
    without = plain({k: v for k, v in values.items() if k in known})["sliding_torque"]
    made = evaluator(model, ["sliding_torque"])(values)["sliding_torque"]
    assert without != 0.0
    error = 0.75 + deviations_at(CURVE, 41.0)
    assert made == pytest.approx(without * (1.0 + 0.1 * error))


def test_a_peak_is_kept():
    curve = replace(CURVE, covariate="temp_disc_peak")
    model = DRY_CLUTCH.with_effects((effect_of(curve),))
    e = model.expressions()
    step = ca.Function("step", [e.x, e.u0, e.u, e.p, e.g], [e.mapped])
    x, disc, peak = np.zeros(len(model.states)), model.state("temp_disc"), len(model.states) - 1
    rest = [np.zeros(len(group)) for group in argument_names(model)[1:]]
    seen = []
    for x[disc] in (80.0, 150.0, 120.0, 160.0):
        x = np.array(step(x, rest[0], rest[0], *rest[-2:])).ravel()
        seen.append(x[peak])
    assert seen == [80.0, 150.0, 150.0, 160.0]


def test_what_the_equations_do_not_know_cannot_be_stated():
    assert can_be_stated(RESIDUAL, MACHINE, DRY_CLUTCH)
    assert not can_be_stated(replace(RESIDUAL, covariate="position_rate"), MACHINE, DRY_CLUTCH)
    # the clutch's torque is known only after the report that its error would change
    late = replace(RESIDUAL, error_term="sensor:engine_torque", covariate="clutch_torque")
    assert not can_be_stated(late, MACHINE, DRY_CLUTCH)


def test_several_curves_stand_in_one_model():
    over_time = stated(replace(RESIDUAL, covariate="time"))
    effects = [effect_of(over_time, name) for name in ("curve_1", "curve_2")]
    model = DRY_CLUTCH.with_effects(tuple(effects))
    assert len({state.name for state in model.states}) == len(model.states)
    model.expressions()


def test_deviations_are_unknowns_of_the_model():
    """Of an equation as numbers of the curve, of a delay as effects beside it; 0 at first."""
    values, spreads = numbers_of("curve_1", CURVE, timing=False)
    assert values == {"curve_1": {"size": 1.0, "deviation_1": 0.0, "deviation_2": 0.0}}
    assert spreads == {"curve_1": {"deviation_1": 1.0, "deviation_2": 1.0}}
    assert [n.key for n in effect_of(CURVE).gains] == [*values["curve_1"]]
    delay = replace(CURVE, error_term="timing:engine_torque", covariate="engine_speed")
    values, spreads = numbers_of("curve_2", delay, timing=True)
    off = ["curve_2, deviation 1", "curve_2, deviation 2"]
    assert values == {"curve_2": {"size": 1.0}} | {name: {"size": 0.0} for name in off}
    assert spreads == {name: {"size": 1.0} for name in off}
    effects = curve_effects("curve_2", delay, MACHINE)
    assert [effect.name for effect in effects] == list(values)
    curves = [effect.lateness["engine_torque"] for effect in effects]
    assert all(curve.at == tuple(AT) and curve.covariate == "engine_speed" for curve in curves)
    seconds = np.array([curve.seconds for curve in curves])
    per_unit = seconds[0, 1] / TALL[1]
    assert per_unit != 0.0
    np.testing.assert_allclose(seconds, per_unit * np.vstack([TALL, delay.deviations]))


def test_a_shifted_curve_is_known_better():
    by, std = np.array([0.5, -1.0]), np.array([0.2, 0.1])
    shifted = CURVE.shifted(by, std)
    np.testing.assert_allclose(shifted.values, TALL + by @ CURVE.deviations, atol=1e-6)
    scaled = std[:, None] * CURVE.deviations
    np.testing.assert_allclose(shifted.covariance, scaled.T @ scaled, atol=1e-9)


@pytest.mark.parametrize(
    ("taken", "name"),
    [
        ([], "curve_1"),
        (["curve_2"], "curve_1"),
        (["curve_1", "curve_3"], "curve_2"),
        (["curve"], "curve_1"),
    ],
)
def test_a_curve_takes_a_name_that_is_free(taken, name):
    assert free_name(taken) == name


def test_over_time_a_curve_is_another_drives():
    assert stated(replace(RESIDUAL, covariate="time")).covariance == ()


def test_a_covariance_without_rank_has_fewer_deviations():
    flat = replace(CURVE, covariance=matrix(np.zeros((4, 4))))
    assert flat.deviations.shape == (0, 4)


SERVO = Path(__file__).parents[2] / "machines" / "servo" / "servo.py"


@pytest.mark.parametrize(
    "machine", [*shipped_machines(), machine_in_file(SERVO)], ids=lambda machine: machine.name
)
def test_every_error_term_of_every_machine_takes_a_curve(machine):
    """Over a quantity, over memories of the curve's own, and over its last covariate."""
    full = machine.equations(machine.units)
    for name, term in machine.error_terms.items():
        covariates = covariates_of_curve(term, machine)
        own = ("time", "energy", *machine.peaks, *machine.turns, *machine.durations)
        memories = [c for c in covariates if c in own]
        for covariate in dict.fromkeys((*memories, covariates[-1])):
            curve = ErrorCurve(name, covariate, (0.0, 1.0, 3.0), (0.1, 0.2, -0.1))
            model = full.with_effects(curve_effects("curve_1", curve, machine))
            assert len(model.expressions().rate.nz) >= len(full.states)
