"""Faults on a live bus: events when they begin and end, and codes on the bus if wanted."""

import mangled
import numpy as np
import pytest

import clutchest
from clutchest.can.dm1 import read_payload
from clutchest.diagnosis.codes import number_of
from clutchest.diagnosis.streams import between
from clutchest.monitor import faults, live_fault_tests
from clutchest.monitor.faults import FaultWatcher
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.simulated import simulate_frames


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


def driven(truck, frames, watcher, clock):
    """Feeds the watcher a tenth of a second at a time; returns its events."""
    signals, events = signals_of(frames, truck, load_database(truck)), []
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    for k in range(round(signals.end / 0.1)):
        begin, end = k / 10, (k + 1) / 10
        clock.append(end)
        new = frames.take((time >= begin) & (time < end))
        received = between(signals, begin, end).signals
        events += list(watcher.watch(received, new, int(frames.t_ns[0]), end))
    return events


def test_a_fault_is_an_event_and_a_code_on_the_bus(truck, monkeypatch):
    frames, _ = simulate_frames(truck, "city", 5, duration=40.0)
    broken = mangled.without(frames, mangled.ETC1, 10.0, 20.0)
    sent, clock = [], [0.0]
    monkeypatch.setattr(faults.time, "monotonic", lambda: clock[-1])
    watcher = FaultWatcher(truck, load_database(truck), lambda f: sent.append((clock[-1], f)))
    events = driven(truck, broken, watcher, clock)
    assert [(e.kind, e.name, e.data["failed"]) for e in events] == [
        ("fault", "missing:ETC1", True),
        ("fault", "missing:ETC1", False),
    ]
    assert 10.0 < events[0].time < 10.6
    codes = [(t, read_payload(bytes(f.data[0]))) for t, f in sent]
    sent_codes = [(c.spn, c.fmi) for _, active in codes for c in active]
    assert set(sent_codes) == {number_of("missing:ETC1", truck)}
    with_code = np.array([t for t, active in codes if active])
    assert 9 <= len(with_code) <= 11 and 10.3 < with_code[0] < 11.0
    assert np.diff(with_code) == pytest.approx(1.0, abs=0.15)
    assert codes[-1][1] == [] and 20.0 < codes[-1][0] < 20.6
    watcher.close()


def test_nothing_is_sent_unasked_and_health_has_no_event(truck):
    frames, _ = simulate_frames(truck, "city", 5, duration=20.0)
    assert not driven(truck, frames, FaultWatcher(truck, load_database(truck)), [])


def test_a_new_drive_begins_anew(truck):
    frames, _ = simulate_frames(truck, "city", 5, duration=20.0)
    watcher = FaultWatcher(truck, load_database(truck))
    broken = mangled.without(frames, mangled.ETC1, 10.0, np.inf)
    assert len(driven(truck, broken, watcher, [])) == 1
    later, _ = simulate_frames(truck, "city", 6, duration=20.0)
    assert not driven(truck, later, watcher, [])


def test_the_final_result_is_an_event(truck, monkeypatch):
    """Data not yet tested, and the equations' tests of the whole drive."""
    frames, _ = simulate_frames(truck, "city", 5, duration=20.0)
    reported = {
        "fault": "torque_bias",
        "first_detected_s": 12.0,
        "set": ["torque_bias"],
        "causes": [{"size": 40.0}],
    }
    result = live_fault_tests.EquationFaults([reported], 1.0)
    monkeypatch.setattr(live_fault_tests, "equation_faults", lambda *_: result)
    watcher = FaultWatcher(truck, load_database(truck), None)
    assert not driven(truck, frames, watcher, [])
    (event,) = watcher.finish(20.0)
    assert (event.kind, event.name, event.time) == ("fault", "torque_bias", 12.0)
    assert event.data["failed"] and event.data["size"] == 40.0
    assert not list(watcher.finish(20.0)), "once"
