"""Curves of a vehicle file, and patches that earlier versions wrote as Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.models.error_curve import ErrorCurve
from clutchest.vehicle import Vehicle, dump_vehicle, load_vehicle

TORQUE = ErrorCurve("torque", "temp_body", (60.0, 80.0, 100.0), (0.1, -0.2, 0.3))
CURVE = """[effects.curve_1]
error_term = "torque"
covariate = "temp_body"
knots = [60, 80, 100]
values = [0.1, -0.2, 0.3]
covariance = [[4e-4, 0, 0], [0, 1e-4, 0], [0, 0, 1e-4]]

[limits]"""
OF_AN_EQUATION = '''"""An error of the equation `torque` that goes with `temp_body`.

Written by `clutchest discover`.  Between the knots the curve is straight, beyond them it stays.
"""

import casadi as ca

from clutchest.models.dry_clutch import FLAWS
from clutchest.models.effects import Effect, Number

KNOTS = (60.0, 80.0, 100.0)
VALUES = (0.1, -0.2, 0.3)  # in units of the error, one per knot
BENDS = ((0.02, 0.0, 0.0), (0.0, 0.01, 0.01))


class Patch(Effect):
    """The equation `torque` is off by a curve over `temp_body`, times `size`."""

    name = "patch"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("size", "1", -4.0, 4.0),)

    def terms(self, g):
        changes = FLAWS["torque"].changes.items()
        return {}
'''
OF_A_DELAY = '''"""The signal `engine_torque` is late by a curve over `engine_speed`.

