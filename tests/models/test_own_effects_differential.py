"""A user's own effects in the differential's generator: twins of effects that the generator knows
itself give the same run."""

from __future__ import annotations

import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.models.alsd import effects
from clutchest.signals import Signals

from .twins import assert_alike, shown, twin

RIG = clutchest.load_vehicle("alsd_rig")
RUN = {"duration": 12.0, "nominal": True}
READINGS = ("armature_current", "motor_angle", "clutch_torque")
TWINS = {  # effect → its numbers, where they show, the share of what they do that may be missing
    "friction_slip": ({"change": 0.2}, ("clutch_torque",), 0.05),
    "friction_oil_temperature": ({"slope": 0.5}, ("clutch_torque",), 0.05),
    "viscous_drag": ({"coefficient": 30.0}, ("clutch_torque", "temp_pack"), 0.05),
    "free_play_growth": ({"growth": 2e-5, "rate": 1e-3}, ("free_play", "motor_angle"), 0.05),
    "supply_drop": ({"resistance": 0.1}, ("motor_speed",), 0.1),
    "resistance_temperature": ({"change": 0.02}, ("motor_speed", "temp_armature"), 0.1),
    "motor_friction": ({"change": 0.5}, ("motor_angle",), 0.3),  # not that of bent bristles
    "ball_ramp_friction": ({"change": 0.5}, ("motor_angle",), 0.05),
    "angle_offset": ({"offset": 0.2}, ("motor_angle",), 0.05),
    "torque_sensor_gain": ({"change": 0.1}, ("clutch_torque",), 0.05),
}


@pytest.fixture(scope="module")
def healthy() -> Signals:
    return clutchest.simulate(RIG, "rig-steps", 5, **RUN)


@pytest.mark.slow
@pytest.mark.parametrize("name", TWINS)
def test_a_twin_of_a_library_effect_does_the_same(tmp_path, healthy, name):
    numbers, places, missing = TWINS[name]
    library = clutchest.simulate(RIG, "rig-steps", 5, {name: numbers}, **RUN)
    files = (twin(tmp_path, effects, name),)
    own = clutchest.simulate(
        RIG, "rig-steps", 5, {f"own_{name}": numbers}, effects_files=files, **RUN
    )
    for place in places:
        each = (shown(run, place, READINGS) for run in (healthy, library, own))
        assert_alike(*each, missing, 1e-12)


def test_what_the_generator_cannot_be_told_is_said(tmp_path):
    files = (twin(tmp_path, effects, "pack_stiffness"),)
    with pytest.raises(ClutchestError, match=r"the differential's generator.* cannot simulate it"):
        clutchest.simulate(
            RIG,
            "rig-steps",
            5,
            {"own_pack_stiffness": {"change": 0.1}},
            effects_files=files,
            **RUN,
        )
