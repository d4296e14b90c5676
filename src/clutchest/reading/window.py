"""A time window of a log, by seconds from its start or by the clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.signals import Signal, Signals

Moment = float | datetime


@dataclass(frozen=True, slots=True)
class TimeWindow:
    """From ``start`` up to, but not including, ``stop``: s from each drive's start or a date.

    None is no limit.  A date without a zone is one of this machine's clock.
    """

    start: Moment | None = None
    stop: Moment | None = None

    @classmethod
    def parse(cls, start: str | None, stop: str | None) -> TimeWindow:
        """From what a user writes: ``12.5`` or ``2024-01-18T10:30:00+01:00``.

        Raises ClutchestError for anything else, and for a window that ends before it starts.
        """
        window = cls(_moment(start), _moment(stop))
        a, b = window.start, window.stop
        if a is not None and b is not None and type(a) is type(b) and a >= b:  # type: ignore[operator]
            raise ClutchestError(f"'{start}' to '{stop}': the window ends before it starts")
        return window

    @classmethod
    def of(cls, given: TimeWindow | tuple[Any, Any]) -> TimeWindow:
        """A window as it is, or from a pair of what :meth:`parse` takes, numbers or dates."""
        if isinstance(given, TimeWindow):
            return given
        if not isinstance(given, tuple | list) or len(given) != 2:
            raise ClutchestError(
                f"window {given!r}: expected from where to where, as (60, 300) s, None for no limit"
            )
        start, stop = (None if moment is None else str(moment) for moment in given)
        return cls.parse(start, stop)

    def __bool__(self) -> bool:
        return self.start is not None or self.stop is not None

    def bounds(self, first_ns: int, absolute: bool, sources: str) -> tuple[int, int]:
        """The window in ns on the clock of a drive that starts at ``first_ns``.

        Raises ClutchestError if a date is given where the clock has none.
        """
        low, high = np.iinfo(np.int64).min, np.iinfo(np.int64).max
        for moment in (self.start, self.stop):
            if isinstance(moment, datetime) and not absolute:
                raise ClutchestError(
                    f"{sources}: its clock only counts from its own start; give "
                    "seconds from there, not a date"
                )
        start = low if self.start is None else _ns(self.start, first_ns)
        stop = high if self.stop is None else _ns(self.stop, first_ns)
        return start, stop

    def of_frames(self, frames: Frames, sources: tuple[str, ...]) -> Frames:
        """The frames (sorted, not empty) inside; ``passed_over`` counts the others."""
        if not self:
            return frames
        bounds = self.bounds(int(frames.t_ns[0]), frames.absolute, " ".join(sources))
        first, last = np.searchsorted(frames.t_ns, bounds)
        kept = frames.take(slice(first, last))
        outside = ("outside the time window", len(frames) - len(kept))
        return replace(kept, passed_over=(*frames.passed_over, outside))

    def of_signals(self, signals: Signals) -> Signals | None:
        """The samples inside, t = 0 at the start of the window; None if there are none."""
        if not self:
            return signals
        first_ns, absolute = signals.start_ns or 0, signals.start_ns is not None
        low, high = self.bounds(first_ns, absolute, " ".join(signals.sources))
        low, high = max(low, first_ns), min(high, first_ns + int(signals.end * 1e9) + 1)
        start, stop = (low - first_ns) / 1e9, (high - first_ns) / 1e9
        inside = {name: _between(signal, start, stop) for name, signal in signals.items()}
        if not any(len(signal) for signal in inside.values()):
            return None
        return replace(
            signals, signals=inside, start_ns=low if absolute else None, end=stop - start
        )


EVERYTHING = TimeWindow()


def _moment(text: str | None) -> Moment | None:
    if text is None:
        return None
    try:
        seconds = float(text)
    except ValueError:
        pass
    else:
        if not 0 <= seconds < 1e9:
            raise ClutchestError(
                f"'{text}'; expected seconds from the start of a log, from 0 to 1e9"
            )
        return seconds
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise ClutchestError(
            f"'{text}' is no time; expected seconds from the log's start (12.5) "
            "or a date (2024-01-18T10:30:00+01:00)"
        ) from None
    return moment.astimezone()


def _ns(moment: Moment, first_ns: int) -> int:
    if isinstance(moment, datetime):
        return round(moment.timestamp() * 1e6) * 1000
    return first_ns + round(moment * 1e9)


def _between(signal: Signal, start: float, stop: float) -> Signal:
    inside = signal.between(start, stop)
    return replace(inside, time=inside.time - start)
