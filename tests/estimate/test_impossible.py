"""Signals that cannot be right whatever the parameters are: live as in a replay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.estimate.against_work import against_work
from clutchest.estimate.impossible import LAST_S, BeginOfDrive, impossible
from clutchest.estimate.replay import replay
from clutchest.reading.drafting import guessed_parameters
from mended_signals import mended

TURNED = {
    "motor_angle": ("motor_angle",),
    "both": ("armature_voltage", "armature_current"),
    "armature_current": ("armature_current",),
    "armature_voltage": ("armature_voltage",),
}
EITHER = {
    "both": "the sign of motor_angle is wrong, or the signs of armature_voltage and "
    "armature_current are wrong",
    "armature_current": "the sign of armature_current is wrong, or the signs of armature_voltage "
    "and motor_angle are wrong",
    "armature_voltage": "the sign of armature_voltage is wrong, or the signs of armature_current "
    "and motor_angle are wrong",
}
EITHER["motor_angle"] = EITHER["both"]


@pytest.fixture(scope="module", params=["rig-steps", "rig-ramps", "coast", "slip-oil-sweep", "car"])
def actuated(request):
    vehicle = clutchest.load_vehicle("alsd_car" if request.param == "car" else "alsd_rig")
    return clutchest.simulate(vehicle, request.param, 3, duration=20.0), vehicle


def turned(drive, names):
    return mended(drive, **dict.fromkeys(names, np.negative))


@pytest.mark.parametrize("what", TURNED)
def test_an_actuator_that_would_give_back_what_it_has_not_taken_is_named(actuated, what):
    drive, vehicle = actuated
    found = impossible(turned(drive, TURNED[what]), vehicle)
    assert found is not None and found.kind == "sign"
    assert found.explanation == EITHER[what]
    assert {found.signal, *found.others} == {
        "armature_voltage",
        "armature_current",
        "motor_angle",
    }


def test_an_actuator_that_is_read_rightly_is_not_doubted(actuated):
    """Nor is one that is only released: what it gives back was stored before."""
    drive, vehicle = actuated
    angle = drive["motor_angle"].only_valid()
    pressed = float(angle.time[np.argmax(np.abs(angle.value))])
    for start, end in ((0.0, 5.0), (0.0, 10.0), (0.0, 20.0), (pressed, 20.0)):
        assert against_work(drive.between(start, end), vehicle) is None


def test_all_of_an_actuator_turned_is_nothing_that_its_work_tells(actuated):
    drive, vehicle = actuated
    assert against_work(turned(drive, sum(TURNED.values(), ())), vehicle) is None


def test_voltage_and_current_both_turned_are_named_however_little_is_known():
    """A draft's states were valid without a word."""
    rig = clutchest.load_vehicle("alsd_rig")
    draft = replace(rig, parameters=guessed_parameters(rig.machine), limits={})
    drive = clutchest.simulate(rig, "rig-ramps", 3, duration=20.0)
    run = replay(turned(drive, TURNED["both"]), draft)
    assert "armature_voltage and armature_current" in run.summary["contradiction"]["explanation"]
    assert not any(state["valid"] for state in run.summary["states"].values())


def test_a_ratio_that_is_held_is_no_swap_that_happens_to_fit():
    """With other speeds in their places the launch fitted as well."""
    drive = clutchest.simulate("truck", "launches", 7, duration=60.0)
    wrong = mended(drive, input_shaft_speed=lambda speed: speed * 58.0 / 60.0)
    found = replay(wrong, "truck").summary["contradiction"]
    assert "number of teeth" in found["explanation"]


def in_pieces(drive, vehicle, seconds):
    """What is found of a drive that comes in pieces of so many ``seconds``, and when."""
    begin = BeginOfDrive(vehicle)
    for start in np.arange(0.0, drive.end, seconds):
        piece = drive.between(start, start + seconds)
        if (found := begin.take(piece.signals, start + seconds)) is not None:
            return found, start + seconds
    return begin.take({}, drive.end, last=True), drive.end


@pytest.mark.parametrize(
    ("name", "factor"), [("input_shaft_speed", 58.0 / 60.0), ("engine_torque", -1.0)]
)
def test_a_drive_that_is_going_on_is_judged_like_a_whole_one(name, factor):
    truck = clutchest.load_vehicle("truck")
    drive = clutchest.simulate(truck, "launches", 11, duration=60.0)
    wrong = mended(drive, **{name: lambda value: factor * value})
    found, when = in_pieces(wrong, truck, 0.5)
    whole = impossible(wrong.between(end=when), truck)
    assert found is not None and found == whole and when <= 60.0
    assert found.kind == impossible(wrong, truck).kind
    assert in_pieces(drive, truck, 0.5)[0] is None


def test_what_is_held_of_a_drive_is_bounded():
    truck = clutchest.load_vehicle("truck")
    drive = clutchest.simulate(truck, "launches", 11, duration=30.0)
    begin = BeginOfDrive(truck)
    begin.take(drive.signals, 30.0)
    assert sum(len(part) for parts in begin._parts.values() for part in parts) > 1000
    begin.take({}, 2.0 * LAST_S)
    begin.take(drive.signals, 2.0 * LAST_S + 30.0)
    assert not begin._parts
