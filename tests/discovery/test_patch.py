"""Curves written as effects."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from clutchest.discovery import patch
from clutchest.discovery.residual_curves import Curve
from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.effects import Effect, effects_of_file
from clutchest.vehicle import load_vehicle
from equations import argument_names, evaluator

TRUCK = {key: value.value for key, value in load_vehicle("truck").parameters.items()}
AT = np.array([38.0, 42.0, 46.0, 50.0])
TALL = np.array([0.0, 1.0, -1.0, 2.0])
OFF = np.array([[0.1, 0.2, 0.0, 0.0], [0.0, 0.0, 0.3, -0.4]])
FOUND = Curve("torque", "torque", "slave_position", AT, TALL, OFF, 0.0, 0.0, 0.0)


def written(folder: Path, curve: Curve) -> Effect:
    made = patch.written(curve, DRY_CLUTCH)
    assert made is not None
    (folder / patch.FILE).write_text(made.text, encoding="utf-8")
    return effects_of_file(folder / patch.FILE)[patch.NAME]


@pytest.mark.parametrize(
    ("position", "value"), [(37.0, 0.0), (41.0, 0.75), (45.0, -0.5), (52.0, 2.0)]
)
def test_a_reading_is_corrected_by_what_goes_with_the_reading_itself(tmp_path, position, value):
    curve = replace(FOUND, error_term="sensor:slave_position", equation="sensor:slave_position")
    model = DRY_CLUTCH.with_effects((written(tmp_path, curve),))
    values = {name: 1.0 for group in argument_names(model) for name in group}
    values |= {"slave_position": position, "patch.size": 0.5}
    made = evaluator(model, ["slave_position"])(values)
    error = 0.5 * value + np.interp(position, AT, OFF.sum(axis=0))  # both bends stand at 1
    assert made["slave_position"] == pytest.approx(position - 0.1 * error)


def test_a_curve_over_what_stands_before_is_followed(tmp_path):
    model = DRY_CLUTCH.with_effects((written(tmp_path, FOUND),))
    plain = evaluator(DRY_CLUTCH, ["sliding_torque"])
    values = {name: 1.0 for group in argument_names(model) for name in group} | TRUCK
    values |= {"slave_position": 41.0, "zero_position": 38.4, "engine_speed": 150.0}
    values |= {"temp_body": 70.0, "temp_disc": 70.0}
    known = {name for group in argument_names(DRY_CLUTCH) for name in group}
    without = plain({k: v for k, v in values.items() if k in known})["sliding_torque"]
    made = evaluator(model, ["sliding_torque"])(values)["sliding_torque"]
    assert without != 0.0
    assert made == pytest.approx(without * (1.0 + 0.1 * (0.75 + 0.175)))


def test_a_peak_is_kept(tmp_path):
    model = DRY_CLUTCH.with_effects((written(tmp_path, replace(FOUND, driver="temp_disc_peak")),))
    e = model.expressions()
    step = ca.Function("step", [e.x, e.u0, e.u, e.p, e.g], [e.mapped])
    x, disc, peak = np.zeros(len(model.states)), model.state("temp_disc"), len(model.states) - 1
    rest = [np.zeros(len(group)) for group in argument_names(model)[1:]]
    seen = []
    for x[disc] in (80.0, 150.0, 120.0, 160.0):
        x = np.array(step(x, rest[0], rest[0], *rest[-2:])).ravel()
        seen.append(x[peak])
    assert seen == [80.0, 150.0, 150.0, 160.0]


def test_what_the_equations_cannot_see_has_no_text():
    assert patch.written(replace(FOUND, driver="position_rate"), DRY_CLUTCH) is None
    # the clutch's torque is known only after the report that its error would change
    late = replace(FOUND, error_term="sensor:engine_torque", driver="clutch_torque")
    assert patch.written(late, DRY_CLUTCH) is None


def test_a_second_patch_has_names_of_its_own(tmp_path):
    """It stands in one model with the first."""
    over_time = replace(FOUND, driver="time")
    effects = list[Effect]()
    for name in (patch.NAME, "patch_2"):
        made = patch.written(over_time, DRY_CLUTCH, [effect.name for effect in effects])
        assert made is not None and set(made.effects) == {name}
        (tmp_path / f"{name}.py").write_text(made.text, encoding="utf-8")
        effects.append(effects_of_file(tmp_path / f"{name}.py")[name])
    model = DRY_CLUTCH.with_effects(tuple(effects))
    assert len({state.name for state in model.states}) == len(model.states)
    model.expressions()


def test_what_a_curve_may_be_off_by_goes_with_it(tmp_path):
    """Of an equation as numbers of the patch, of a clock as effects beside it; absent at first."""
    made = patch.written(FOUND, DRY_CLUTCH)
    assert made is not None
    assert made.effects == {"patch": {"size": 1.0, "bend_1": 0.0, "bend_2": 0.0}}
    assert made.spread == {"patch": {"bend_1": 1.0, "bend_2": 1.0}}
    clock = replace(
        FOUND,
        error_term="timing:engine_torque",
        equation="timing:engine_torque",
        driver="engine_speed",
    )
    late = patch.written(clock, DRY_CLUTCH, ["patch", "patch_bend_1"])
    assert late is not None
    off = ["patch_2_bend_1", "patch_2_bend_2"]
    assert late.effects == {"patch_2": {"size": 1.0}} | {name: {"size": 0.0} for name in off}
    assert late.spread == {name: {"size": 1.0} for name in off}
    (tmp_path / patch.FILE).write_text(late.text, encoding="utf-8")
    effects = effects_of_file(tmp_path / patch.FILE)
    assert list(effects) == list(late.effects)
    curves = [effects[name].lateness["engine_torque"] for name in effects]
    assert all(curve.at == tuple(AT) and curve.goes_with == "engine_speed" for curve in curves)
    seconds = np.array([curve.seconds for curve in curves])
    per_unit = seconds[0, 1] / TALL[1]
    assert per_unit != 0.0
    np.testing.assert_allclose(seconds, per_unit * np.vstack([TALL, OFF]), atol=1e-6)


@pytest.mark.parametrize(
    ("known", "name"),
    [
        ([], "patch"),
        (["patch_2"], "patch"),
        (["patch", "patch_3"], "patch_2"),
        (["wear", "patch_bend_1"], "patch_2"),
    ],
)
def test_a_patch_takes_a_name_that_is_free(known, name):
    made = patch.written(FOUND, DRY_CLUTCH, known)
    assert made is not None and list(made.effects) == [name]


def test_over_time_a_curve_is_another_drives(tmp_path):
    made = patch.written(replace(FOUND, driver="time"), DRY_CLUTCH)
    assert made is not None and made.spread == {}
