"""SAE J1939-21, transport protocol: messages of 9 to 1785 bytes in packets of 7.

Announced by TP.CM (broadcast: BAM; to one receiver: RTS, answered by CTS), carried by TP.DT.  A
packet that is sent again on the receiver's request replaces the one before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.can import j1939
from clutchest.can.database import Message
from clutchest.can.frames import Flag, Frames, added_up
from clutchest.native import compiled

_PF = np.uint32(0xFF0000)  # PDU format within the id
_CM, _DT = np.uint32(0xEC0000), np.uint32(0xEB0000)
_RTS, _BAM, _ABORT = 16, 32, 255
_SILENCE_NS = 1_250_000_000  # T3, the longest that a sender may keep its receiver waiting
_KIND = np.uint8(Flag.EXTENDED | Flag.REMOTE | Flag.ERROR)


def may_carry(message: Message) -> bool:
    """Whether a message is too long for one frame."""
    return message.is_j1939 and message.length > 8


def belongs(frames: Frames) -> NDArray[np.bool_]:
    """Which frames are TP.CM or TP.DT; shape (n,)."""
    form = frames.id & _PF
    return ((form == _CM) | (form == _DT)) & ((frames.flags & _KIND) == Flag.EXTENDED)


def reassembled(frames: Frames, messages: Sequence[Message]) -> Frames:
    """``frames`` (sorted) in which the last packet of each long one of ``messages`` is replaced by
    the whole, with the message's id and the sender's address.

    Transfers that are not complete are counted in ``rejected``.
    """
    wanted = {j1939.pgn(m.id): m for m in messages if may_carry(m)}
    packets = np.flatnonzero(belongs(frames)) if wanted else np.zeros(0, np.intp)
    if not len(packets):
        return frames
    pair = frames.channel[packets].astype(np.int64) << 16 | frames.id[packets] & 0xFFFF
    packets = packets[np.argsort(pair, kind="stable")]
    pgns = np.array(sorted(wanted), np.int64)
    given = _Packets(packets, frames.t_ns, frames.channel, frames.id, frames.length, frames.data)
    room = int(np.count_nonzero((frames.id[packets] & _PF) == _CM))
    out = _Assembled.room_for(room, max(m.length for m in wanted.values()))
    n, lost = _assemble(given, pgns, out)
    if lost:
        incomplete = (("transport protocol message is not complete", int(lost)),)
        frames = replace(frames, rejected=added_up((frames.rejected, incomplete)))
    if not n:
        return frames
    rows, group = out.row[:n], out.group[:n]
    bases = np.array([j1939.with_source(wanted[pgn].id, 0) for pgn in sorted(wanted)], np.uint32)
    together = Frames(
        frames.t_ns[rows],
        frames.channel[rows],
        bases[group] | frames.id[rows] & np.uint32(0xFF),
        frames.flags[rows],
        out.length[:n],
        out.data[:n],
        frames.absolute,
    )
    others = np.ones(len(frames), bool)
    others[rows] = False
    return Frames.concatenate([frames.take(others), together]).sorted()


class _Packets(NamedTuple):
    """The ``rows`` of TP.CM and TP.DT, sorted by sender and receiver, among the frames' columns."""

    rows: NDArray[np.intp]
    t_ns: NDArray[np.int64]
    channel: NDArray[np.uint8]
    id: NDArray[np.uint32]
    length: NDArray[np.unsignedinteger]
    data: NDArray[np.uint8]


class _Assembled(NamedTuple):
    """Whole messages, (n,) and ``data`` (n, width): the ``row`` of the last packet, the parameter
    ``group`` as an index, ``length`` in bytes."""

    row: NDArray[np.int64]
    group: NDArray[np.int64]
    length: NDArray[np.uint16]
    data: NDArray[np.uint8]

    @classmethod
    def room_for(cls, n: int, width: int) -> _Assembled:
        return cls(
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
            np.zeros(n, np.uint16),
            np.zeros((n, width), np.uint8),
        )


@compiled
def _assemble(packets, pgns, out):  # type: ignore[no-untyped-def]
    """Fills ``out`` (:class:`_Assembled`) from ``packets`` (:class:`_Packets`) of the groups
    ``pgns``, sorted; gives (messages, incomplete ones)."""
    n = lost = 0
    pair = size = count = have = 0
    which, last = -1, 0  # index of the wanted group that is being received, -1 for none
    seen = np.zeros(256, np.bool_)
    for row in packets.rows:
        if packets.length[row] < 8:
            continue
        this = np.int64(packets.channel[row]) << 16 | np.int64(packets.id[row]) & 0xFFFF
        late = this != pair or packets.t_ns[row] - last > _SILENCE_NS
        if which >= 0 and late:
            lost, which = lost + 1, -1
        pair, last = this, packets.t_ns[row]
        packet = packets.data[row]
        if packets.id[row] & _PF == _CM:
            if packet[0] not in (_RTS, _BAM, _ABORT):
                continue
            if which >= 0:
                lost, which = lost + 1, -1
            if packet[0] == _ABORT:
                continue
            size = np.int64(packet[1]) | np.int64(packet[2]) << 8
            count = np.int64(packet[3])
            pgn = np.int64(packet[5]) | np.int64(packet[6]) << 8 | np.int64(packet[7]) << 16
            place = np.searchsorted(pgns, pgn)
            if place < len(pgns) and pgns[place] == pgn and 8 < size <= 7 * count:
                which, have = place, 0
                seen[:] = False
                out.data[n, :] = 0
        elif which >= 0 and 1 <= packet[0] <= count:
            number = np.int64(packet[0]) - 1
            have += not seen[number]
            seen[number] = True
            for byte in range(7):
                at = 7 * number + byte
                if at < min(size, out.data.shape[1]):
                    out.data[n, at] = packet[1 + byte]
            if have == count:
                out.row[n], out.group[n], out.length[n] = row, which, size
                n, which = n + 1, -1
    return n, lost + (which >= 0)
