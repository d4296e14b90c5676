"""Decoding: whole columns of one message at a time, the same numbers as cantools gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.can import j1939
from clutchest.can.database import Message, SignalLayout
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError
from clutchest.native import compiled
from clutchest.signals import Why

Rows = NDArray[np.intp]
_KIND = int(Flag.EXTENDED | Flag.REMOTE | Flag.ERROR)


@dataclass(frozen=True, slots=True)
class DecodedColumn:
    """The samples of one signal, shape (n,) each.

    ``rows``: the rows of the log that carry the signal — those asked for, less those where a
    multiplexer selects another; the samples' times are ``frames.t_ns[column.rows]``.
    ``value`` in the bus unit, NaN where ``why`` (codes of :class:`Why`) is not VALID; ``raw``
    int64 for signed signals, else uint64 (of a float its bit pattern).
    """

    rows: Rows
    value: NDArray[np.float64]
    raw: NDArray[np.int64] | NDArray[np.uint64]
    why: NDArray[np.uint8]


def rows_of(frames: Frames, message: Message, channel: int | None = None) -> Rows:
    """Rows of the data frames that are ``message``, shape (n,).

    The id must be the same; with J1939 only its parameter group: priority, source and, where there
    is one, destination do not matter.  Those on its own channel, or on this one, where either is
    stated.
    """
    if channel is not None and not message.on(channel):
        return np.zeros(0, np.intp)
    channel = message.channel if channel is None else channel
    kind = Flag.EXTENDED if message.extended else 0
    return _matching(
        frames.id,
        frames.flags,
        frames.channel,
        message.id_mask,
        message.id & message.id_mask,
        int(kind),
        -1 if channel is None else channel,
    )


@compiled
def _matching(ids, flags, channels, mask, wanted, kind, channel):  # type: ignore[no-untyped-def]
    rows = np.empty(len(ids), np.intp)
    n = 0
    for i in range(len(ids)):
        same = (ids[i] & mask) == wanted and (flags[i] & _KIND) == kind
        rows[n] = i
        n += same and (channel < 0 or channels[i] == channel)
    return rows[:n].copy()


def decode(
    frames: Frames, rows: Rows, message: Message, signal_names: Sequence[str]
) -> dict[str, DecodedColumn]:
    """The named signals of ``message`` from the given ``rows``, by name.

    Frames longer than the message are read up to the DBC's length; in shorter ones every signal
    that does not lie wholly inside is TOO_SHORT.  Raises ClutchestError for an unknown signal.
    """
    length = frames.length[rows]
    return {
        name: _column(rows, frames.data, length, message, message.signal(name))
        for name in signal_names
    }


def _column(
    rows: Rows,
    data: NDArray[np.uint8],
    length: NDArray[np.unsignedinteger],
    message: Message,
    layout: SignalLayout,
) -> DecodedColumn:
    if layout.branches:
        parts = [
            _column(rows, data, length, message, replace(branch, branches=()))
            for branch in (layout, *layout.branches)
        ]
        return _joined(parts)
    if layout.width > 64:
        raise ClutchestError(
            f"signal '{layout.name}' of message '{message.name}' has "
            f"{layout.width} bits; at most 64 can be a number"
        )
    short = length <= layout.last_byte
    if layout.multiplexer:
        selector = message.signal(layout.multiplexer)
        switch = _column(rows, data, length, message, selector)
        unread = switch.why == Why.TOO_SHORT
        selected = np.trunc(scaled(switch.raw, selector))
        keep = np.isin(selected, np.array(sorted(layout.multiplexer_ids), np.float64)) | unread
        inside = np.searchsorted(rows, switch.rows[keep])
        rows, short = rows[inside], short[inside] | unread[keep]
    raw = _raw(data, rows, layout)
    value = scaled(raw, layout)
    why = (
        j1939.why_of(raw, layout.width, layout.spn)
        if layout.coded
        else np.zeros(len(rows), np.uint8)
    )
    why[short] = Why.TOO_SHORT
    if layout.is_float:
        why[(why == Why.VALID) & ~np.isfinite(value)] = Why.OUT_OF_RANGE
    value[why != Why.VALID] = np.nan
    return DecodedColumn(rows, value, raw, why)


def _joined(parts: Sequence[DecodedColumn]) -> DecodedColumn:
    """The samples of one signal from the branches of a multiplexer, in the order of the log."""
    rows, raw = np.concatenate([p.rows for p in parts]), [p.raw for p in parts]
    order = np.argsort(rows, kind="stable")
    same = len({bits.dtype for bits in raw}) == 1
    return DecodedColumn(
        rows[order],
        np.concatenate([p.value for p in parts])[order],
        np.concatenate(raw if same else [bits.view(np.int64) for bits in raw])[order],
        np.concatenate([p.why for p in parts])[order],
    )


def extract(data: NDArray[np.uint8], layout: SignalLayout) -> NDArray:
    """Raw values (n,) from payloads (n, width): int64 if signed, else uint64."""
    return _raw(data, np.arange(len(data)), layout)


def _raw(data: NDArray[np.uint8], rows: Rows, layout: SignalLayout) -> NDArray:
    """Raw values (n,) from the payloads in ``rows`` (n,)."""
    first, last = layout.first_bit // 8, layout.last_byte
    # Bits of the first byte before the signal; big endian: bits of the last byte behind it.
    below = (
        layout.first_bit % 8
        if layout.little_endian
        else 8 * (last + 1) - layout.first_bit - layout.width
    )
    raw = np.empty(len(rows), np.uint64)
    signed = layout.signed and not layout.is_float
    _gather(data, rows, first, last, below, layout.little_endian, layout.width, signed, raw)
    return raw.view(np.int64) if signed else raw


@compiled
def _gather(data, rows, first, last, below, little, width, signed, raw):  # type: ignore[no-untyped-def]
    """The bits of a signal in each of ``rows``, bytes beyond the payload's width read as 0."""
    unused, end = np.uint64(64 - width), min(last, data.shape[1] - 1)
    for k in range(len(rows)):
        row, value = rows[k], np.uint64(0)
        for byte in range(first, end + 1):
            shift = 8 * (byte - first if little else last - byte) - below
            bits = np.uint64(data[row, byte])
            if shift >= 0:
                value |= bits << np.uint64(shift)
            else:
                value |= bits >> np.uint64(-shift)
        value = value << unused
        raw[k] = np.uint64(np.int64(value) >> np.int64(unused)) if signed else value >> unused


def scaled(raw: NDArray, layout: SignalLayout) -> NDArray[np.float64]:
    """raw · scale + offset with the rounding of cantools: integers exactly, else in float64."""
    scale, offset = layout.scale, layout.offset
    if layout.is_float:
        numbers = raw.astype(f"u{layout.width // 8}").view(f"f{layout.width // 8}")
        with np.errstate(invalid="ignore", over="ignore"):  # any bit pattern is possible
            return numbers.astype(np.float64) * scale + offset
    if scale == 1 and offset == 0:
        return raw.astype(np.float64)
    if float(scale).is_integer() and float(offset).is_integer():
        scale, offset = int(scale), int(offset)
    if not isinstance(scale, int):
        return raw.astype(np.float64) * scale + offset
    if layout.width + scale.bit_length() > 62 or abs(offset) > 2**62:
        raw = raw.astype(object)  # exact at any size; such signals are rare
    else:
        raw = raw.astype(np.int64)
    return (raw * scale + offset).astype(np.float64)
