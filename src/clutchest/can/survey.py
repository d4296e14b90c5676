"""What is on a bus: one row per id, with rate, gaps and the name that a DBC gives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.can import j1939
from clutchest.can.database import Database
from clutchest.can.frames import Flag, Frames
from clutchest.can.j1939_names import group_of

GAP = 3.0  # periods; a longer distance of two frames is a gap
COUNTS = 0.9  # of the frames that go on by the same step, in a byte that is a counter
_NO_DATA = np.uint64(1) << np.uint64(63)  # behind every channel and id
MOST_FRAMES = 20_000  # of an id, by which its bytes are judged


@dataclass(frozen=True, slots=True)
class IdStatistics:
    """One id on one channel.

    ``pgn`` is that of an extended id read as J1939, None for 11 bits; ``message`` the DBC's name
    or None; ``rate_hz`` frames per second between the first and the last, ``period_s`` median and
    ``gap_s`` largest distance of two frames, s — None with a single frame; ``lengths`` the payload
    lengths that occur, bytes.

    ``first_s`` and ``last_s`` on the log's clock; ``jitter_s`` the standard deviation of distances
    that are no gap, ``gaps`` how many are longer than ``GAP`` periods.  ``constant``: places of the
    bytes that never change, ``counters`` those in which all or four bits count on from frame to
    frame; of an id with two frames at least.  ``group``: the J1939 name of the PGN, if it is a
    common one.
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
    first_s: float = 0.0
    last_s: float = 0.0
    jitter_s: float | None = None
    gaps: int = 0
    constant: tuple[int, ...] = ()
    counters: tuple[int, ...] = ()
    group: str | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """Common J1939 parameters of the group: SPN and name."""
        group = None if self.pgn is None else group_of(self.pgn)
        return tuple(f"SPN {spn} {name}" for spn, name in group.parameters.items()) if group else ()


def survey(frames: Frames, databases: Sequence[Database] = ()) -> list[IdStatistics]:
    """One :class:`IdStatistics` per channel and id of the data frames, by channel, kind and id."""
    frames = frames.sorted()
    key = frames.id.astype(np.uint64)
    key |= (frames.flags & Flag.EXTENDED != 0).astype(np.uint64) << np.uint64(32)
    key |= frames.channel.astype(np.uint64) << np.uint64(33)
    key[(frames.flags & (Flag.REMOTE | Flag.ERROR)) != 0] = _NO_DATA
    order = np.argsort(key, kind="stable")
    key = key[order]
    data = order[: np.searchsorted(key, _NO_DATA)]
    starts = np.flatnonzero(np.diff(key[: len(data)])) + 1
    groups = np.split(data, starts) if len(data) else []
    return [_row(frames, group, databases) for group in groups]


def _row(frames: Frames, group: np.ndarray, databases: Sequence[Database]) -> IdStatistics:
    first = group[0]
    can_id, extended = int(frames.id[first]), bool(frames.flags[first] & Flag.EXTENDED)
    channel = int(frames.channel[first])
    known = (database.find(can_id, extended, channel) for database in databases)
    message = next((candidate.name for candidate in known if candidate), None)
    rate = period = gap = jitter = None
    gaps, t = 0, frames.t_ns[group]
    if len(group) > 1:
        steps = np.diff(t)  # ns: equal ones have no jitter
        period, gap = float(np.median(steps)) * 1e-9, float(steps.max()) * 1e-9
        rate = (len(group) - 1) / (float(t[-1] - t[0]) * 1e-9) if t[-1] > t[0] else None
        long = steps > GAP * period * 1e9
        gaps, jitter = int(np.count_nonzero(long)), float(np.std(steps[~long])) * 1e-9
    number = j1939.pgn(can_id) if extended else None
    named = None if number is None else group_of(number)
    constant, counters = _bytes(frames, group)
    lengths = tuple(int(length) for length in np.unique(frames.length[group]))
    return IdStatistics(
        channel,
        can_id,
        extended,
        number,
        message,
        len(group),
        rate,
        period,
        gap,
        lengths,
        first_s=float(t[0] - frames.t_ns.min()) * 1e-9,
        last_s=float(t[-1] - frames.t_ns.min()) * 1e-9,
        jitter_s=jitter,
        gaps=gaps,
        constant=constant,
        counters=counters,
        group=None if named is None else f"{named.acronym}: {named.words}",
    )


def _bytes(frames: Frames, group: np.ndarray) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Places of the bytes that are constant, and of those that hold a counter, by the first frames
    of an id."""
    some = group[:MOST_FRAMES]
    if len(some) < 2:
        return (), ()
    data = frames.data[some, : int(frames.length[some].min())]
    constant = np.flatnonzero((data == data[0]).all(axis=0))
    counters = [
        k
        for k in range(data.shape[1])
        if k not in constant
        and any(
            _counts(data[:, k] >> low & mask, mask) for low, mask in ((0, 255), (0, 15), (4, 15))
        )
    ]
    return tuple(constant.tolist()), tuple(counters)


def _counts(value: np.ndarray, mask: int) -> bool:
    """Whether a number goes on by the same step, nearly always, through at least four values."""
    number = value.astype(np.int64)
    steps = (number[1:] - number[:-1]) & mask
    values, counts = np.unique(steps, return_counts=True)
    usual = int(np.argmax(counts))
    regular = counts[usual] >= COUNTS * len(steps) and len(steps) >= 8
    return bool(regular and values[usual] in (1, 2, mask) and len(np.unique(value)) >= 4)
