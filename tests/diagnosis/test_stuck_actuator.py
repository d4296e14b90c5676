"""An actuator that does not move although its voltage rises."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import clutchest
from clutchest.diagnosis.faults import StreamTest
from clutchest.diagnosis.faults.implausible import Implausible
from clutchest.diagnosis.streams import StreamTests, between
from clutchest.models.alsd.actuator import least_turn
from clutchest.signals import Signals
from clutchest.vehicle import load_vehicle

STICKING = "sticking:actuator"
SEED = 7
JAM = 8.0  # s


@dataclass(frozen=True)
class Jammed:
    """Something jams the motor from ``onset`` s on."""

    onset: float

    def law(self) -> Callable[[Mapping[str, float]], Mapping[str, float]]:
        return lambda seen: {"jam": float(seen["time"] >= self.onset)}

    def readings(self, true: Mapping[str, Any]) -> Mapping[str, Any]:
        return true


@dataclass(frozen=True)
class Drifting:
    """The encoder's zero moves from the start, by so many rad/h."""

    rate: float

    def law(self) -> None:
        return None

    def readings(self, true: Mapping[str, Any]) -> Mapping[str, Any]:
        return {**true, "motor_angle": lambda t: true["motor_angle"](t) + self.rate * t / 3600.0}


def run(vehicle: str, scenario: str, duration: float, outsider: Any = None) -> Signals:
    return clutchest.simulate(vehicle, scenario, SEED, duration=duration, outsider=outsider)


def stream_tests(signals: Signals, step: float | None = None) -> dict[str, StreamTest]:
    streams = StreamTests(load_vehicle("alsd_rig"))
    if step is None:
        streams.take(signals, signals.end)
    else:
        for begin in np.arange(0.0, signals.end, step):
            streams.take(between(signals, begin, begin + step), min(begin + step, signals.end))
    return {test.name: test for test in streams.tests}


@pytest.fixture(scope="module")
def jammed() -> Signals:
    return run("alsd_rig", "rig-steps", 20.0, Jammed(JAM))


def test_a_motor_that_jams_is_seen_after_two_engagements(jammed):
    found = stream_tests(jammed)[STICKING]
    (alarm,) = found.alarms
    assert JAM - 1.0 < alarm.begun <= JAM < alarm.detected < JAM + 6.0
    assert "armature voltage changed by" in alarm.what and "motor angle by 0 rad" in alarm.what
    assert found.failing and not found.harmless


def test_it_is_seen_as_well_while_it_happens(jammed):
    whole, live = stream_tests(jammed)[STICKING].alarms, stream_tests(jammed, 0.35)[STICKING].alarms
    assert [(a.begun, a.detected) for a in live] == [(a.begun, a.detected) for a in whole]


def test_one_that_comes_loose_heals():
    @dataclass(frozen=True)
    class Loosened(Jammed):
        def law(self):
            return lambda seen: {"jam": float(JAM <= seen["time"] < 18.0)}

    (alarm,) = stream_tests(run("alsd_rig", "rig-steps", 30.0, Loosened(JAM)))[STICKING].alarms
    assert alarm.ended is not None and 18.0 < alarm.ended < 30.0


@pytest.mark.parametrize("scenario", ["rig-steps", "rig-slow", "rig-ramps", "slip-oil-sweep"])
def test_a_healthy_one_passes(scenario):
    found = stream_tests(run("alsd_rig", scenario, 60.0))
    assert not [name for name, test in found.items() if test.alarms]
    assert found[STICKING].enabled and "over" in found[STICKING].why


def test_much_friction_is_no_jam():
    signals = clutchest.simulate(
        "alsd_rig", "rig-steps", SEED, {"motor_friction": {"change": 1.5}}, duration=20.0
    )
    assert not stream_tests(signals)[STICKING].alarms


