"""Covariates that the equations do not have: places within a turn, durations."""

import math

import numpy as np
import pytest

from clutchest.inference.covariates import knots
from clutchest.models import shipped_machines
from clutchest.models.curve_effect import curve_effects
from clutchest.models.declarations import RECENT, RECENT_SLIP
from clutchest.models.error_curve import ErrorCurve
from clutchest.models.machine import Machine
from clutchest.vehicle import load_vehicle
from equations import argument_names, evaluator

ALSD = next(machine for machine in shipped_machines() if machine.name == "alsd")
TRUCK = next(machine for machine in shipped_machines() if machine.name == "dry_clutch")


def with_curve(
    error_term: str,
    covariate: str,
    at: tuple[float, ...],
    values: tuple[float, ...],
    machine: Machine = ALSD,
):
    full = machine.equations(machine.units)
    return full.with_effects(
        curve_effects("curve_1", ErrorCurve(error_term, covariate, at, values), machine)
    )


def ones(model) -> dict[str, float]:
    return {name: 1.0 for group in argument_names(model) for name in group}


@pytest.mark.parametrize("turns", [0, 3, -2])
def test_a_curve_within_a_turn_is_the_same_in_every_turn(turns):
    at = (0.0, math.pi, 2.0 * math.pi)
    model = with_curve("motor", "motor_angle_in_turn", at, (0.0, 1.0, 0.0))
    made = evaluator(model, ["motor_friction_torque"])
    here = {**ones(model), "motor_angle": 0.5 * math.pi + turns * 2.0 * math.pi}
    bare = {**here, "curve_1.size": 0.0}
    error = made(here)["motor_friction_torque"] - made(bare)["motor_friction_torque"]
    assert error == pytest.approx(0.5 * ALSD.error_terms["motor"].size, rel=1e-9)


def test_a_duration_grows_while_its_quantity_is_positive_and_is_forgotten_after():
    model = with_curve("torque", "pressed_time", (0.0, 1.0, 2.0), (0.1, 0.0, 0.0))
    made = evaluator(model, ["curve_1_pressed_time_rate"])
    pressed = {**ones(model), "pack_force": 500.0, "curve_1_pressed_time": 0.7}
    assert made(pressed)["curve_1_pressed_time_rate"] == 1.0
    assert made({**pressed, "pack_force": 0.0})["curve_1_pressed_time_rate"] < -10.0


@pytest.mark.parametrize(("power", "rate"), [(500.0, (1.0 - 0.4) / RECENT), (0.0, -0.4 / RECENT)])
def test_slip_of_late_grows_in_slip_and_fades_at_rest(power, rate):
    model = with_curve("torque", RECENT_SLIP, (0.0, 0.5, 1.0), (0.1, 0.0, 0.0))
    made = evaluator(model, [f"curve_1_{RECENT_SLIP}_rate", "power"])
    slides = {**ones(model), "slip_speed": 0.0, f"curve_1_{RECENT_SLIP}": 0.4}
    slides |= {"slip_speed": 10.0, "pack_force": 500.0} if power else {}
    known = made(slides)
    assert (known["power"] > 0.0) == (power > 0.0)
    assert known[f"curve_1_{RECENT_SLIP}_rate"] == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize(("turned", "error"), [(math.pi / 2.0, 0.5), (5.0 * math.pi, 1.0)])
def test_the_angle_of_a_speed_is_its_integral(turned, error):
    at = (0.0, math.pi, 2.0 * math.pi)
    model = with_curve("torque", "slip_angle", at, (0.0, 1.0, 0.0), TRUCK)
    made = evaluator(model, ["sliding_torque", "curve_1_slip_angle_rate", "slip_speed"])
    here = ones(model) | {k: v.value for k, v in load_vehicle("truck").parameters.items()}
    here |= {"slave_position": 41.0, "zero_position": 38.4, "temp_body": 70.0, "temp_disc": 70.0}
    here |= {"engine_speed": 150.0, "input_shaft_speed": 90.0, "curve_1_slip_angle": turned}
    slides, bare = made(here), made({**here, "curve_1.size": 0.0})
    assert slides["curve_1_slip_angle_rate"] == slides["slip_speed"] == 60.0
    assert bare["sliding_torque"] != 0.0
    locked = made(here | dict.fromkeys(model.regime, 0.0))
    assert locked["curve_1_slip_angle_rate"] == 0.0 and locked["slip_speed"] == 60.0
    share = 1.0 + 0.1 * error
    assert slides["sliding_torque"] == pytest.approx(share * bare["sliding_torque"], rel=1e-9)


def test_a_departure_is_from_a_mean_whose_weight_grows():
    own = "curve_1_recent_movement"
    at = (-10.0, 0.0, 10.0)
    model = with_curve("sensor:slave_position", "recent_movement", at, (-1.0, 0.0, 1.0), TRUCK)
    made = evaluator(model, ["slave_position", f"{own}_rate", f"{own}_weight_rate"])
    here = {**ones(model), "slave_position": 46.0, own: 0.25 * 42.0, f"{own}_weight": 0.25}
    known = made(here)
    right = known["slave_position"]  # its mean of late is that of right readings
    assert right == pytest.approx(46.0 - 0.1 * 0.4, rel=1e-12)
    assert known[f"{own}_weight_rate"] == pytest.approx(0.75 / RECENT)
    assert known[f"{own}_rate"] == pytest.approx((right - 0.25 * 42.0) / RECENT, rel=1e-12)


@pytest.mark.parametrize("voltage", [12.0, -7.0])
def test_an_error_of_the_supply_is_a_share_of_the_voltage_of_either_sign(voltage):
    model = with_curve("current, supply", "time", (0.0, 10.0, 20.0), (1.0, 1.0, 1.0))
    made = evaluator(model, ["motor_voltage"])
    here = {**ones(model), "armature_voltage": voltage, "curve_1_time": 3.0}
    off, bare = made(here), made({**here, "curve_1.size": 0.0})
    share = 1.0 - ALSD.error_terms["current, supply"].size / 100.0
    assert off["motor_voltage"] == pytest.approx(share * bare["motor_voltage"], rel=1e-9)
    assert bare["motor_voltage"] * voltage > 0.0


def test_curves_bend_evenly_within_a_turn_and_early_in_a_duration():
    angle = np.mod(np.linspace(0.0, 40.0, 5000), 2.0 * math.pi)
    coarse, fine = knots(ALSD, "motor_angle_in_turn", angle, np.ones(5000))
    assert len(fine) > 3 * 7  # seven slots of an armature
    np.testing.assert_allclose(np.diff(fine), np.diff(fine)[0])
    (early,) = knots(ALSD, "pressed_time", np.linspace(0.0, 8.1, 5000), np.ones(5000))
    assert early[0] == 0.0 and np.all(np.diff(early, 2) > 0.0) and early[1] < 1.0
    assert len(coarse) < len(fine)
