"""A drive watched while it lasts is judged as its log is afterwards."""

from concurrent.futures import Future

import mangled
import numpy as np
import pytest

import clutchest
from clutchest.can.dm1 import payload as dm1
from clutchest.can.dm1 import read_payload
from clutchest.can.files import write_frames
from clutchest.diagnosis.codes import number_of
from clutchest.diagnosis.streams import Streams, part
from clutchest.diagnosis.watch import FaultWatch, Look
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.simulated import simulate_frames


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


def watched(truck, frames, step, **options):
    database = load_database(truck)
    signals = signals_of(frames, truck, database)
    watch, changes = FaultWatch(truck, database, **options), []
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    for begin in np.arange(0.0, signals.end, step):
        end = begin + step
        new = frames.take((time >= begin) & (time < end))
        changes += watch.take(part(signals, begin, end).signals, new, int(frames.t_ns[0]), end)
    return watch, changes, signals


def test_faults_come_and_go_as_the_log_has_them(truck):
    frames, _ = simulate_frames(truck, "city", 5, duration=60.0)
    broken = mangled.without(frames, mangled.ETC1, 20.0, 30.0)
    broken = mangled.resummed(mangled.held(broken, mangled.ACTUATOR, 40.0, np.inf, slice(4, 5)))
    watch, changes, signals = watched(truck, broken, 0.5, share=None)
    told = [(c.fault, c.failed) for c in changes]
    assert told == [
        ("missing:ETC1", True),
        ("missing:ETC1", False),
        ("counter:ClutchActuator", True),
    ]
    whole = Streams(truck)
    whole.take(signals, signals.end)
    once = {t.name: t.alarms[0] for t in whole.tests if t.alarms}
    for change in changes:
        if change.failed:
            assert change.time == pytest.approx(once[change.fault].detected, abs=0.06)
    codes = read_payload(dm1(watch.codes))
    assert [(c.spn, c.fmi) for c in codes] == [number_of("counter:ClutchActuator", truck)]


def test_looks_are_as_many_as_a_share_of_a_processor_allows(truck, monkeypatch):
    """Each takes longer than the one before, a rest is a good time for one, and none is in vain."""
    asked = []

    class Process:
        def __init__(self, *_):
            pass

        def submit(self, work, vehicle, drive, start_ns):
            asked.append(watch._now)
            answer = Future()
            answer.set_result(Look([], drive.end / 60.0))  # a second of work for a minute's drive
            return answer

        def shutdown(self, **_):
            pass

    monkeypatch.setattr("clutchest.diagnosis.watch.ProcessPoolExecutor", Process)
    database = load_database(truck)
    watch = FaultWatch(truck, database, share=0.1)
    frames, _ = simulate_frames(truck, "city", 5, duration=2.0)
    one = frames.take(np.array([0]))
    for now in range(10, 1000, 10):
        one.t_ns[:] = now * 1_000_000_000
        watch.take({}, one, 0, float(now))
    assert asked[:3] == [60.0, 70.0, 90.0]  # 10 s of driving for each second of work
    assert asked[-1] < 1000 < asked[-1] * (1 + 10 / 60) + 20
    looks = len(asked)
    for now in range(1000, 1200, 10):  # parked
        watch.take({}, one.take(np.zeros(0, np.intp)), 0, float(now))
    assert asked[looks:] == [1010.0]
    assert not watch.finish() and len(asked) == looks + 1, "all has been looked at"


@pytest.mark.slow
def test_what_the_equations_show_is_told_in_the_end(truck, tmp_path):
    frames, _ = simulate_frames(truck, "city", 51, {"torque_bias": {"bias": 70.0}}, duration=400.0)
    write_frames(frames, tmp_path / "received.log")
    watch, changes, signals = watched(
        truck, frames, 10.0, share=None, log=tmp_path / "received.log"
    )
    assert not changes
    found = watch.finish()
    assert [c.fault for c in found] == ["torque_bias"]
    after = clutchest.diagnose(clutchest.replay(signals, truck))
    assert found[0].time == after.faults[0].first_detected_s
    assert [(c.spn, c.fmi) for c in watch.codes] == [(after.faults[0].spn, after.faults[0].fmi)]
