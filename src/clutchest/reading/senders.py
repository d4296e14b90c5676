"""The sender of each frame, and which of several senders is used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.can.database import Message
from clutchest.can.frames import Frames
from clutchest.signals import HEAD


def senders_of(frames: Frames, rows: NDArray[np.intp], message: Message) -> NDArray[np.uint16]:
    """Channel and, with J1939, source address of each of ``rows`` (n,) of one message."""
    senders = np.empty(len(rows), np.uint16)
    address = np.uint32(0xFF if message.is_j1939 else 0)
    for part in memory_mapped.portions(len(rows)):
        channel = frames.channel[rows[part]].astype(np.uint16)
        own = (frames.id[rows[part]] & address).astype(np.uint16)
        senders[part] = channel << np.uint16(8) | own
    return senders


def most_frequent_sender(
    frames: Frames,
    rows: NDArray[np.intp],
    senders: NDArray[np.uint16],
    valid: NDArray[np.bool_],
) -> tuple[int | None, list[int]]:
    """The sender with most valid samples in the first ``HEAD`` s, None without any; and all senders
    with valid samples.  ``rows``, ``senders`` and whether each sample is ``valid``: shape (n,)."""
    if len(senders) and bool((senders == senders[0]).all()):  # as nearly always
        only = int(senders[0])
        return (only, [only]) if valid.any() else (None, [])
    present = np.zeros(1 << 16, bool)
    for part in memory_mapped.portions(len(senders)):
        present[senders[part][valid[part]]] = True
    if not present.any():
        return None, []
    until = frames.t_ns[rows[np.argmax(valid)]] + np.int64(HEAD * 1e9)
    head = rows < np.searchsorted(frames.t_ns, until, side="right")
    counts = np.bincount(senders[valid & head])
    return int(np.argmax(counts)), np.flatnonzero(present).tolist()


def name_of(sender: int, message: Message) -> str:
    """A sender in words."""
    channel = f"channel {sender >> 8}"
    return f"address 0x{sender & 0xFF:02X} on {channel}" if message.is_j1939 else channel
