"""Faults on a live bus: events that come and go, and codes told to the bus if asked."""

import mangled
import numpy as np
import pytest

import clutchest
from clutchest.can.dm1 import read_payload
from clutchest.diagnosis import watch
from clutchest.diagnosis.codes import number_of
from clutchest.diagnosis.streams import part
from clutchest.monitor import faults
from clutchest.monitor.faults import Faults
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.simulated import simulate_frames


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


def driven(truck, frames, watcher, clock):
    """Feeds the watcher a tenth of a second at a time; gives its events."""
    signals, found = signals_of(frames, truck, load_database(truck)), []
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    for k in range(round(signals.end / 0.1)):
        begin, end = k / 10, (k + 1) / 10
        clock.append(end)
        new = frames.take((time >= begin) & (time < end))
        arrived = part(signals, begin, end).signals
        found += list(watcher.watch(arrived, new, int(frames.t_ns[0]), end))
    return found


def test_a_fault_is_an_event_and_a_code_on_the_bus(truck, monkeypatch):
    frames, _ = simulate_frames(truck, "city", 5, duration=40.0)
    broken = mangled.without(frames, mangled.ETC1, 10.0, 20.0)
    sent, clock = [], [0.0]
    monkeypatch.setattr(faults.time, "monotonic", lambda: clock[-1])
    watcher = Faults(truck, load_database(truck), lambda f: sent.append((clock[-1], f)))
    events = driven(truck, broken, watcher, clock)
    assert [(e.kind, e.name, e.data["failed"]) for e in events] == [
        ("fault", "missing:ETC1", True),
        ("fault", "missing:ETC1", False),
    ]
    assert 10.0 < events[0].time < 10.6
    codes = [(t, read_payload(bytes(f.data[0]))) for t, f in sent]
    told = [(c.spn, c.fmi) for _, found in codes for c in found]
    assert set(told) == {number_of("missing:ETC1", truck)}
    with_code = np.array([t for t, found in codes if found])
    assert 9 <= len(with_code) <= 11 and 10.3 < with_code[0] < 11.0
    assert np.diff(with_code) == pytest.approx(1.0, abs=0.15)
    assert codes[-1][1] == [] and 20.0 < codes[-1][0] < 20.6
    watcher.close()


def test_nothing_is_sent_unasked_and_health_has_no_event(truck):
    frames, _ = simulate_frames(truck, "city", 5, duration=20.0)
    assert not driven(truck, frames, Faults(truck, load_database(truck)), [])


def test_a_new_drive_begins_anew(truck):
    frames, _ = simulate_frames(truck, "city", 5, duration=20.0)
    watcher = Faults(truck, load_database(truck))
    broken = mangled.without(frames, mangled.ETC1, 10.0, np.inf)
    assert len(driven(truck, broken, watcher, [])) == 1
    later, _ = simulate_frames(truck, "city", 6, duration=20.0)
    assert not driven(truck, later, watcher, [])


def test_the_last_word_is_an_event(truck, monkeypatch):
    """What had not been judged yet, and what the equations show of the whole drive."""
    frames, _ = simulate_frames(truck, "city", 5, duration=20.0)
    said = {
        "fault": "torque_bias",
        "first_detected_s": 12.0,
        "set": ["torque_bias"],
        "causes": [{"size": 40.0}],
    }
    monkeypatch.setattr(watch, "looked_at", lambda *_: watch.Look([said], 1.0))
    watcher = Faults(truck, load_database(truck), None)
    assert not driven(truck, frames, watcher, [])
    (event,) = watcher.finish(20.0)
    assert (event.kind, event.name, event.time) == ("fault", "torque_bias", 12.0)
    assert event.data["failed"] and event.data["size"] == 40.0
    assert not list(watcher.finish(20.0)), "once"