Written by `clutchest discover`.  Between the knots the curve is straight, beyond them it stays.
"""

from clutchest.models.effects import Effect, Lateness, Number

KNOTS = (60.0, 150.0)


class Late:
    model = "dry_clutch"
    equation = "timing:engine_torque"
    parameters = (Number("size", "1", -4.0, 4.0),)
    delays = {"engine_torque": "size"}


class Patch(Late, Effect):
    name = "patch"
    lateness = {"engine_torque": Lateness("engine_speed", KNOTS, (0.04, 0.0))}


class PatchBend1(Late, Effect):
    name = "patch_bend_1"
    lateness = {"engine_torque": Lateness("engine_speed", KNOTS, (0.002, 0.001))}
'''
WRONG = [
    (
        ('error_term = "torque"', 'error_term = "torqe"'),
        "torqe",
        "unknown error term 'torqe' of 'dr",
    ),
    (('covariate = "temp_body"', 'covariate = "temp_bdy"'), "temp_bdy", "did you mean 'temp_body'"),
    (
        ('covariate = "temp_body"', 'covariate = "position_rate"'),
        "position_rate",
        "unknown covaria",
    ),
    (
        ("knots = [60, 80, 100]", "knots = [60, 80, 70]"),
        "knots",
        "two or more numbers that increase",
    ),
    (
        ("knots = [60, 80, 100]", "knots = [60, 80]"),
        "values",
        "has 3 numbers, expected one per knot",
    ),
    (("values = [0.1", 'values = ["a"'), "values", r"values must be a number, not 'a'"),
    (("values =", "valuse ="), "valuse", "unknown key of a curve 'valuse'; did you mean 'values'"),
    (("covariate =", "# covariate ="), "[effects.curve_1]", "effects.curve_1 has no 'covariate'"),
    (("[[4e-4, 0, 0], ", "["), "covariance", "must have 3 rows of 3 numbers"),
    (("[[4e-4, 0, 0]", "[[4e-4, 1e-4, 0]"), "covariance", "must be symmetric"),
    (("[[4e-4, 0, 0]", "[[-4e-4, 0, 0]"), "covariance", "must be positive semidefinite"),
    (("[effects.curve_1]", "[effects.curv_1]"), "[effects.curv_1]", "unknown effect .*'curve'"),
]


@pytest.fixture
def with_curve(edited):
    return lambda *changes: edited(("[limits]", CURVE), *changes)


def test_curves_are_read_and_written_back_equal(with_curve, tmp_path: Path) -> None:
    vehicle = load_vehicle(with_curve())
    (curve,) = vehicle.curves.values()
    assert replace(curve, covariance=()) == TORQUE and vehicle.effects == {}
    assert vehicle.effect_numbers["curve_1"]["size"] == 1.0
    np.testing.assert_allclose(sorted(curve.deviations.max(axis=1)), [0.01, 0.01, 0.02])
    late = replace(TORQUE, error_term="timing:engine_torque", covariate="engine_speed")
    both = replace(
        vehicle, curves={**vehicle.curves, "curve_2": late}, effects={"wear": {"rate": 1}}
    )
    dump_vehicle(both, tmp_path / "copy.toml")
    copy = load_vehicle(tmp_path / "copy.toml")
    assert copy == both and copy.curves == both.curves and copy.notes == ()


@pytest.mark.parametrize(("change", "where", "message"), WRONG, ids=[m for _, _, m in WRONG])
def test_complaints_name_file_line_and_key(with_curve, change, where, message) -> None:
    path = with_curve(change)
    with pytest.raises(ClutchestError, match=message) as caught:
        load_vehicle(path)
    lines = path.read_text(encoding="utf-8").splitlines()
    line = next(i for i, text in enumerate(lines, 1) if where in text and "#" not in text[:2])
    assert str(caught.value).startswith(f"mine.toml:{line}: ")


def test_an_earlier_patch_of_an_equation_is_read_as_a_curve(edited, tmp_path: Path) -> None:
    (tmp_path / "patch_effects.py").write_text(OF_AN_EQUATION, encoding="utf-8")
    stated = "patch = { size = 1.0, bend_1 = 0.5, bend_2 = 0.0 }"
    spread = "patch = { bend_1 = 0.5, bend_2 = 1.0 }"
    vehicle = load_vehicle(
        edited(
            ("checked =", 'effects_files = ["patch_effects.py"]\nchecked ='),
            ("[limits]", f"[effects]\n{stated}\n\n[effects_spread]\n{spread}\n\n[limits]"),
        )
    )
    (curve,) = vehicle.curves.values()
    assert (curve.error_term, curve.covariate) == ("torque", "temp_body")
    np.testing.assert_allclose(curve.values, (0.11, -0.2, 0.3))
    bends = np.array([[0.01, 0.0, 0.0], [0.0, 0.01, 0.01]])
    np.testing.assert_allclose(curve.covariance, bends.T @ bends, atol=1e-12)
    assert vehicle.effects == {} and vehicle.effects_files == ()
    assert vehicle.notes == ("patch_effects.py: a patch of an earlier version, read as a curve",)


def test_an_earlier_patch_of_a_delay_is_read_as_a_curve(edited, tmp_path: Path) -> None:
    (tmp_path / "patch_effects.py").write_text(OF_A_DELAY, encoding="utf-8")
    stated = "patch = { size = 1.0 }\npatch_bend_1 = { size = 0.0 }"
    vehicle = load_vehicle(
        edited(
            ("checked =", 'effects_files = ["patch_effects.py"]\nchecked ='),
            (
                "[limits]",
                f"[effects]\n{stated}\n[effects_spread]\npatch_bend_1 = {{ size = 1 }}\n[limits]",
            ),
        )
    )
    (curve,) = vehicle.curves.values()
    assert (curve.error_term, curve.covariate) == ("timing:engine_torque", "engine_speed")
    assert curve.values[0] > 0.0 == curve.values[1] and len(curve.deviations) == 1
    ratio = abs(curve.deviations[0] / curve.values[0])
    np.testing.assert_allclose(ratio, [0.05, 0.025], rtol=1e-5)


def test_a_vehicle_with_a_curve_has_no_simulation(with_curve, truck: Vehicle) -> None:
    from clutchest.simulated import simulate

    with pytest.raises(ClutchestError, match=r"curve_1 cannot be simulated"):
        simulate(load_vehicle(with_curve()), "launches", 1, duration=5.0)
