"""From a drive to a diagnosis: faults injected by the generator or into frames."""

from dataclasses import replace

import mangled
import numpy as np
import pytest

import clutchest
from clutchest.diagnosis.drive_diagnosis import RECOVERY_S, DriveDiagnosis
from clutchest.diagnosis.isolation import not_excluded
from clutchest.diagnosis.recursive_residuals import onset_scores
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.record.files import json_text
from clutchest.simulated import simulate_frames


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


def diagnosed(truck, effects=None, scenario="city", seed=51, **options):
    options.setdefault("duration", 600.0)
    signals = clutchest.simulate(truck, scenario, seed, effects, **options)
    return clutchest.diagnose(clutchest.replay(signals, truck))


def verdict(diagnosis, name):
    return next(m for m in diagnosis.monitors if m.name == name)


@pytest.mark.slow
class TestEquations:
    """Faults that only the equations show."""

    def test_the_shipped_log_is_healthy_and_names_the_tests_that_could_not_run(self, truck):
        diagnosis = clutchest.diagnose(clutchest.replay(clutchest.read_log("demo", truck), truck))
        assert not diagnosis.faults
        fade = verdict(diagnosis, "friction_fade")
        assert fade.status == "not run" and "separability" in fade.why
        assert verdict(diagnosis, "torque_bias").status == "passed"
        assert verdict(diagnosis, "wear").status == "passed"

    @pytest.mark.parametrize(
        ("effect", "key", "size"),
        [
            ("torque_bias", "bias", 70.0),
            ("friction_level", "change", -0.25),
            ("torque_gain", "change", 0.15),
        ],
    )
    def test_the_fault_is_named_and_its_size_estimated(self, truck, effect, key, size):
        diagnosis = diagnosed(truck, {effect: {key: size}})
        assert [f.fault for f in diagnosis.faults] == [effect]
        fault = diagnosis.faults[0]
        assert fault.set == (effect,)
        cause = fault.causes[0]
        assert abs(cause.size - size) < 4 * cause.std + 0.1 * abs(size)
        assert fault.freeze_frame["states"].keys() >= {"temp_disc", "friction"}
        assert fault.status_byte & 1

    def test_a_strong_fade_keeps_its_size(self, truck):
        """Derivatives at a healthy clutch alone make 0.20 of it."""
        diagnosis = diagnosed(
            truck, {"friction_fade": {"slope": 0.25}}, "heating", 53, duration=900.0
        )
        (fault,) = diagnosis.faults
        assert fault.set == ("friction_fade",)
        cause = fault.causes[0]
        assert abs(cause.size - 0.25) < 3.0 * cause.std < 0.06

    def test_a_fault_that_begins_during_the_drive_is_detected_soon(self, truck):
        signals = clutchest.simulate(truck, "city", 52, duration=600.0)
        torque = signals["engine_torque"]
        value = torque.value + 60.0 * (torque.time > 350.0)
        signals = replace(
            signals, signals={**signals.signals, "engine_torque": replace(torque, value=value)}
        )
        run = clutchest.replay(signals, truck)
        (fault,) = clutchest.diagnose(run).faults
        assert fault.set == ("torque_bias",)
        track = run.tracks[0]  # in a locked clutch the torque error is not observable
        apart = np.isin(track.mode, [track.mode_names.index(m) for m in ("open", "slipping")])
        first = track.time[apart & (track.time > 350.0)][0]
        assert first - 1.0 < fault.first_detected_s < first + 15.0
        assert fault.began_s == pytest.approx(first, abs=10.0)
        assert fault.causes[0].size == pytest.approx(60.0, abs=15.0)

    def test_a_low_zero_position_may_be_wear(self, truck):
        diagnosis = diagnosed(truck, {"position_offset": {"offset": -1.0}}, nominal=True)
        assert [f.fault for f in diagnosis.faults] == ["position_offset"]
        fault = diagnosis.faults[0]
        assert set(fault.set) == {"position_offset", "wear"}
        assert fault.fmi == 11
        assert verdict(diagnosis, "wear").status == "passed"

    def test_heat_is_no_fault(self, truck):
        effects = {
            "coolant_coupling": {"change": 0.2},
            "transmission_heat_path": {"conductance": 3.0},
        }
        diagnosis = diagnosed(truck, effects, scenario="heating")
        assert not diagnosis.faults
        assert verdict(diagnosis, "wear").status == "passed"

    @pytest.mark.parametrize("seed", [0, 3])
    def test_a_body_that_loses_heat_is_not_a_sensor_that_drifts(self, truck, seed):
        lost = {"transmission_heat_path": {"conductance": 20.0}}
        diagnosis = diagnosed(truck, lost, "cooldown", seed, duration=1200.0)
        assert not diagnosis.faults
        assert verdict(diagnosis, "drift:slave_position").status == "passed"

    def test_a_hot_start_is_not_a_sensor_that_drifts(self, truck):
        drift = []
        for seed in range(4):
            run = clutchest.replay(
                clutchest.simulate(truck, "cooldown", seed, duration=1200.0), truck
            )
            results = DriveDiagnosis.of(run, run.signals, run.tracks[0]).equations
            whole = onset_scores(
                results.blocks, results.columns, results.residuals.before, 0, len(results.blocks)
            )
            k = [j.fault.name for j in results.faults].index("drift:slave_position")
            drift.append(whole.score[-1, k] / np.sqrt(whole.information[-1, k, k]))
        assert abs(np.mean(drift)) < 3.0 / np.sqrt(len(drift))

    def test_isolability_is_known_without_a_fault(self, truck):
        isolability = diagnosed(truck).isolability
        row, column = isolability.faults.index("wear"), isolability.faults.index("position_offset")
        assert isolability.d_prime[column, row] < 0.1 < 3.0 < isolability.d_prime[column, -1]
        sensors = {f: {each.sensor for each in s} for f, s in isolability.structure.items()}
        assert "engine_speed" in sensors["torque_gain"]
        assert "zero_position" in sensors["position_offset"]
        assert isolability.structure["friction_level"] != isolability.structure["position_offset"]


