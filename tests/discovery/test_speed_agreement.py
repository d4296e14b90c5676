"""Engine and input shaft turn together while the clutch is locked: a wrong number of teeth and a
late message show there, and nothing else does."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import clutchest
from clutchest.discovery.speed_agreement import disagreement
from clutchest.models import machine_of
from clutchest.signals import Signal, Signals

TRUCK = clutchest.load_vehicle("truck")
NOISE = 0.06  # rad/s


def speeds(ratio=0.0, late=0.0, *, moves=True, locks=True, weak=0.0, seed=1) -> Signals:
    """Two minutes in which engine and shaft turn together for 6 s of every 10, else slip; the shaft
    loses a ``weak`` share of its teeth at 70 rad/s, and ever fewer above."""
    random, time = np.random.default_rng(seed), np.arange(0.0, 120.0, 0.01)

    def shaft(t):
        return 110.0 + (30.0 * np.sin(t / 1.7) + 10.0 * np.sin(t / 0.9) if moves else 0.0 * t)

    phase = time % 10.0
    slip = np.where(phase < 4.0, 60.0 * (1.0 - phase / 4.0), 0.0) if locks else 20.0 + phase
    read = {
        "engine_speed": (1.0 + ratio) * (shaft(time) + slip),
        "input_shaft_speed": shaft(time - late)
        * (1.0 - weak * np.exp((70.0 - shaft(time - late)) / 10.0)),
    }
    return Signals(
        {
            name: Signal.of(name, "rad/s", time, value + NOISE * random.standard_normal(len(time)))
            for name, value in read.items()
        },
        end=120.0,
    )


@pytest.mark.parametrize("seed", range(2))
def test_sensors_that_are_right_agree(seed):
    assert disagreement(speeds(seed=seed), TRUCK) is None


@pytest.mark.parametrize("ratio", [-0.03, 0.0125])
def test_a_wrong_number_of_teeth_is_a_ratio(ratio):
    off = disagreement(speeds(ratio), TRUCK)
    assert off is not None and off.late == 0.0
    assert off.ratio == pytest.approx(ratio, abs=4.0 * off.ratio_std + 1e-5)
    where = off.before(None)
    assert where.equation == "sensor:engine_speed" and where.covariates == ("engine_speed",)
    (words,) = off.words
    assert f"% {'more' if ratio > 0.0 else 'less'} than input_shaft_speed" in words
    assert disagreement(off.corrected(speeds(ratio)), TRUCK) is None
    assert off.stated(TRUCK) is TRUCK


@pytest.mark.parametrize("weak", [0.03, 0.06])
def test_teeth_that_are_lost_at_low_speed_are_no_wrong_number_of_them(weak):
    off = disagreement(speeds(weak=weak), TRUCK)
    assert off is not None and off.over is not None and off.late == 0.0
    assert np.all(np.diff(off.over.ratio) < 0.0) and off.over.at(np.array([148.0])) < 1e-3
    assert 0.2 * weak < off.ratio < 1.1 * weak  # the slowest there is, of which there is little
    where = off.before(None)
    assert where.equation == "sensor:input_shaft_speed"
    assert where.covariates == ("input_shaft_speed",)
    (words,) = off.words
    assert words.startswith("input_shaft_speed reads up to") and "% less than engine_speed" in words
    assert disagreement(speeds(0.0125), TRUCK).over is None


@pytest.mark.parametrize("late", [-0.08, 0.2])
def test_a_late_message_is_a_delay(late):
    signals = speeds(late=late)
    off = disagreement(signals, TRUCK)
    assert off is not None and off.ratio == 0.0
    assert off.late == pytest.approx(late, abs=4.0 * off.late_std + 1e-4)
    assert off.before(None).equation == "timing:input_shaft_speed"
    assert disagreement(off.corrected(signals), TRUCK) is None
    stated = off.stated(TRUCK)
    assert disagreement(signals, stated) is None or late < 0.0  # a file states no negative delay
    assert (stated is TRUCK) == (late < 0.0)


def test_of_both_each_is_told():
    off = disagreement(speeds(0.02, 0.1), TRUCK)
    assert off is not None and off.ratio == pytest.approx(0.02, abs=2e-4)
    assert off.late == pytest.approx(0.1, abs=2e-3)
    first = off.before(None)
    assert [first.equation, *(w.equation for w in first.others)] == [
        "sensor:engine_speed",
        "timing:input_shaft_speed",
    ]


def test_nothing_is_said_where_nothing_can_be():
    assert disagreement(speeds(late=0.2, moves=False), TRUCK) is None  # nothing tells a delay
    assert disagreement(speeds(0.02, locks=False), TRUCK) is None  # never together
    one = speeds(0.02)
    rests = replace(one["input_shaft_speed"], value=0.0 * one["input_shaft_speed"].value)
    assert (
        disagreement(replace(one, signals={**one.signals, "input_shaft_speed": rests}), TRUCK)
        is None
    )
    lost = replace(one, signals={"engine_speed": one["engine_speed"]})
    assert disagreement(lost, TRUCK) is None
    shaft = replace(TRUCK.signals["input_shaft_speed"], gears=(10.0, 5.0), radius=0.5)
    of_wheels = replace(TRUCK, signals={**TRUCK.signals, "input_shaft_speed": shaft})
    assert disagreement(one, of_wheels) is None  # a tyre is worn by as much
    assert len(machine_of("alsd").event.slip) == 1  # nor of one speed


@dataclass(frozen=True)
class LateShaft:
    """The gearbox sends the shaft's speed 0.15 s late."""

    def law(self):
        return lambda seen: {}

    def readings(self, true):
        shaft = true["input_shaft_speed"]
        return {**true, "input_shaft_speed": lambda t: shaft(np.maximum(t - 0.15, 0.0))}


@pytest.mark.slow
def test_a_late_shaft_is_named_and_stated(tmp_path):
    signals = clutchest.simulate(TRUCK, "launches", 11, duration=300.0, outsider=LateShaft())
    found = clutchest.discover(signals, TRUCK)
    assert found.verdict == "unknown" and found.where.equation == "timing:input_shaft_speed"
    assert found.added == ("the delay of input_shaft_speed",)
    assert found.extended.signals["input_shaft_speed"].delay == pytest.approx(0.15, abs=2e-3)
    assert any("150" in words for words in found.warnings)
    again = clutchest.discover(signals, found.extended)
    assert again.verdict == "none"
