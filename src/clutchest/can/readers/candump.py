"""candump logs: the compact layout of ``candump -l`` and the console layout, as columns.

Compact: ``(1436509052.249713) can0 18FEF100#FF00``, CAN FD ``ID##<flags>DATA``, remote ``ID#R8``,
error frames with bit 29 of the id set, an ``R`` or ``T`` for the direction behind.
Console: ``(000.005580)  can0  18E0FF00   [8]  00 FF …``, ``remote request``, ``ERRORFRAME``.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from clutchest.can.frames import Flag, Frames
from clutchest.can.readers import counts_from_epoch

# What a line turned out to be; all but the first two are reasons to reject it.
_FRAME, _BLANK, _OTHER, _TIME, _ID, _DATA, _CUT = range(7)
_REASONS = {
    _OTHER: "no candump line",
    _TIME: "time stamp cannot be read",
    _ID: "id is not 3 or 8 hexadecimal digits",
    _DATA: "payload is not hexadecimal or too long",
    _CUT: "payload is shorter than its stated length",
}
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
_T, _CHANNEL, _CAN_ID, _FLAGS, _LENGTH = range(5)  # columns of the table that is filled

_EXTENDED, _REMOTE, _ERROR = int(Flag.EXTENDED), int(Flag.REMOTE), int(Flag.ERROR)
_FD, _BRS, _ESI = int(Flag.FD), int(Flag.BITRATE_SWITCH), int(Flag.ERROR_STATE)
_SENT = int(Flag.SENT)

_HEX = np.full(256, -1, np.int64)  # value of a hexadecimal digit
for _value, _chars in enumerate(zip("0123456789abcdef", "0123456789ABCDEF", strict=True)):
    _HEX[[ord(char) for char in _chars]] = _value


def read(content: bytes) -> Frames:
    """Frames of a candump log; lines that cannot be read are counted in ``rejected``."""
    text = np.frombuffer(content, np.uint8)
    lines = content.count(b"\n") + 1
    for width in (8, 64):
        rows, data = np.zeros((lines, 5), np.int64), np.zeros((lines, width), np.uint8)
        counts = np.zeros(len(_REASONS) + 2, np.int64)
        n = _parse(text, rows, data, counts)
        if n >= 0:
            break
    rejected = tuple((reason, int(counts[code])) for code, reason in _REASONS.items()
                     if counts[code])  # fmt: skip
    t_ns = rows[:n, _T].copy()
    return Frames(t_ns, rows[:n, _CHANNEL].astype(np.uint8), rows[:n, _CAN_ID].astype(np.uint32),
                  rows[:n, _FLAGS].astype(np.uint8), rows[:n, _LENGTH].astype(np.uint8), data[:n],
                  counts_from_epoch(t_ns), rejected)  # fmt: skip


@njit(cache=True)
def _blanks(text: Bytes, i: int, end: int) -> int:
    """First position from ``i`` on that is no blank."""
    while i < end and (text[i] == 32 or text[i] == 9):
        i += 1
    return i


@njit(cache=True)
def _parse(text: Bytes, rows: Ints, data: Bytes, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than ``data``."""
    n = start = int(np.int64(0))  # a literal 0 would have all of this compiled twice
    size = len(text)
    while start < size:
        end = start
        while end < size and text[end] != 10:
            end += 1
        stop = end
        while stop > start and text[stop - 1] <= 32:
            stop -= 1
        kind = _line(text, _blanks(text, start, stop), stop, n, rows, data)
        if kind < 0:
            return -1
        counts[kind] += 1
        if kind == _FRAME:
            n += 1
        else:
            for byte in range(data.shape[1]):  # what a broken line left there
                data[n, byte] = 0
        start = end + 1
    return n


