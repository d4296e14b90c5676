"""Readings far from every prediction: a fault that is named, or another machine than the file's."""

from __future__ import annotations

import pytest

import clutchest
from clutchest.diagnosis.codes import CONTRADICTION


@pytest.mark.slow
def test_a_large_fault_is_named_and_the_log_of_another_machine_is_not():
    """Half an ohm in the supply, the largest plausible one, and a motor of half the constants are
    both far from the model; only the first is one of its faults."""
    rig = clutchest.load_vehicle("alsd_rig")
    drop = {"supply_drop": {"resistance": 0.5}}
    run = clutchest.replay(clutchest.simulate(rig, "rig-steps", 22, drop, duration=60.0), rig)
    assert run.tracks[0].contradiction.kind == "misfit"
    assert [fault.fault for fault in clutchest.diagnose(run).faults] == ["supply_drop"]
    constants = dict.fromkeys(("back_emf_constant", "torque_constant"), 0.08)
    other = rig.with_parameters(armature_resistance=0.2, **constants)
    run = clutchest.replay(clutchest.simulate(rig, "rig-steps", 9, duration=60.0), other)
    first = clutchest.diagnose(run).faults[0]
    assert first.fault.startswith(f"{CONTRADICTION}:") and "another vehicle" in first.what