def test_without_a_rise_it_cannot_run():
    signals = run("alsd_rig", "rig-steps", 3.0)
    still = replace(
        signals,
        signals={
            name: replace(s, value=s.value * 0.0) if name == "armature_voltage" else s
            for name, s in signals.signals.items()
        },
    )
    found = stream_tests(still)[STICKING]
    assert (found.threshold, found.alarms) == (None, [])
    assert found.why == "armature voltage never rose by more than friction may hold"


def test_the_least_turn():
    p = {key: number.value for key, number in load_vehicle("alsd_rig").parameters.items()}
    assert least_turn(p, 0.0, 0.5) == 0.0  # V: less than friction may hold
    assert least_turn(p, -3.0, 4.0) == least_turn(p, 0.0, 4.0) > 0.5  # rad
    assert least_turn(p, 2.0, 4.0) < least_turn(p, 0.0, 4.0) < least_turn(p, 0.0, 5.0)


def test_an_angle_that_turns_has_no_more_noise():
    """Jitter of the stamps times the speed passed for noise where that changes (development)."""
    steady, changing = (
        stream_tests(run("alsd_rig", name, 60.0))["noise:drive_angle"]
        for name in ("rig-slow", "slip-oil-sweep")
    )
    assert steady.enabled > 50.0 and not steady.alarms
    assert changing.enabled > 20.0 and not changing.alarms


def test_more_noise_on_it_is_found():
    signals = run("alsd_rig", "rig-steps", 20.0)
    angle = signals.signals["drive_angle"]
    late, rng = angle.time > 10.0, np.random.default_rng(1)
    rough = angle.value + late * rng.normal(0.0, 1e-4, len(angle.value))
    broken = replace(
        signals, signals={**signals.signals, "drive_angle": replace(angle, value=rough)}
    )
    (alarm,) = stream_tests(broken)["noise:drive_angle"].alarms
    assert 9.5 < alarm.begun < alarm.detected < 13.0


def test_differences_from_one_and_the_same_sample():
    """How often three of them in a row are beyond ``leap`` is what the rate allows."""
    rig = load_vehicle("alsd_rig")
    period, chance = 0.1, 1e-3
    rate = 3.6e6 / period * chance
    test = next(t for t in Implausible.of(rig, rate) if t.subject == "oil_temp")
    test.period = period
    rng, count = np.random.default_rng(3), 1_000_000
    before, next_three = rng.standard_normal(count), rng.standard_normal((3, count))
    most, leaps = test.leap / test.noise, next_three - before
    beyond = ((leaps > most).all(axis=0) | (leaps < -most).all(axis=0)).sum()
    assert abs(beyond - count * chance) < 4.0 * np.sqrt(count * chance)


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "scenario"), [("alsd_rig", "rig-steps"), ("alsd_car", "car")])
def test_a_diagnosis_says_that_the_actuator_sticks(vehicle, scenario):
    diagnosis = clutchest.diagnose(run(vehicle, scenario, 60.0, Jammed(25.0)), vehicle)
    (fault,) = diagnosis.faults
    assert (fault.fault, fault.set, fault.fmi) == (STICKING, (STICKING,), 7)
    assert fault.began_s <= 25.0 < fault.first_detected_s < 45.0
    assert {m.status for m in diagnosis.monitors if m.name == "motor_friction"} == {"passed"}


@pytest.mark.slow
def test_one_that_never_moved_may_be_on_another_bench():
    diagnosis = clutchest.diagnose(run("alsd_rig", "rig-steps", 20.0, Jammed(0.0)), "alsd_rig")
    (fault,) = diagnosis.faults
    assert fault.set == (STICKING, "contradiction:motor_angle")
    assert "motor angle by 0 rad; or the motor's rotor is held" in fault.what


@pytest.mark.slow
def test_an_encoder_that_drifts():
    diagnosis = clutchest.diagnose(run("alsd_rig", "rig-steps", 60.0, Drifting(12.0)), "alsd_rig")
    (fault,) = diagnosis.faults
    assert fault.set == ("drift:motor_angle",)
    assert fault.causes[0].size == pytest.approx(12.0, abs=3.0 * fault.causes[0].std)
