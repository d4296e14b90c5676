"""Delays that vary: samples are put back to when they were true, whatever pieces they come in."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.estimate.delay_equalisation import Clocks, evenly_late
from clutchest.estimate.whole_log import delays
from clutchest.signals import Signal

EFFECT = """
from clutchest.models.effects import Effect, Lateness, Number

class Lazy(Effect):
    name, model, equation = "lazy", "dry_clutch", "timing:engine_torque"
    parameters = (Number("size", "1", 0.0, 2.0),)
    delays = {"engine_torque": "size"}
    lateness = {"engine_torque": Lateness("engine_speed", (60.0, 130.0), (0.2, -0.02))}
"""


def late(speed):
    return 1.5 * np.interp(speed, (60.0, 130.0), (0.2, -0.02))


@pytest.fixture(scope="module")
def truck(tmp_path_factory):
    path: Path = tmp_path_factory.mktemp("lazy") / "lazy.py"
    path.write_text(EFFECT)
    truck = clutchest.load_vehicle("truck")
    return replace(truck, effects={"lazy": {"size": 1.5}}, effects_files=(path,))


@pytest.fixture(scope="module")
def signals():
    return clutchest.simulate("truck", "city", 5, duration=300.0)


def test_every_sample_goes_back_to_when_it_was_true(truck, signals):
    torque, speed = signals["engine_torque"], signals["engine_speed"]
    last = np.searchsorted(speed.time, torque.time, side="right") - 1
    known = last >= 0
    true = torque.time[known] - late(speed.value[last[known]])
    even = evenly_late(signals, truck)["engine_torque"]
    time = even.time - delays(truck)["engine_torque"]
    told = np.maximum.accumulate(np.concatenate([[-np.inf], true[:-1]]))
    assert np.isin(np.round(true[true > told], 9), np.round(time, 9)).all()
    assert np.all(np.diff(time) > 0)
    assert len(time) > 0.95 * len(torque)


def test_pieces_are_put_off_as_the_whole_is(truck, signals):
    whole = evenly_late(signals, truck)["engine_torque"]
    clocks, rng = Clocks(truck), np.random.default_rng(1)
    edges = [0.0, *np.sort(rng.uniform(0.0, signals.end, 60)), np.inf]
    parts = []
    for a, b in pairwise(edges):
        new = {n: s.take(slice(*np.searchsorted(s.time, (a, b)))) for n, s in signals.items()}
        parts.append(clocks.take(new)["engine_torque"])
    assert np.array_equal(Signal.joined(parts).time, whole.time)
    assert np.array_equal(Signal.joined(parts).value, whole.value)


@pytest.mark.slow
def test_what_is_late_by_turns_is_estimated_as_what_is_punctual(truck, signals):
    torque, speed = signals["engine_torque"], signals["engine_speed"]
    behind = np.interp(
        torque.time - late(np.interp(torque.time, speed.time, speed.value)),
        torque.time,
        torque.value,
    )
    lazy = replace(
        signals, signals={**signals.signals, "engine_torque": replace(torque, value=behind)}
    )

    def likely(drive, vehicle):
        return clutchest.replay(drive, vehicle).tracks[0].log_likelihood

    nominal = clutchest.load_vehicle("truck")
    lost = likely(signals, nominal) - likely(lazy, nominal)
    left = likely(signals, nominal) - likely(lazy, truck)
    assert lost > 100.0
    assert left < 0.1 * lost


def test_of_two_delays_of_one_signal_an_absent_one_changes_nothing(truck, signals, tmp_path):
    """One of them absent: as if it were not there."""
    more = EFFECT.replace("Lazy", "Other").replace('"lazy"', '"other"')
    (tmp_path / "more.py").write_text(EFFECT + more.split("\n\n", 1)[1])
    files = (tmp_path / "more.py",)
    alone = evenly_late(signals, truck)["engine_torque"]
    for size, other in ((1.5, 0.0), (0.0, 1.5)):
        both = replace(
            truck, effects={"lazy": {"size": size}, "other": {"size": other}}, effects_files=files
        )
        found = evenly_late(signals, both)["engine_torque"]
        assert delays(both) == delays(truck)
        np.testing.assert_array_equal(found.time, alone.time)
        np.testing.assert_array_equal(found.value, alone.value)
