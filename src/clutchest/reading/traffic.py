"""What frames themselves tell, whatever they carry: when they come, and whether they are whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchest.can.database import Message
from clutchest.can.decode import extract, rows_of
from clutchest.can.encode import check, contents, counter_of
from clutchest.can.frames import Frames
from clutchest.signals import Traffic
from clutchest.vehicle import Vehicle


def traffic_of(
    frames: Frames, messages: Sequence[Message], vehicle: Vehicle, start_ns: int | None = None
) -> dict[str, Traffic]:
    """The traffic of every message, from the sender that the vehicle file asks for, else from the
    one with most frames; t = 0 at ``start_ns``, the first frame unless given."""
    first = int(frames.t_ns[0]) if start_ns is None and len(frames) else start_ns or 0
    return {message.name: _traffic(frames, message, vehicle, first) for message in messages}


def _traffic(frames: Frames, message: Message, vehicle: Vehicle, first: int) -> Traffic:
    rows = _of_one_sender(frames, rows_of(frames, message), message, vehicle)
    same, step = np.zeros(len(rows), bool), np.full(len(rows), -1, np.int16)
    turns, counter = 0, counter_of(message)
    checked = message.name in vehicle.checked
    if len(rows):
        data = frames.data[rows] & contents(message, frames.data.shape[1])
        same[1:] = np.all(data[1:] == data[:-1], axis=1)
    if counter is not None:
        layout, turns = counter
        count = extract(frames.data[rows], layout).astype(np.int64)
        step[1:] = np.diff(count) % turns
    return Traffic(
        time=(frames.t_ns[rows] - first) / 1e9,
        same=same,
        step=step,
        turns=turns,
        sound=check(frames, rows, message).checksum,
        period=_period(message, vehicle),
        checked=checked,
    )


def _of_one_sender(
    frames: Frames, rows: NDArray[np.intp], message: Message, vehicle: Vehicle
) -> NDArray[np.intp]:
    address = np.uint32(0xFF) if message.is_j1939 else np.uint32(0)
    sender = frames.channel[rows].astype(np.uint32) << np.uint32(8) | frames.id[rows] & address
    for signal in vehicle.signals.values():
        if signal.bus.message != message.name:
            continue
        keep = np.ones(len(rows), bool)
        if signal.channel is not None:
            keep &= frames.channel[rows] == signal.channel
        if signal.source_address is not None and message.is_j1939:
            keep &= (sender & 0xFF) == signal.source_address
        rows, sender = rows[keep], sender[keep]
    if not len(rows):
        return rows
    return rows[sender == np.argmax(np.bincount(sender))]


def _period(message: Message, vehicle: Vehicle) -> float | None:
    for signal in vehicle.signals.values():
        if signal.bus.message == message.name and signal.period:
            return signal.period
    return message.cycle_time_s
