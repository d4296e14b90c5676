"""Encoding: columns of numbers into frames of one message; decoding walked backwards.

Signals whose name ends in ``Counter`` count the frames of a call, 0, 1, … up to their largest
value and round again; one that ends in ``Checksum`` is computed:

    s = sum of all payload bytes, the bits of the checksum itself taken as 0,
        + the four bytes of the 29-bit or 11-bit id as on the bus
    checksum = (s + (s >> w) + (s >> 2w) + …) mod 2^w           w = width of the signal

the pattern of SAE J1939's own message checksums (payload, counter and id summed, then folded).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clutchest.can import j1939
from clutchest.can.database import Message, SignalLayout
from clutchest.can.decode import Rows, extract, scaled
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Check:
    """Per frame, shape (n,): ``checksum`` is right; ``counter`` is one more than in the frame
    before from the same sender.  All true where the message has no such signal."""

    checksum: Bools
    counter: Bools

    @property
    def jumps(self) -> int:
        """How often the counter did not go on by one: frames lost, repeated or frozen."""
        return int(np.count_nonzero(~self.counter))


def encode(
    message: Message,
    values: Mapping[str, ArrayLike],
    t_ns: ArrayLike,
    source_address: int = 0x00,
    channel: int = 0,
) -> Frames:
    """One frame per time stamp ``t_ns`` (n,), holding ``values`` (n,) each in bus units.

    Values saturate at the DBC's range and at what the bits hold.  NaN becomes the J1939 code "not
    available"; signals not given become that code too, or 0 where the message is not J1939, but a
    counter counts and a checksum is right.  ``source_address`` is used with J1939 only.

    Raises ClutchestError for an unknown signal, a value that is NaN and has no code for it, and a
    multiplexed signal without its multiplexer.
    """
    t_ns = np.asarray(t_ns, np.int64)
    n = len(t_ns)
    can_id = j1939.with_source(message.id, source_address) if message.is_j1939 else message.id
    flags = Flag.EXTENDED if message.extended else Flag(0)
    if message.length > 8:
        flags |= Flag.FD
    data = np.full((n, max(8, message.length)), 0xFF if message.is_j1939 else 0, np.uint8)
    data[:, message.length :] = 0

    columns = {
        name: np.broadcast_to(np.asarray(column, np.float64), n) for name, column in values.items()
    }
    for name in columns:
        selector = message.signal(name).multiplexer
        if selector and selector not in columns:
            raise ClutchestError(
                f"signal '{name}' of message '{message.name}' needs its "
                f"multiplexer '{selector}' too"
            )
    for name in values:
        layout = message.signal(name)
        for branch in (layout, *layout.branches):
            active = _active(message, branch, columns)
            raw = _raw(message, branch, columns[name][active])
            data[active] = _insert(data[active], branch, raw)
    for layout in message.signals.values():
        if layout.name.endswith("Counter") and layout.name not in values:
            counts = np.arange(n, dtype=np.uint64) % np.uint64(_counter_size(layout))
            data = _insert(data, layout, counts)
    ids = np.full(n, can_id, np.uint32)
    for layout in _checksums(message):
        if layout.name not in values:
            data = _insert(data, layout, _checksum(data, ids, layout))
    return Frames(
        t_ns,
        np.full(n, channel, np.uint8),
        ids,
        np.full(n, flags, np.uint8),
        np.full(n, message.length, np.uint8),
        data,
    )


def rewritten(frames: Frames, rows: Rows, message: Message, name: str, values: ArrayLike) -> Frames:
    """``frames`` with one signal of ``message`` in ``rows`` (n,) at ``values`` (n,), bus units.

    All other bits stay, checksums too.  Values saturate as :func:`encode` has it.
    """
    layout = message.signal(name)
    raw = _raw(message, layout, np.broadcast_to(np.asarray(values, np.float64), len(rows)))
    data = frames.data.copy()
    data[rows] = _insert(data[rows], layout, raw)
    return replace(frames, data=data)


def check(frames: Frames, rows: Rows, message: Message) -> Check:
    """Whether checksum and counter of ``message`` are right in the frames of ``rows`` (n,).

    The checksum is the one that :func:`encode` writes; a maker's own messages have another.
    """
    data, ids = frames.data[rows], frames.id[rows]
    checksum, counter = np.ones(len(rows), bool), np.ones(len(rows), bool)
    for layout in _checksums(message):
        checksum &= extract(data, layout) == _checksum(data, ids, layout)
    senders = ids.astype(np.uint64) << np.uint64(8) | frames.channel[rows].astype(np.uint64)
    alone = len(rows) > 0 and bool(np.all(senders == senders[0]))
    order = np.arange(len(rows)) if alone else np.argsort(senders, kind="stable")
    follows = np.diff(senders[order]) == 0
    for layout in message.signals.values():
        if layout.name.endswith("Counter"):
            count = extract(data, layout)[order].astype(np.int64)
            steps = np.diff(count) % _counter_size(layout)
            counter[order[1:]] &= (steps == 1) | ~follows
    return Check(checksum, counter)


def counter_of(message: Message) -> tuple[SignalLayout, int] | None:
    """The counter of a message and how many values it runs through; None where it has none."""
    for name, layout in message.signals.items():
        if name.endswith("Counter"):
            return layout, _counter_size(layout)
    return None


def contents(message: Message, width: int) -> NDArray[np.uint8]:
    """Mask (width) of the payload's bits that are neither counter nor checksum."""
    mask = np.full((1, max(width, message.length)), 0xFF, np.uint8)
    for name, layout in message.signals.items():
        if name.endswith(("Counter", "Checksum")):
            mask = _insert(mask, layout, np.zeros(1, np.uint64))
    return mask[0, :width]


