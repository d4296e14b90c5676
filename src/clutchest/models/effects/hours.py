"""Time since a drive's start, as a state of what grows with it."""

from __future__ import annotations

from typing import Any

from clutchest.models.symbols import State

HOURS = State("hours", "h", "t", "time since the drive's start", 0.0, 0.0, 1.0, carried=False)


def hours_rate(rate: Any, q: Any) -> Any:
    """The term of its rate."""
    return rate + 1.0 / 3600.0
