"""The account of a log's frames: how many were decoded, or rejected for which reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.can import j1939
from clutchest.can.database import Database, Message
from clutchest.can.decode import DecodedColumn
from clutchest.can.frames import Flag, Frames
from clutchest.can.transport import belongs, may_carry
from clutchest.errors import ClutchestError
from clutchest.signals import Signal, Why

_TOGETHER = 0.1  # of the samples, from which on those at the time of another are named


@dataclass
class Account:
    """``messages``: of each mapped one its frames, those decoded, and by reason those with an
    invalid signal; ``rejected``: frames without any valid signal, by reason."""

    messages: dict[str, dict[str, int]] = field(default_factory=dict)
    rejected: Counter[str] = field(default_factory=Counter)

    def of_message(
        self, rows: NDArray[np.intp], columns: Mapping[str, DecodedColumn], counts: dict[str, int]
    ) -> None:
        """Count the frames of one message, ``rows`` (n,) of the log, in its ``counts``."""
        good = np.zeros(len(rows), bool)
        reason = np.zeros(len(rows), np.uint8)
        seen: dict[Why, NDArray[np.bool_]] = {}
        for column in columns.values():
            place = slice(None) if column.rows is rows else np.searchsorted(rows, column.rows)
            good[place] |= column.why == Why.VALID
            reason[place] = np.where(column.why != Why.VALID, column.why, reason[place])
            for code in np.flatnonzero(np.bincount(column.why)).tolist():
                if code == Why.VALID:
                    continue
                mask = seen.setdefault(Why(code), np.zeros(len(rows), bool))
                mask[place] |= column.why == code
        counts["decoded"] = int(np.count_nonzero(good))
        counts |= {words(why): int(np.count_nonzero(mask)) for why, mask in sorted(seen.items())}
        for code, number in enumerate(np.bincount(reason[~good]).tolist()):
            if number:
                self.rejected[words(Why(code)) if code else "multiplexed otherwise"] += number

    def of_the_rest(
        self, frames: Frames, mapped: NDArray[np.bool_], wanted: Iterable[Message]
    ) -> None:
        """Count the ``frames`` (n) that are not ``mapped`` (n,)."""
        left = np.zeros(0, np.intp) if mapped.all() else np.flatnonzero(~mapped)
        for flag, reason in ((Flag.ERROR, "error frame"), (Flag.REMOTE, "remote frame")):
            kind = (frames.flags[left] & flag) != 0
            self.rejected[reason] += int(np.count_nonzero(kind))
            left = left[~kind]
        if len(left) and any(map(may_carry, wanted)):
            packets = belongs(frames.take(left))
            self.rejected["packet of a longer message"] += int(np.count_nonzero(packets))
            left = left[~packets]
        self.rejected["not mapped"] += len(left)
        self.rejected = Counter({k: n for k, n in self.rejected.items() if n})


def contents_of(frames: Frames, database: Database) -> str:
    """What a log holds of the messages of a DBC, else which ids, in words."""
    extended = (frames.flags & Flag.EXTENDED) != 0
    columns = (frames.id, extended.astype(np.uint32), frames.channel.astype(np.uint32))
    each = np.unique(np.stack(columns), axis=1).T.tolist()
    known = {m.name for i, e, channel in each if (m := database.find(i, bool(e), channel))}
    alike = _of_one_group([i for i, e, _ in each if e], database)
    if known:
        names = sorted(known)
        held = ", ".join(names[:8]) + ", …" * (len(names) > 8)
        return f"of this DBC the log holds {held}{alike}"
    elsewhere = {
        f"{m.name} on channel {channel}"
        for i, e, channel in each
        if (m := database.find(i, bool(e)))
    }
    if elsewhere:
        names = sorted(elsewhere)
        held = ", ".join(names[:8]) + ", …" * (len(names) > 8)
        return f"the log holds {held}, where 'dbc' says another channel"
    ids = list(dict.fromkeys(f"0x{i:03X}" for i, *_ in each))
    return "the log holds " + ", ".join(ids[:6]) + ", …" * (len(ids) > 6) + alike


def _of_one_group(ids: Sequence[int], database: Database) -> str:
    """In words, which 29-bit ``ids`` would be messages of the database if it were one of J1939."""
    alike = [
        f"0x{i:08X} would be {m.name}"
        for m in database.messages.values()
        if m.extended and not m.is_j1939 and m.id not in ids
        for i in ids
        if not (i ^ m.id) & j1939.pgn_mask(m.id)
    ]
    return f"; {', '.join(alike[:3])} if the DBC said that it is J1939" if alike else ""


def together(signals: Mapping[str, Signal], source: str) -> list[str]:
    """A warning of the signals of which many samples have the time of the sample before.

    Raises ClutchestError where all samples of a log have one time.
    """
    ends = {float(t) for s in signals.values() if len(s) for t in (s.time[0], s.time[-1])}
    if len(ends) == 1 and any(len(signal) > 1 for signal in signals.values()):
        raise ClutchestError(
            f"{source}: all samples have the same time; expected a clock that runs"
        )
    names = [name for name, signal in signals.items() if _repeated(signal) > _TOGETHER]
    if not names:
        return []
    return [
        f"{source}: samples of {', '.join(names)} have the time of the sample before; expected a "
        "clock that tells them apart, each row once"
    ]


def _repeated(signal: Signal) -> float:
    """The share of the samples that have the time of the sample before."""
    time, same = signal.time, 0
    for part in memory_mapped.portions(len(time) - 1):
        piece = time[part.start : part.stop + 1]
        same += int(np.count_nonzero(piece[1:] == piece[:-1]))
    return same / max(len(time), 1)


def words(why: Why) -> str:
    """A reason in words."""
    return why.name.lower().replace("_", " ")
