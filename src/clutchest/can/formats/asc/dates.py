"""Dates in the header of an asc log, as Vector's tools write them, and in numbers.

``Mon Nov 20 10:13:20.250 am 2023``, in English or German; ``2023-11-20T10:13:20.250``, with or
without a zone; ``20.11.2023 10:13:20``; with slashes where day and month cannot be mistaken.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone

from clutchest.can.time_stamps import LAST_S

_CLOCK = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{1,2}):(?P<second>\d{1,2})(?:[.,](?P<part>\d+))?"
    r"\s*(?P<half>am|pm)?"
)
_DAY = r"(?:[^\W\d]+\.?,?\s+)?"  # of the week
_FORMS = [
    re.compile(form, re.IGNORECASE)
    for form in (
        rf"\w+\.?\s+(?P<month>\w+)\.?\s+(?P<day>\d+)\s+{_CLOCK}\s+(?P<year>\d{{4}})",
        rf"{_DAY}(?P<year>\d{{4}})(?P<mark>[-/.])(?P<month>\d{{1,2}})(?P=mark)(?P<day>\d{{1,2}})"
        rf"(?:T|[\s,]+){_CLOCK}\s*(?P<zone>Z\b|UTC|GMT|[+-]\d\d:?\d\d)?",
        rf"{_DAY}(?P<day>\d{{1,2}})(?P<mark>[./])(?P<month>\d{{1,2}})(?P=mark)(?P<year>\d{{4}})"
        rf"[\s,]+{_CLOCK}",
    )
]
# English, and what Vector's tools write in German
_MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan",
            "feb",
            "mar mär mrz",
            "apr",
            "may mai",
            "jun",
            "jul",
            "aug",
            "sep",
            "oct okt",
            "nov",
            "dec dez",
        ),
        1,
    )
    for name in names.split()
}


@dataclass(frozen=True, slots=True)
class Date:
    """A date: ``epoch_ns`` since 1970, and since midnight, ns."""

    epoch_ns: int
    since_midnight_ns: int


def date_of(words: str) -> Date | None:
    """The date that ``words`` begin with, without a zone by the clock of this machine; None if
    there is no such day, or there may be two."""
    matches = (form.match(words) for form in _FORMS)
    match = next((each for each in matches if each), None)
    if match is None:
        return None
    given = match.groupdict()
    day, month = int(given["day"]), _month(given["month"])
    if given.get("mark") == "/" and match.re is _FORMS[-1]:
        if (day > 12) == (month > 12):
            return None
        day, month = max(day, month), min(day, month)
    hour, minute, second = _hour(given), int(given["minute"]), int(given["second"])
    part = int((given["part"] or "0")[:9].ljust(9, "0"))
    try:
        when = datetime(int(given["year"]), month, day, hour, minute, second)
        if zone := given.get("zone"):
            when = when.replace(tzinfo=_zone(zone))
        whole = when.timestamp()
    except (ValueError, OverflowError, OSError):
        return None
    if not 0 <= whole < LAST_S:
        return None
    midnight_s = 3600 * hour + 60 * minute + second
    return Date(round(whole) * 10**9 + part, midnight_s * 10**9 + part)


def _month(words: str) -> int:
    return int(words) if words.isdecimal() else _MONTHS.get(words.lower()[:3], 0)


def _hour(given: dict[str, str]) -> int:
    hour = int(given["hour"])
    if given["half"] and hour <= 12:
        hour = hour % 12 + 12 * (given["half"].lower() == "pm")
    return hour


def _zone(words: str) -> timezone:
    digits = re.sub(r"\D", "", words)
    minutes = 60 * int(digits[:2]) + int(digits[2:]) if digits else 0
    return timezone(timedelta(minutes=-minutes if words.startswith("-") else minutes))
