"""Compiled pieces for the times of text logs that other tools wrote: numbers, dates, clocks."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np

from clutchest.can.text_scan import Bytes, Ints, compiled, decimal

DAY_NS = 86_400_000_000_000
_HOUR_NS = 3_600_000_000_000
_MOST = 900_000_000_000_000_000  # of digits; one more fits into 64 bits


@compiled
def number_ns(text: Bytes, i: int, unit_ns: int, comma: bool) -> tuple[int, int]:
    """(ns, position behind) of a decimal number in ``unit_ns``, a power of ten, rounded to 1 ns;
    ``1e-05`` and a decimal ``comma`` too."""
    first = i + 1 if text[i] == 45 or text[i] == 43 else i  # - +
    value, power, k = 0, 0, first
    while 48 <= text[k] <= 57:
        if value > _MOST:
            return 0, i
        value, k = value * 10 + (text[k] - 48), k + 1
    if k == first:
        return 0, i
    if text[k] == 46 or (comma and text[k] == 44):
        k += 1
        while 48 <= text[k] <= 57:
            if value <= _MOST:
                value, power = value * 10 + (text[k] - 48), power - 1
            k += 1
    if (text[k] | 32) == 101:  # e
        sign = text[k + 1] == 45 or text[k + 1] == 43
        exponent, behind = decimal(text, k + 1 + sign)
        if behind > k + 1 + sign:
            power += min(exponent, 99) if text[k + 1] != 45 else -min(exponent, 99)
            k = behind
    while unit_ns > 1:
        unit_ns, power = unit_ns // 10, power + 1
    while power > 0 and value > 0:
        if value > _MOST:
            return 0, i
        value, power = value * 10, power - 1
    dropped = 0
    while power < 0 and value > 0:
        value, dropped, power = value // 10, value % 10, power + 1
    value += dropped >= 5
    return (-value if text[i] == 45 else value), k


@compiled
def clock_ns(text: Bytes, i: int, comma: bool) -> tuple[int, int]:
    """(ns since midnight, position behind) of ``10:13:20.5``, with a decimal ``comma`` too."""
    hour, k = decimal(text, i)
    if k == i or hour > 23 or text[k] != 58:  # :
        return 0, i
    minute, end = decimal(text, k + 1)
    if end != k + 3 or minute > 59 or text[end] != 58:
        return 0, i
    ns, behind = number_ns(text, end + 1, 1_000_000_000, comma)
    if behind == end + 1 or not 0 <= ns < 61_000_000_000:
        return 0, i
    return (hour * 60 + minute) * 60_000_000_000 + ns, behind


@compiled
def date_ns(text: Bytes, i: int, comma: bool) -> tuple[int, int]:
    """(ns since 1970, position behind) of ``2023-11-20T10:13:20.5+01:00`` or
    ``20.11.2023 10:13:20``; without a zone taken as UTC."""
    # Each separator is checked before what stands behind it: a newline may end the text.
    year, at = decimal(text, i)
    day_first = at - i <= 2
    mark = text[at]
    if at == i or (mark != 45 and mark != 46 and mark != 47):  # - . /
        return 0, i
    month, end = decimal(text, at + 1)
    if end == at + 1 or end > at + 3 or text[end] != mark or (mark == 45 and end != at + 3):
        return 0, i
    day, at = decimal(text, end + 1)
    if mark == 45 and at != end + 3:
        return 0, i
    if day_first:
        year, day = day, year
    if (day_first and mark != 46) or not 1970 <= year <= 2190:  # 1/2/2023 may be either
        return 0, i
    if not (1 <= month <= 12 and 1 <= day <= 31) or (text[at] != 32 and (text[at] | 32) != 116):
        return 0, i
    ns, behind = clock_ns(text, at + 1, comma)  # behind a blank or a T
    if behind == at + 1:
        return 0, i
    # Days of the civil calendar, its years from March on.
    year -= month <= 2
    age = year // 400
    within = year - age * 400
    of_year = (153 * (month - 3 if month > 2 else month + 9) + 2) // 5 + day - 1
    days = age * 146_097 + within * 365 + within // 4 - within // 100 + of_year - 719_468
    ns += days * 86_400_000_000_000
    if (text[behind] | 32) == 122:  # z
        return ns, behind + 1
    if text[behind] == 43 or text[behind] == 45:
        hours, at = decimal(text, behind + 1)
        minutes = 0
        if at == behind + 5:
            hours, minutes = hours // 100, hours % 100
        elif at == behind + 3 and text[at] == 58:
            minutes, at = decimal(text, at + 1)
        elif at != behind + 3:
            return ns, behind
        offset = (hours * 60 + minutes) * 60_000_000_000
        return ns + (offset if text[behind] == 45 else -offset), at
    return ns, behind


def from_local(t_ns: Ints) -> Ints:
    """ns since 1970 of times by the clock of this machine, given as if they were UTC."""
    hours, which = np.unique(t_ns // _HOUR_NS, return_inverse=True)
    local = (datetime(1970, 1, 1) + timedelta(hours=int(hour)) for hour in hours)
    begins = np.array([round(hour.timestamp()) for hour in local], np.int64) * 10**9
    return begins[which] + t_ns % _HOUR_NS


def local_date_ns(text: bytes) -> int | None:
    """ns since 1970 of a date by the clock of this machine; None where none can be read."""
    ns, behind = date_ns(np.frombuffer(text.strip() + b"\n", np.uint8), 0, True)
    return int(from_local(np.array([ns]))[0]) if behind else None


def past_midnight(t_ns: Ints, last: int) -> Ints:
    """Times of day that go on behind midnight; ``last`` is the one before them, 0 if none is."""
    if not len(t_ns):
        return t_ns
    steps = np.diff(t_ns, prepend=last % DAY_NS if last else t_ns[0])
    return t_ns + (np.cumsum(steps < -DAY_NS // 2) + last // DAY_NS) * DAY_NS
