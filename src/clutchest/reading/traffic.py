"""Timing and integrity of a message's frames: times, repetitions, counters, checksums."""

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

_PORTION = 100_000  # frames that are processed together


def traffic_of(frames: Frames, message: Message, vehicle: Vehicle) -> Traffic:
    """The traffic of a message in ``frames`` (sorted), from the sender that the vehicle file asks
    for, else from the one with most frames; t = 0 at the first frame."""
    first = int(frames.t_ns[0]) if len(frames) else 0
    return TrafficStream([message], vehicle).take(frames, first)[message.name]


class TrafficStream:
    """The same of a drive in progress, batch after batch of its frames.

    The sender is chosen in the first batch that contains a message.
    """

    def __init__(self, messages: Sequence[Message], vehicle: Vehicle) -> None:
        self.messages, self.vehicle = messages, vehicle
        self._sender: dict[str, int] = {}
        self._last: dict[str, Frames] = {}

    def take(self, frames: Frames, start_ns: int) -> dict[str, Traffic]:
        """What ``frames`` (sorted) add; t = 0 at ``start_ns``."""
        return {message.name: self._of(frames, message, start_ns) for message in self.messages}

    def _of(self, frames: Frames, message: Message, start_ns: int) -> Traffic:
        own = frames.take(self._rows(frames, message))
        before = self._last.get(message.name)
        known = 0 if before is None else 1
        both = own if before is None else Frames.concatenate([before, own])
        if len(own):
            self._last[message.name] = own.take(np.array([-1]))
        parts = [
            _traffic(
                both.take(slice(max(first - 1, 0), first + _PORTION)),
                message,
                self.vehicle,
                start_ns,
            ).take(slice(int(first > 0), None))
            for first in range(0, max(len(both), 1), _PORTION)
        ]
        whole = Traffic.joined(parts)
        return whole.take(slice(known, None))

    def _rows(self, frames: Frames, message: Message) -> NDArray[np.intp]:
        rows = rows_of(frames, message)
        address = np.uint32(0xFF) if message.is_j1939 else np.uint32(0)
        sender = frames.channel[rows].astype(np.uint32) << np.uint32(8) | frames.id[rows] & address
        keep = np.ones(len(rows), bool)
        for signal in self.vehicle.signals.values():
            if signal.bus.message != message.name:
                continue
            if signal.channel is not None:
                keep &= frames.channel[rows] == signal.channel
            if signal.source_address is not None and message.is_j1939:
                keep &= (sender & 0xFF) == signal.source_address
        if not keep.any():
            return rows[keep]
        chosen = self._sender.setdefault(message.name, int(np.argmax(np.bincount(sender[keep]))))
        return rows[keep & (sender == chosen)]


def _traffic(frames: Frames, message: Message, vehicle: Vehicle, start_ns: int) -> Traffic:
    """Of ``frames`` that are all of one message and sender."""
    rows = np.arange(len(frames))
    same, step = np.zeros(len(rows), bool), np.full(len(rows), -1, np.int16)
    turns, counter = 0, counter_of(message)
    if len(rows):
        data = frames.data & contents(message, frames.data.shape[1])
        same[1:] = np.all(data[1:] == data[:-1], axis=1)
    if counter is not None:
        layout, turns = counter
        count = extract(frames.data, layout).astype(np.int64)
        step[1:] = np.diff(count) % turns
    return Traffic(
        time=(frames.t_ns - start_ns) / 1e9,
        same=same,
        step=step,
        turns=turns,
        sound=check(frames, rows, message).checksum,
        period=_period(message, vehicle),
        checked=message.name in vehicle.checked,
        channel=int(frames.channel[0]) if len(frames) else None,
    )


def _period(message: Message, vehicle: Vehicle) -> float | None:
    for signal in vehicle.signals.values():
        if signal.bus.message == message.name and signal.period:
            return signal.period
    return message.cycle_time_s