@pytest.mark.slow
def test_wear_beyond_its_limit(truck):
    diagnosis = diagnosed(truck, {"wear": {"amount": 3.6}})
    assert [f.fault for f in diagnosis.faults] == ["wear"]
    assert set(diagnosis.faults[0].set) == {"wear", "position_offset"}


@pytest.mark.slow
def test_a_stuck_sensor_is_not_blamed_on_the_clutch(truck):
    frames, _ = simulate_frames(truck, "city", 51, duration=600.0)
    broken = mangled.resummed(mangled.held(frames, mangled.ACTUATOR, 200.0, 260.0, slice(0, 2)))
    signals = signals_of(broken, truck, load_database(truck))
    diagnosis = clutchest.diagnose(clutchest.replay(signals, truck))
    assert [f.fault for f in diagnosis.faults] == ["stuck:slave_position"]
    assert diagnosis.faults[0].began_s == pytest.approx(200.0, abs=0.1)


@pytest.fixture(scope="module")
def run():
    rig = clutchest.load_vehicle("alsd_rig")
    return clutchest.replay(clutchest.read_log("alsd", rig), rig)


@pytest.fixture(scope="module")
def diagnosis(run):
    return clutchest.diagnose(run)


@pytest.mark.slow
class TestOfTheDifferential:
    """Signals and equations of another machine than the truck clutch."""

    def test_a_healthy_log(self, diagnosis):
        assert not diagnosis.faults
        assert {"motor_friction", "supply_drop"} <= {
            m.name for m in diagnosis.monitors if m.status == "passed"
        }
        assert {m.status for m in diagnosis.monitors} == {"passed", "not run"}
        json_text(diagnosis.summary())

    def test_each_status_and_its_reason(self, run, diagnosis):
        for monitor in diagnosis.monitors:
            assert monitor.why
            assert (monitor.threshold is None) <= (monitor.status == "not run")
            assert monitor.false_alarms_per_1000h == run.vehicle.monitors["false_alarms_per_1000h"]

    def test_samples_of_a_stuck_signal_are_not_used(self, run):
        angle = run.signals["motor_angle"]
        held = np.where((angle.time > 5) & (angle.time < 5.8), 1.234, angle.value)
        signals = replace(
            run.signals, signals={**run.signals.signals, "motor_angle": replace(angle, value=held)}
        )
        valid = DriveDiagnosis.of(run, signals, run.tracks[0]).valid["motor_angle"]
        time = valid.time[(valid.time > 4.9) & (valid.time < 7.1)]
        assert not np.any((time > 5.01) & (time < 5.8 + RECOVERY_S))
        assert time[0] < 5.0 and time[-1] > 5.8 + RECOVERY_S

    def test_a_fault_has_a_freeze_frame_and_a_code(self, run):
        angle = run.signals["motor_angle"]
        held = np.where((angle.time > 5) & (angle.time < 6), 1.234, angle.value)
        signals = replace(
            run.signals, signals={**run.signals.signals, "motor_angle": replace(angle, value=held)}
        )
        diagnosis = clutchest.diagnose(replace(run, signals=signals))
        assert [f.fault for f in diagnosis.faults] == ["stuck:motor_angle"]
        fault = diagnosis.faults[0]
        assert fault.freeze_frame["inputs"]["motor_angle"] == 1.234
        assert 520_192 < fault.spn < 524_288 and fault.fmi == 2
        assert 0.99 < fault.confidence < 1.0
        assert not_excluded(fault.causes) == ()
