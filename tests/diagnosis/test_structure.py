"""Structural detectability: which sensors a fault affects, and through which states."""

from __future__ import annotations

from pathlib import Path

import pytest

from clutchest.diagnosis.structure import affected_sensors
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
    assert affected["wear"] == ("engine_speed through zero_position", "zero_position")
    for sensors in affected.values():
        for name, _, states in (text.partition(" through ") for text in sensors):
            assert name not in states.split(", ")


def test_a_machine_without_regimes():
    machine = machine_in_file(SERVO)
    equations = machine.equations(machine.units)
    assert not equations.regime
    affected = affected_sensors(equations, [(f.name, f.effect, f.key) for f in machine.faults])
    assert set(affected) == {f.name for f in machine.faults} and all(affected.values())
