"""What comes after a gap in which the clutch may have slipped is a drive of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.discovery.discover import discover
from clutchest.discovery.segmentation import SHORTEST, segmented
from clutchest.signals import Floats, Signals

TRUCK = clutchest.load_vehicle("truck")


def drive(
    seed: int, duration: float, effects: clutchest.simulated.Effects | None = None
) -> Signals:
    return clutchest.simulate(TRUCK, "launches", seed, effects, duration=duration)


def with_gap(signals: Signals, begin: float, end: float, only: str | None = None) -> Signals:
    """Without the samples between two times, of every signal or ``only`` of one."""
    kept = {}
    for name, signal in signals.items():
        lost = (signal.time > begin) & (signal.time < end) & (only in (None, name))
        kept[name] = signal.take(~lost)
    return replace(signals, signals=kept)


def slips(signals: Signals) -> Floats:
    """When the clutch slips, s."""
    assert signals.truth is not None
    return signals.truth.time[signals.truth.columns["mode"] == "slipping"]


@pytest.fixture(scope="module")
def launches() -> Signals:
    return drive(5, 200.0)


def test_a_drive_without_gaps_stays_as_it_is(launches):
    [same] = segmented(launches, TRUCK).drives
    assert all(same[name] is launches[name] for name in launches)


@pytest.mark.parametrize("lost", [None, "slave_position", "engine_speed"])
def test_a_gap_in_a_slip_parts_a_drive(launches, lost):
    middle = float(np.median(slips(launches)[slips(launches) > 20.0]))
    begin = float(slips(launches)[np.argmin(np.abs(slips(launches) - middle))])
    one, other = segmented(with_gap(launches, begin, begin + 0.8, lost), TRUCK).drives
    for name in launches:
        before, after = one[name].time[-1], other[name].time[0]
        assert before < begin + 0.1
        assert after >= begin + 0.8 - 0.1, name
        assert len(one[name]) + len(other[name]) <= len(launches[name]) + 1


def test_a_signal_that_holds_its_value_is_known_from_the_start_of_a_piece(launches):
    coolant = launches["coolant_temp"]
    rare = replace(launches.signals["coolant_temp"].take(slice(0, 1)))
    signals = replace(launches, signals={**launches.signals, "coolant_temp": rare})
    _, other = segmented(with_gap(signals, 60.0, 65.0), TRUCK).drives
    assert other["coolant_temp"].value.tolist() == coolant.value[:1].tolist()
    assert other["coolant_temp"].time[0] == pytest.approx(65.0, abs=0.2)


def test_a_short_gap_while_the_clutch_is_locked_is_none(launches):
    times = slips(launches)
    quiet = float(times[np.argmax(np.diff(times))] + 3.0)
    assert not np.any((times > quiet - 2.0) & (times < quiet + 3.0))
    assert len(segmented(with_gap(launches, quiet, quiet + 1.0), TRUCK).drives) == 1
    assert len(segmented(with_gap(launches, quiet, quiet + 2.0), TRUCK).drives) == 2


def test_too_short_a_piece_is_left_out(launches):
    signals = with_gap(with_gap(launches, 60.0, 65.0), 65.0 + SHORTEST / 2.0, 80.0)
    one, other = segmented(signals, TRUCK).drives
    assert one.end <= 60.0 and other["engine_speed"].time[0] >= 80.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6, 7])
def test_a_gap_in_a_slip_is_no_cause(seed):
    """With the drive taken for one, something was found in every such log."""
    signals = drive(seed, 300.0)
    begin = float(np.median(slips(signals)))
    answer = discover(with_gap(signals, begin - 1.0, begin + 1.5), TRUCK)
    assert answer.verdict == "none"
    assert any("1 gap " in words for words in answer.warnings)


@pytest.mark.slow
def test_a_cause_is_found_around_a_gap():
    signals = drive(8, 400.0, {"friction_speed": {"slope": -0.15}})
    begin = float(np.median(slips(signals)))
    answer = discover(with_gap(signals, begin - 1.0, begin + 1.5), TRUCK)
    assert answer.verdict == "named"
    [cause] = answer.causes
    assert cause.effect == "friction_speed"
    slope = cause.parameters["slope"]
    assert abs(slope.value + 0.15) < 3.0 * slope.std
