"""A user's own effects in the truck's generator, which shares no equations with the model: twins of
effects that the generator knows itself give the same drive."""

from __future__ import annotations

import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.models import machine_of
from clutchest.models.dry_clutch import effects
from clutchest.signals import Signals

from .twins import assert_alike, shown, twin

TRUCK = clutchest.load_vehicle("truck")
DRIVE = {"duration": 80.0, "nominal": True}  # two launches
READINGS = ("engine_torque", "slave_position")
TWINS = {  # effect → its numbers, and where they show; shares of what they do that may be missing
    "friction_level": ({"change": 0.2}, ("temp_disc", "engine_speed"), 0.05),
    "friction_temperature": ({"slope": 0.1}, ("temp_disc", "engine_speed"), 0.05),
    "heat_capacity_disc": ({"change": 0.2}, ("temp_disc",), 0.05),
    "heat_split": ({"fraction": 0.1}, ("temp_disc", "temp_body"), 0.05),
    "wear": ({"amount": 0.2, "rate": 0.1}, ("zero_position",), 0.05),
    "viscous_drag": ({"coefficient": 20.0}, ("temp_disc",), 0.3),  # not that on the gearbox side
    "torque_gain": ({"change": 0.1}, ("engine_torque",), 0.05),
    "torque_delay": ({"delay": 0.04}, ("engine_torque",), 0.0),
    "position_offset": ({"offset": 0.3}, ("slave_position",), 0.05),
}


@pytest.fixture(scope="module")
def healthy() -> Signals:
    return clutchest.simulate(TRUCK, "launches", 5, **DRIVE)


@pytest.mark.slow
@pytest.mark.parametrize("name", TWINS)
def test_a_twin_of_a_library_effect_does_the_same(tmp_path, healthy, name):
    numbers, places, missing = TWINS[name]
    library = clutchest.simulate(TRUCK, "launches", 5, {name: numbers}, **DRIVE)
    files = (twin(tmp_path, effects, name),)
    own = clutchest.simulate(
        TRUCK, "launches", 5, {f"own_{name}": numbers}, effects_files=files, **DRIVE
    )
    for place in places:
        each = (shown(drive, place, READINGS) for drive in (healthy, library, own))
        assert_alike(*each, missing, 1e-9)


def test_what_the_generator_cannot_be_told_is_said(tmp_path):
    assert "position_hysteresis" in machine_of("dry_clutch").effects
    files = (twin(tmp_path, effects, "position_hysteresis"),)
    numbers = {"own_position_hysteresis": {"play": 0.1}}
    with pytest.raises(ClutchestError, match="has a state, a step map or a delay that varies"):
        clutchest.simulate(TRUCK, "launches", 5, numbers, effects_files=files, **DRIVE)


def test_what_changes_nothing_of_the_truck_is_said(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(
        "from clutchest.machine import Effect, Number\n"
        "class Idle(Effect):\n"
        "    name, model, equation = 'idle', 'dry_clutch', 'torque'\n"
        "    parameters = (Number('size', '1', -0.5, 0.5),)\n"
        "    def terms(self, g):\n"
        "        return {'transmitted_torque': lambda torque, q: torque * (1 + g.size)}\n",
        encoding="utf-8",
    )
    with pytest.raises(ClutchestError, match="size, which changes nothing that the generator"):
        clutchest.simulate(
            TRUCK, "launches", 5, {"idle": {"size": 0.1}}, effects_files=(path,), **DRIVE
        )


def test_an_unknown_number_is_said(tmp_path):
    files = (twin(tmp_path, effects, "friction_level"),)
    with pytest.raises(ClutchestError, match="effect 'own_friction_level' has no 'chnge'"):
        clutchest.simulate(
            TRUCK,
            "launches",
            5,
            {"own_friction_level": {"chnge": 0.1}},
            effects_files=files,
            **DRIVE,
        )
