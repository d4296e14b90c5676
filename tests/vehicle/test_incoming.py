"""Decoding batch by batch gives the samples of decoding at once."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from clutchest.can.database import Database
from clutchest.can.decode import rows_of
from clutchest.can.frames import Frames
from clutchest.reading.incoming import Decoded, Incoming
from clutchest.reading.mapping import signals_of
from clutchest.signals import Signal
from clutchest.vehicle import BusSignal, Vehicle

GEARS = (12.0, 8.0, 6.0)


@pytest.fixture
def geared(truck: Vehicle) -> Vehicle:
    """A truck whose shaft speed is a wheel speed times the ratio of an inferred gear."""
    shaft = replace(truck.signals["input_shaft_speed"], gears=GEARS)
    return replace(truck, signals={**truck.signals, "input_shaft_speed": shaft})


@pytest.fixture
def drive(send) -> Frames:
    """25 s: engine at 100 Hz, its friction once a second, a wheel speed in two gears and, from 17 s
    on, in none, and two senders of the vehicle speed, of which the second sends more after 5 s."""
    t = np.arange(0.0, 25.0, 0.01)
    wheel = np.clip(8.0 * t, 0.0, 100.0)  # rpm
    engine = np.maximum(600.0, wheel * np.where(t < 15.0, 12.0, 8.0))
    engine[t > 17.0] = 1000.0
    few, many = np.arange(100.0), np.arange(2000.0)
    return Frames.concatenate(
        [
            send(
                "EEC1",
                EngineSpeed=engine,
                ActualEnginePercentTorque=40.0 + np.round(t),
                ActualEnginePercentTorqueFractional=0.125 * (np.arange(len(t)) % 8),
            ),
            send("EEC3", start=0.003, period=1.0, NominalFrictionPercentTorque=np.arange(25.0) / 5),
            send("ETC1", start=0.001, InputShaftSpeed=wheel),
            send(
                "CCVS1",
                source=0x00,
                start=0.004,
                period=0.25,
                WheelBasedVehicleSpeed=36.0 + few / 10,
            ),
            send("CCVS1", source=0x31, start=5.002, WheelBasedVehicleSpeed=72.0 + many / 100),
        ]
    ).sorted()


def joined(parts: list[Decoded]) -> dict[str, Signal]:
    by_name = defaultdict(list)
    for part in parts:
        for name, signal in part.signals.items():
            by_name[name].append(signal)
    return {name: Signal.joined(signals) for name, signals in by_name.items()}


@pytest.mark.parametrize("seed", range(4))
def test_batches_give_the_samples_of_the_whole(
    geared: Vehicle, bus: Database, drive: Frames, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    first = int(rng.integers(800, 1000))  # 3 to 5 s: one sender of the vehicle speed so far
    cuts = np.unique(rng.integers(first + 1, len(drive) - 1, 40))
    bounds = [first, *cuts.tolist(), len(drive)]
    incoming = Incoming(geared, bus, drive.take(slice(0, first)))
    parts = [incoming.first]
    for a, b in pairwise(bounds):
        batch = drive.take(slice(a, b))
        parts.append(incoming.take(batch, int(batch.t_ns[-1]), last=b == len(drive)))
    expected = signals_of(drive, geared, bus)
    together = joined(parts)
    assert set(together) == set(expected)
    for name, signal in expected.items():
        assert np.array_equal(together[name].time, signal.time), name
        assert np.array_equal(together[name].value, signal.value, equal_nan=True), name
    assert not incoming.late


def test_a_chosen_sender_stays_and_a_first_message_is_late(
    truck: Vehicle, bus: Database, drive: Frames, send
) -> None:
    incoming = Incoming(truck, bus, drive.take(slice(0, 900)))
    assert not incoming.late and not incoming.complete  # no position so far
    assert "slave_position" not in incoming.heard_s
    assert incoming.heard_s["engine_speed"] == 0.0
    later = drive.take(slice(900, 4000))
    speed = incoming.take(later, int(later.t_ns[-1])).signals["vehicle_speed"]
    assert (speed.value < 15.0).all(), "36 km/h and more, not the other sender's 72"
    assert not incoming.late
    actuator = send("ClutchActuator", start=20.0, SlavePosition=[40.0] * 9)
    incoming.take(actuator, int(actuator.t_ns[-1]))
    assert incoming.late


def test_a_shaft_speed_is_complete_once_its_gear_is_settled(
    geared: Vehicle, bus: Database, drive: Frames
) -> None:
    until = int(np.searchsorted(drive.t_ns - drive.t_ns[0], 10e9))
    incoming = Incoming(geared, bus, drive.take(slice(0, until)))
    settled = incoming.first.settled
    assert settled["engine_speed"] == pytest.approx(10.0, abs=0.02)
    assert settled["input_shaft_speed"] < 7.0
    shaft = incoming.first.signals["input_shaft_speed"]
    assert shaft.time[-1] <= settled["input_shaft_speed"]


def test_companions_are_kept_from_batch_to_batch(
    truck: Vehicle, bus: Database, drive: Frames
) -> None:
    """Friction is sent once a second: the torque in between needs the last one."""
    assert truck.signals["engine_torque"].friction == BusSignal(
        "EEC3", "NominalFrictionPercentTorque", "%"
    )
    expected = signals_of(drive, truck, bus)["engine_torque"]
    speed = rows_of(drive, bus.message("CCVS1"))
    alone = int(speed[np.searchsorted(speed, 1500)])  # a batch without any part of the torque
    incoming = Incoming(truck, bus, drive.take(slice(0, alone)))
    incoming.take(drive.take(slice(alone, alone + 1)), int(drive.t_ns[alone]))
    after = drive.take(slice(alone + 1, alone + 40))
    assert not len(rows_of(after, bus.message("EEC3")))
    torque = incoming.take(after, int(after.t_ns[-1])).signals["engine_torque"]
    rows = np.searchsorted(expected.time, torque.time)
    assert len(torque) and np.array_equal(torque.value, expected.value[rows])
