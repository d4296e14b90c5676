"""Structural detectability: which sensors a fault affects, and through which states."""

from __future__ import annotations

from pathlib import Path

import pytest

from clutchest.diagnosis.structure import AffectedSensor, affected_sensors, estimates_resting_on
from clutchest.machine import Input, Model, Sensor, State
from clutchest.models import machine_in_file, machine_of

SERVO = Path(__file__).parents[2] / "machines" / "servo" / "servo.py"


@pytest.fixture(scope="module")
def affected():
    machine = machine_of("dry_clutch")
    faults = [(f.name, f.effect, f.key) for f in machine.faults]
    wear = ("wear", machine.effects["wear"], "amount")
    return affected_sensors(machine.equations(machine.units), [*faults, wear])


def test_a_reading_of_a_state_is_not_affected_through_itself(affected):
    """Wear moves the zero position, which its own sensor reads."""
    own, other = AffectedSensor("zero_position"), AffectedSensor("engine_speed", ("zero_position",))
    assert affected["wear"] == (other, own)
    assert [str(each) for each in affected["wear"]] == [
        "engine_speed through zero_position",
        "zero_position",
    ]
    for sensors in affected.values():
        assert all(each.sensor not in each.through for each in sensors)


def test_a_machine_without_regimes():
    machine = machine_in_file(SERVO)
    equations = machine.equations(machine.units)
    assert not equations.regime
    affected = affected_sensors(equations, [(f.name, f.effect, f.key) for f in machine.faults])
    assert set(affected) == {f.name for f in machine.faults} and all(affected.values())


@pytest.mark.parametrize(
    ("name", "needed", "optional"),
    [
        ("alsd", ("armature_voltage", "armature_current", "motor_angle", "slip_speed"), "oil_temp"),
        ("dry_clutch", ("engine_torque", "slave_position", "engine_speed"), "vehicle_speed"),
    ],
)
def test_everything_rests_on_the_signals_that_a_machine_needs(name, needed, optional):
    machine = machine_of(name)
    model = machine.equations(machine.units)
    everything = {state.name for state in model.states} | set(model.outputs)
    for signal in needed:
        assert estimates_resting_on(model, signal) == everything, signal
    assert estimates_resting_on(model, optional) == frozenset()
    assert estimates_resting_on(model, "no_signal") == frozenset()


def two_axes(q):
    """Each motor turns an axis of its own; a spring pulls a third one after the second."""
    q.a_rate, q.b_rate = q.drive_a - q.a, q.drive_b - q.b
    q.follower_rate = q.b - q.follower
    q.a_reading, q.b_reading, q.sum = q.a, q.b, q.a + q.follower


ANGLES = ("a", "b", "follower")
AXES = Model(
    "axes",
    states=tuple(State(name, "rad", name, "axis", 0.1, 1.0, 1.0) for name in ANGLES),
    parameters=(),
    inputs=tuple(Input(f"drive_{name}", "rad", "u", "motor") for name in ANGLES[:2]),
    sensors=tuple(Sensor(name, "rad", name, "axis") for name in ANGLES[:2]),
    pieces=(two_axes,),
    outputs=("sum",),
    anchor="a",
)


@pytest.mark.parametrize(
    ("signal", "resting"),
    [
        ("drive_a", {"a", "sum"}),
        ("a", {"a", "sum"}),
        ("drive_b", {"b", "follower", "sum"}),
        ("b", {"b", "follower", "sum"}),
    ],
)
def test_one_part_of_a_machine_does_not_rest_on_another(signal, resting):
    assert estimates_resting_on(AXES, signal) == resting
