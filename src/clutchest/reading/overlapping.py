"""Logs that cannot be pieces of one drive, since they say the same things at the same time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from clutchest.can.frames import Frames
from clutchest.paths import names_of
from clutchest.signals import Signals

LEAST_NS = 1_000_000_000  # of one overlap; logs are cut within less
SAME = 0.5  # of the readings in an overlap, from which on both logs hold the same ones


class TimedLog(Protocol):
    """A log: its contents, and from when until when, ns."""

    @property
    def path(self) -> Path:
        """Its file."""

    @property
    def content(self) -> Frames | Signals:
        """What is in it."""

    @property
    def start(self) -> int:
        """The time of its first reading."""

    @property
    def end(self) -> int:
        """The time of its last one."""


def at_the_same_time(logs: Sequence[TimedLog]) -> Iterator[str]:
    """In words, which of these pieces of one drive, in order of time, have the same messages or
    signals at the same time as the one before that lasts longest, with other readings."""
    last: TimedLog | None = None
    for log in logs:
        if last is not None and min(last.end, log.end) - log.start >= LEAST_NS:
            shared, same = _compared(last, log)
            if shared and same < SAME:
                seconds = (min(last.end, log.end) - log.start) / 1e9
                yield (
                    f"{last.path.name} and {log.path.name} overlap by {seconds:.0f} s, in which "
                    f"both have readings of {shared}, not the same ones: of two vehicles, or of "
                    "one that two loggers recorded? They are taken for one drive; give one of them"
                )
        if last is None or log.end > last.end:
            last = log


def given_twice(drives: Sequence[Signals]) -> Iterator[str]:
    """In words, which drives have the very samples of another one, in which something changes."""
    alike: dict[int, list[Signals]] = {}
    for drive in drives:
        alike.setdefault(max(map(len, drive.signals.values()), default=0), []).append(drive)
    for some in alike.values():
        for one, other in combinations(some, 2):
            if one.has_samples_of(other) and any(
                np.ptp(one[name].only_valid().value) > 0.0 for name in one.available
            ):
                yield (
                    f"{names_of(other.sources)} has the very samples of {names_of(one.sources)}: "
                    "one drive that is given twice, and counted twice"
                )


def _compared(one: TimedLog, other: TimedLog) -> tuple[str, float]:
    """What both have between the begin of the ``other`` and the end of either, in words, and which
    share of the readings of the other is also one of the first."""
    until = min(one.end, other.end)
    first, second = (_readings(log.content, other.start, until) for log in (one, other))
    shared = sorted(set(first) & set(second))
    if not shared:
        return "", 0.0
    common = sum(int(np.isin(second[key], first[key]).sum()) for key in shared)
    kind = "message" if isinstance(one.content, Frames) else "signal"
    words = f"{len(shared)} {kind}{'s' * (len(shared) > 1)}"
    return words, common / sum(len(second[key]) for key in shared)


def _readings(
    content: Frames | Signals, start: int, end: int
) -> dict[tuple[int, int] | str, NDArray[np.int64]]:
    """Message (channel and id) or signal → times of its readings within, ns."""
    if isinstance(content, Signals):
        begun = content.start_ns or 0
        times = {n: begun + np.rint(s.time * 1e9).astype(np.int64) for n, s in content.items()}
        within = {n: t[(t >= start) & (t <= end)] for n, t in times.items()}
        return {name: t for name, t in within.items() if len(t)}
    inside = np.flatnonzero((content.t_ns >= start) & (content.t_ns <= end))
    t, channel, ids = (of[inside] for of in (content.t_ns, content.channel, content.id))
    pairs = np.unique(np.stack([channel, ids], axis=1), axis=0)
    return {(int(c), int(i)): t[(channel == c) & (ids == i)] for c, i in pairs}
