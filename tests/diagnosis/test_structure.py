"""Structural detectability: which sensors a fault affects, and through which states."""

from __future__ import annotations

import pytest

from clutchest.diagnosis.structure import affected_sensors
from clutchest.models import machine_of


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
