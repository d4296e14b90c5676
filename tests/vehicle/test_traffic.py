"""The traffic of one message: times, repetitions, counter and checksum, frame by frame."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.can.frames import Frames
from clutchest.reading import traffic
from clutchest.reading.traffic import TrafficStream, traffic_of

N = 40


@pytest.fixture
def frames(send) -> Frames:
    """Positions that change with every second frame; three frames lost, one checksum wrong."""
    position = np.repeat(np.linspace(38.0, 50.0, N // 2), 2)
    whole = send("ClutchActuator", period=0.02, source=3, SlavePosition=position, MotorPosition=1.0)
    whole.data[20, 0] ^= 0x10
    return whole.take(np.delete(np.arange(N), [10, 31, 32]))


def test_times_repetitions_counter_and_checksum(frames, bus, truck):
    message = bus.message("ClutchActuator")
    result = traffic_of(frames, message, truck)
    rows = np.delete(np.arange(N), [10, 31, 32])
    np.testing.assert_allclose(result.time, rows * 0.02, atol=1e-12)
    assert result.turns == 16
    assert result.step.tolist() == [-1, *np.diff(rows).tolist()]  # past 15 too
    assert rows[~result.sound].tolist() == [20]
    repeated = (np.diff(rows // 2) == 0) & ~np.isin(rows[1:], [20, 21])
    assert result.same.tolist() == [False, *repeated.tolist()]
    assert result.checked and result.period == message.cycle_time_s


def test_batches_are_the_whole(frames, bus, truck, monkeypatch):
    message = bus.message("ClutchActuator")
    whole = traffic_of(frames, message, truck)
    monkeypatch.setattr(traffic, "_PORTION", 7)
    stream, start = TrafficStream([message], truck), int(frames.t_ns[0])
    parts = [
        stream.take(frames.take(slice(a, b)), start)[message.name]
        for a, b in ((0, 1), (1, 12), (12, 12), (12, 37))
    ]
    for name in ("time", "same", "step", "sound"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    assert len(whole) == len(frames)


def test_a_message_without_counter_and_checksum(send, bus, truck):
    frames = send("ET1", period=1.0, EngineCoolantTemperature=np.array([80.0, 80.0, 81.0]))
    result = traffic_of(frames, bus.message("ET1"), truck)
    assert result.turns == 0 and result.step.tolist() == [-1, -1, -1]
    assert result.sound.all() and result.same.tolist() == [False, True, False]
    assert not result.checked