def _active(message: Message, layout: SignalLayout, columns: Mapping[str, NDArray]) -> Bools:
    """Rows in which the multiplexers switch this signal on."""
    if layout.multiplexer is None:
        return np.ones(len(next(iter(columns.values()))), bool)
    selected = np.isin(columns[layout.multiplexer], sorted(layout.multiplexer_ids))
    return selected & _active(message, message.signal(layout.multiplexer), columns)


def _raw(message: Message, layout: SignalLayout, values: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Bit patterns (n,) of the nearest values that the signal can hold."""
    missing = np.isnan(values)
    if missing.any() and not layout.coded:
        raise ClutchestError(
            f"signal '{layout.name}' of message '{message.name}' has no code for "
            f"'not available', but value {np.argmax(missing)} is NaN"
        )
    low, high = layout.minimum, layout.maximum
    if low is not None and high is not None and low < high:  # [0|0] means that there is no range
        values = np.clip(values, low, high)
    values = np.where(missing, 0.0, values)
    if layout.is_float:
        numbers = ((values - layout.offset) / layout.scale).astype(f"f{layout.width // 8}")
        return numbers.view(f"u{layout.width // 8}").astype(np.uint64)
    steps = np.rint((values - layout.offset) / layout.scale)
    if layout.signed:
        half = 2.0 ** (layout.width - 1)
        steps = _clip(steps, -half, half - 1)
        return steps.astype(np.int64).view(np.uint64)
    largest = _largest(layout)
    raw = _clip(steps, 0.0, float(largest)).astype(np.uint64)
    raw[missing] = (1 << layout.width) - 1
    return raw


def _clip(steps: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    # 2^63 - 1 and 2^64 - 1 are no float64: the one below is.
    return np.clip(steps, low, np.nextafter(high, 0) if high > 2**53 else high)


def _largest(layout: SignalLayout) -> int:
    """The largest raw value of an unsigned signal that is a value."""
    if layout.coded:
        return min(j1939.code_limits(layout.width, layout.spn)) - 1
    return (1 << layout.width) - 1


def _counter_size(layout: SignalLayout) -> int:
    """How many values a counter runs through."""
    if layout.maximum and scaled(np.array([1], np.uint64), layout)[0] == 1:
        return min(int(layout.maximum), (1 << layout.width) - 1) + 1
    return 1 << layout.width


def _insert(
    data: NDArray[np.uint8], layout: SignalLayout, raw: NDArray[np.uint64]
) -> NDArray[np.uint8]:
    """The payloads (n, width) with the bits of ``layout`` replaced by those of ``raw`` (n,)."""
    data = data.copy()
    first, last = layout.first_bit // 8, layout.last_byte
    below = (
        layout.first_bit % 8
        if layout.little_endian
        else 8 * (last + 1) - layout.first_bit - layout.width
    )
    full = (1 << layout.width) - 1
    raw = raw & np.uint64(full)
    for byte in range(first, last + 1):
        shift = 8 * (byte - first if layout.little_endian else last - byte) - below
        if shift >= 0:
            mask, bits = full >> shift & 0xFF, raw >> np.uint64(shift)
        else:
            mask, bits = full << -shift & 0xFF, raw << np.uint64(-shift)
        data[:, byte] &= np.uint8(~mask & 0xFF)
        data[:, byte] |= (bits & np.uint64(0xFF)).astype(np.uint8) & np.uint8(mask)
    return data


def _checksums(message: Message) -> list[SignalLayout]:
    return [layout for name, layout in message.signals.items() if name.endswith("Checksum")]


def _checksum(
    data: NDArray[np.uint8], ids: NDArray[np.uint32], layout: SignalLayout
) -> NDArray[np.uint64]:
    """The right checksums (n,) for payloads (n, width) and ids (n,); see the module's docstring."""
    cleared = _insert(data, layout, np.zeros(len(data), np.uint64))
    total = cleared.sum(axis=1, dtype=np.uint64)
    for shift in (0, 8, 16, 24):
        total += (ids >> np.uint32(shift) & np.uint32(0xFF)).astype(np.uint64)
    folded = np.zeros_like(total)
    for shift in range(0, 16, layout.width):
        folded += total >> np.uint64(shift)
    return folded & np.uint64((1 << layout.width) - 1)
