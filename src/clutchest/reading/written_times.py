"""Times that are texts in a table: dates, times of day, minutes and seconds."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.signals import Floats

if TYPE_CHECKING:
    import pandas as pd

_DAY_S, _HOUR_S = 86_400.0, 3_600.0
_SLASHES = r"^\s*(\d\d?)/(\d\d?)/\d{4}\b"
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p", "%H:%M")
_DATES = ("%d.%m.%Y", "%d.%m.%y", "%d-%b-%Y")
_MINUTES = re.compile(r"\s*(\d{1,2}):(\d\d\.\d+)\s*")  # as Excel shows times
_MOST_DAYS_FIRST = 12  # months


def written_times(cells: pd.Series, source: str) -> Floats | None:
    """Seconds since 1970, midnight or the hour of texts (n); None where they are no times.

    Raises ClutchestError for dates of which the day may be the month; ``source`` names the table.
    """
    import pandas as pd

    written = cells.astype(str).fillna("").str.replace(",", ".", regex=False)
    seconds = np.full(len(written), np.nan)
    for style in ("ISO8601", *_styles(written, source)):
        if not (left := np.isnan(seconds)).any():
            break
        # the rest in the next style: a clock may leave out fractions of zero
        dates = pd.to_datetime(written[left], errors="coerce", utc=True, format=style)
        since = dates.dt.tz_localize(None) - pd.Timestamp(0)
        seconds[left] = (since / pd.Timedelta(seconds=1)).to_numpy(np.float64)
    if np.isfinite(seconds).any():
        return seconds
    found = [_MINUTES.fullmatch(text) for text in written]
    if any(found):
        minutes = [60.0 * float(m[1]) + float(m[2]) if m else np.nan for m in found]
        return _begun_anew(np.array(minutes), _HOUR_S)
    clock = pd.to_timedelta(written, errors="coerce") / pd.Timedelta(seconds=1)
    return _begun_anew(np.array(clock, np.float64), _DAY_S) if clock.notna().any() else None


def _styles(written: pd.Series, source: str) -> list[str]:
    """How the dates may be written; those with slashes by what is no month in any of them."""
    days = list(_DATES)
    parts = written.str.extract(_SLASHES).dropna()
    if len(parts):
        first, second = (int(parts[k].astype(int).max()) for k in (0, 1))
        if (first > _MOST_DAYS_FIRST) == (second > _MOST_DAYS_FIRST):
            raise ClutchestError(
                f"{source}: the time {written[parts.index[0]]!r} may begin with day or month; "
                "expected dates such as 2024-02-29 23:59:59.5 or 29.02.2024 23:59:59.5"
            )
        days = ["%d/%m/%Y" if first > _MOST_DAYS_FIRST else "%m/%d/%Y"]
    return [f"{day} {clock}" for day in days for clock in _CLOCKS]


def _begun_anew(clock: Floats, period_s: float) -> Floats:
    """Times, s, of a clock that begins anew after ``period_s``, going on."""
    known = np.flatnonzero(np.isfinite(clock))
    back = np.diff(clock[known], prepend=clock[known[0]]) < -period_s / 2
    clock[known] += period_s * np.cumsum(back)
    return clock