@njit(cache=True)
def _line(text: Bytes, i: int, end: int, n: int, rows: Ints, data: Bytes) -> int:
    """Reads one line into row ``n``; what it was, or -1 if ``data`` is too narrow."""
    if i == end:
        return _BLANK
    if text[i] != 40:  # (
        return _OTHER
    i += 1
    first, seconds = i, np.int64(0)
    while i < end and 48 <= text[i] <= 57:
        seconds = seconds * 10 + (text[i] - 48)
        i += 1
    if i in (first, end) or i - first > 10 or text[i] != 46:
        return _TIME
    i += 1
    first, fraction, scale = i, np.int64(0), np.int64(1_000_000_000)
    while i < end and 48 <= text[i] <= 57 and i - first < 9:
        fraction = fraction * 10 + (text[i] - 48)
        scale //= 10
        i += 1
    if i in (first, end) or text[i] != 41:  # )
        return _TIME
    rows[n, _T] = seconds * 1_000_000_000 + fraction * scale
    i = _blanks(text, i + 1, end)

    # The channel is the number at the end of the interface's name.
    number = 0
    while i < end and text[i] > 32:
        number = number * 10 + (text[i] - 48) if 48 <= text[i] <= 57 else 0
        i += 1
    rows[n, _CHANNEL] = number & 0xFF
    i = _blanks(text, i, end)
    flag = 0
    if i + 1 < end and (text[i + 1] == 88 or text[i + 1] == 120):  # console with RX or TX - -
        if text[i] == 84:
            flag |= _SENT
        i = _blanks(text, i + 2, end)
        while i < end and (text[i] == 45 or ((text[i] == 66 or text[i] == 69)
                                             and i + 1 < end and text[i + 1] == 32)):  # fmt: skip
            if text[i] == 66:
                flag |= _BRS
            elif text[i] == 69:
                flag |= _ESI
            i = _blanks(text, i + 1, end)

    first, value = i, np.int64(0)
    while i < end and _HEX[text[i]] >= 0:
        value = value * 16 + _HEX[text[i]]
        i += 1
    digits = i - first
    if (digits != 3 and digits != 8) or i == end:
        return _ID
    if digits == 8:
        if value & 0x20000000:
            flag |= _ERROR
        else:
            flag |= _EXTENDED
    elif value > 0x7FF:
        return _ID
    rows[n, _CAN_ID] = value & 0x1FFFFFFF
    if text[i] == 35:  # compact: #
        return _compact(text, i + 1, end, n, flag, rows, data)
    if text[i] > 32:
        return _ID
    return _console(text, _blanks(text, i, end), end, n, flag, rows, data)


@njit(cache=True)
def _compact(text: Bytes, i: int, end: int, n: int, flag: int, rows: Ints, data: Bytes) -> int:
    widest = 8
    if i < end and text[i] == 35:  # ##
        if i + 1 >= end or _HEX[text[i + 1]] < 0:
            return _DATA
        bits = _HEX[text[i + 1]]
        flag |= _FD | (_BRS if bits & 1 else 0) | (_ESI if bits & 2 else 0)
        widest = 64
        i += 2
    count = 0
    if i < end and (text[i] == 82 or text[i] == 114) and widest == 8:  # R
        flag |= _REMOTE
        i += 1
        if i < end and 48 <= text[i] <= 56:
            count = text[i] - 48
            i += 1
    else:
        while i < end and text[i] > 32 and text[i] != 95:
            high = _HEX[text[i]]
            low = _HEX[text[i + 1]] if i + 1 < end else -1
            if high < 0 or low < 0 or count == widest:
                return _DATA
            if count == data.shape[1]:
                return -1
            data[n, count] = high * 16 + low
            count += 1
            i += 2
        if i + 1 < end and text[i] == 95 and _HEX[text[i + 1]] > 8:
            i += 2  # _9 … _F: a raw length code above 8
    i = _blanks(text, i, end)
    if i < end:  # the direction
        if i + 1 != end or (text[i] != 82 and text[i] != 84):
            return _DATA
        if text[i] == 84:
            flag |= _SENT
    rows[n, _FLAGS], rows[n, _LENGTH] = flag, count
    return _FRAME


@njit(cache=True)
def _console(text: Bytes, i: int, end: int, n: int, flag: int, rows: Ints, data: Bytes) -> int:
    if i + 2 >= end or text[i] != 91:  # [
        return _ID
    i += 1
    first, stated = i, 0
    while i < end and 48 <= text[i] <= 57 and i - first < 2:
        stated = stated * 10 + (text[i] - 48)
        i += 1
    if i in (first, end) or text[i] != 93:  # ]
        return _DATA
    is_fd = i - first == 2  # classic frames have one digit here
    if stated > (64 if is_fd else 8):
        return _DATA
    if is_fd:
        flag |= _FD
    i = _blanks(text, i + 1, end)
    if i < end and text[i] == 114:  # remote request
        flag |= _REMOTE
    else:
        if stated > data.shape[1]:
            return -1
        for byte in range(stated):
            high = _HEX[text[i]] if i < end else -2
            low = _HEX[text[i + 1]] if i + 1 < end else -2
            if high == -2 or low == -2:
                return _CUT
            if high < 0 or low < 0 or (i + 2 < end and text[i + 2] > 32):
                return _DATA
            data[n, byte] = high * 16 + low
            i = _blanks(text, i + 2, end)
    rows[n, _FLAGS], rows[n, _LENGTH] = flag, stated
    return _FRAME
