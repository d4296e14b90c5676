"""A drive is tested live as its log is tested afterwards."""

import mangled
import numpy as np
import pytest

import clutchest
from clutchest.can.dm1 import payload as dm1
from clutchest.can.dm1 import read_payload
from clutchest.can.files import write_frames
from clutchest.diagnosis.codes import number_of
from clutchest.diagnosis.streams import StreamTests, between
from clutchest.monitor.live_fault_tests import EquationFaults, LiveFaultTests
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.simulated import simulate_frames


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


def fed(truck, frames, step, **options):
    database = load_database(truck)
    signals = signals_of(frames, truck, database)
    live, changes = LiveFaultTests(truck, database, **options), []
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    for begin in np.arange(0.0, signals.end, step):
        end = begin + step
        new = frames.take((time >= begin) & (time < end))
        changes += live.take(between(signals, begin, end).signals, new, int(frames.t_ns[0]), end)
    return live, changes, signals


def test_faults_begin_and_end_as_in_the_log(truck):
    frames, _ = simulate_frames(truck, "city", 5, duration=60.0)
    broken = mangled.without(frames, mangled.ETC1, 20.0, 30.0)
    broken = mangled.resummed(mangled.held(broken, mangled.ACTUATOR, 40.0, np.inf, slice(4, 5)))
    live, changes, signals = fed(truck, broken, 0.5, share=None)
    reported = [(c.fault, c.failed) for c in changes]
    assert reported == [
        ("missing:ETC1", True),
        ("missing:ETC1", False),
        ("counter:ClutchActuator", True),
    ]
    whole = StreamTests(truck)
    whole.take(signals, signals.end)
    once = {t.name: t.alarms[0] for t in whole.tests if t.alarms}
    for change in changes:
        if change.failed:
            assert change.time == pytest.approx(once[change.fault].detected, abs=0.06)
    codes = read_payload(dm1(live.codes))
    assert [(c.spn, c.fmi) for c in codes] == [number_of("counter:ClutchActuator", truck)]


def test_analyses_take_no_more_than_their_share_of_a_processor(truck, monkeypatch):
    """Each takes longer than the one before; a silent bus brings one forward; each has new data."""
    analysed = []

    class Process:
        cost = None

        def __init__(self, what):
            pass

        def submit(self, work, vehicle, drive, start_ns):
            analysed.append(live._now)
            self.cost = drive.end / 60.0  # 1 s of work per minute

        @property
        def done(self):
            return self.cost is not None

        def result(self):
            cost, self.cost = self.cost, None
            return EquationFaults([], cost)

        def close(self):
            pass

    monkeypatch.setattr("clutchest.monitor.live_fault_tests.Worker", Process)
    database = load_database(truck)
    live = LiveFaultTests(truck, database, share=0.1)
    frames, _ = simulate_frames(truck, "city", 5, duration=2.0)
    one = frames.take(np.array([0]))
    for now in range(10, 1000, 10):
        one.t_ns[:] = now * 1_000_000_000
        live.take({}, one, 0, float(now))
    assert analysed[:3] == [60.0, 70.0, 90.0]  # 10 s of driving for each second of work
    assert analysed[-1] < 1000 < analysed[-1] * (1 + 10 / 60) + 20
    count = len(analysed)
    for now in range(1000, 1200, 10):  # parked
        live.take({}, one.take(np.zeros(0, np.intp)), 0, float(now))
    assert analysed[count:] == [1010.0]
    assert not live.finish() and len(analysed) == count + 1, "everything has been analysed"


@pytest.mark.slow
def test_faults_of_the_equations_are_reported_at_the_end(truck, tmp_path):
    frames, _ = simulate_frames(truck, "city", 51, {"torque_bias": {"bias": 70.0}}, duration=400.0)
    write_frames(frames, tmp_path / "received.log")
    live, changes, signals = fed(truck, frames, 10.0, share=None, log=tmp_path / "received.log")
    assert not changes
    last = live.finish()
    assert [c.fault for c in last] == ["torque_bias"]
    after = clutchest.diagnose(clutchest.replay(signals, truck))
    assert last[0].time == after.faults[0].first_detected_s
    assert [(c.spn, c.fmi) for c in live.codes] == [(after.faults[0].spn, after.faults[0].fmi)]
