"""What is on a bus: one row per id, with rate, gaps and the name that a DBC gives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.can import j1939
from clutchest.can.database import Database
from clutchest.can.frames import Flag, Frames


@dataclass(frozen=True, slots=True)
class IdStatistics:
    """One id on one channel.

    ``pgn`` is that of an extended id read as J1939, None for 11 bits; ``message`` the DBC's name
    or None; ``rate_hz`` frames per second between the first and the last, ``period_s`` median and
    ``gap_s`` largest distance of two frames, s — None with a single frame; ``lengths`` the payload
    lengths that occur, bytes.
    """

    channel: int
    id: int
    extended: bool
    pgn: int | None
    message: str | None
    count: int
    rate_hz: float | None
    period_s: float | None
    gap_s: float | None
    lengths: tuple[int, ...]


def survey(frames: Frames, databases: Sequence[Database] = ()) -> list[IdStatistics]:
    """One :class:`IdStatistics` per channel and id of the data frames, by channel, kind and id."""
    data = np.flatnonzero((frames.flags & (Flag.REMOTE | Flag.ERROR)) == 0)
    extended = (frames.flags[data] & Flag.EXTENDED).astype(np.uint64)
    key = (
        frames.channel[data].astype(np.uint64) << np.uint64(33)
        | extended << np.uint64(32)
        | frames.id[data].astype(np.uint64)
    )
    order = np.lexsort((frames.t_ns[data], key))
    data, key = data[order], key[order]
    starts = np.flatnonzero(np.diff(key)) + 1
    groups = np.split(data, starts) if len(data) else []
    return [_row(frames, group, databases) for group in groups]


def _row(frames: Frames, group: np.ndarray, databases: Sequence[Database]) -> IdStatistics:
    first = group[0]
    can_id, extended = int(frames.id[first]), bool(frames.flags[first] & Flag.EXTENDED)
    known = (database.find(can_id, extended) for database in databases)
    message = next((candidate.name for candidate in known if candidate), None)
    rate = period = gap = None
    if len(group) > 1:
        t = frames.t_ns[group]
        steps = np.diff(t) * 1e-9
        period, gap = float(np.median(steps)), float(steps.max())
        rate = (len(group) - 1) / (float(t[-1] - t[0]) * 1e-9) if t[-1] > t[0] else None
    lengths = tuple(int(length) for length in np.unique(frames.length[group]))
    return IdStatistics(
        int(frames.channel[first]),
        can_id,
        extended,
        j1939.pgn(can_id) if extended else None,
        message,
        len(group),
        rate,
        period,
        gap,
        lengths,
    )
