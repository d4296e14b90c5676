"""Faults that the equations of the differential show."""

from __future__ import annotations

from dataclasses import replace

import pytest

import clutchest
from clutchest.diagnosis.blocks import blocks_at, problem_of
from clutchest.diagnosis.drive_diagnosis import effects_for
from clutchest.diagnosis.fault_tests import FaultTestResults, run_fault_tests
from clutchest.diagnosis.isolation import explanations, not_excluded

DURATION = 60.0  # s
FAULTS = {
    "motor_friction": {"change": 1.0},
    "pack_stiffness": {"change": -0.25},
    "supply_drop": {"resistance": 0.1},
}


def _tested(
    seed: int, effects: dict, onset: float = 0.0, scenario: str = "rig-steps"
) -> FaultTestResults:
    rig = clutchest.load_vehicle("alsd_rig")
    signals = clutchest.simulate(rig, scenario, seed, effects, duration=DURATION, onset=onset)
    blocks = blocks_at(problem_of(signals, rig, effects_for(rig.machine)))
    return run_fault_tests(blocks, rig.machine, rig.false_alarms_per_1000h, DURATION / 3600.0)


@pytest.mark.slow
def test_a_healthy_specimen_unlike_the_file_passes():
    results = _tested(41, {})
    assert {r.status for r in results.faults} <= {"passed", "not run"}
    assert results.misfit_detected is None


@pytest.mark.slow
def test_a_clutch_at_rest_shows_no_fault():
    """Noise of the voltage passed for a drop of the supply while no current flows (development)."""
    results = _tested(62033, {}, scenario="coast")
    assert {r.status for r in results.faults} <= {"passed", "not run"}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_detected_and_told_from_all_others(fault):
    results = _tested(42, {fault: FAULTS[fault]})
    detected = [r for r in results.faults if r.detected is not None]
    assert fault in {r.fault.name for r in detected}
    onsets = sorted({0, *(int(r.onset[r.detected]) for r in detected)})
    ranked = explanations(results, onsets, len(results.blocks))
    assert not_excluded(ranked) == (fault,)


@pytest.mark.slow
def test_an_encoder_that_slips_within_the_drive():
    onset = 33.9
    results = _tested(101, {"angle_offset": {"offset": 0.1}}, onset)
    found = next(r for r in results.faults if r.fault.name == "angle_offset")
    assert found.detected is not None
    ends = results.blocks.end
    assert onset < ends[found.detected] < onset + 5.0
    assert ends[int(found.onset[found.detected])] > onset > 30.0
    ranked = explanations(results, [int(found.onset[found.detected])], len(results.blocks))
    assert not_excluded(ranked) == ("angle_offset",)
    assert ranked[0].size == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
def test_a_signal_that_is_not_in_the_log_is_said():
    log = clutchest.simulate("alsd_rig", "rig-steps", 1, duration=2.0)
    rest = {name: signal for name, signal in log.signals.items() if name != "clutch_torque"}
    diagnosis = clutchest.diagnose(replace(log, signals=rest), "alsd_rig")
    why = {m.name: m.why for m in diagnosis.monitors if m.name.endswith(":clutch_torque")}
    assert why == dict.fromkeys(
        ("noise:clutch_torque", "stuck:clutch_torque"), "no valid sample of it"
    )
