"""Messages of python-can as columns.

python-can holds times as float64 seconds, so stamps are good to 1 µs and are rounded to that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from clutchest.can.frames import Flag, Frames, Tally
from clutchest.can.time_stamps import LAST_S

if TYPE_CHECKING:
    from can import Message

BLOCK = 100_000  # frames
BROKEN = "file is damaged or ends early"
_UNSOUND = "frame has no sound id, length or time"

# Plain numbers: operators of an enumeration are slow.
_EXTENDED, _REMOTE, _ERROR = int(Flag.EXTENDED), int(Flag.REMOTE), int(Flag.ERROR)
_FD, _BITRATE_SWITCH = int(Flag.FD), int(Flag.BITRATE_SWITCH)
_ERROR_STATE, _SENT = int(Flag.ERROR_STATE), int(Flag.SENT)


class MessageColumns:
    """Messages of python-can, collected into the columns of Frames."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, int, int, int, int]] = []
        self.payloads: list[bytes] = []
        self.unsound = 0

    def __len__(self) -> int:
        return len(self.rows) + self.unsound

    def add(self, message: Message) -> None:
        """One more; what cannot be a frame is counted in ``unsound``."""
        data = bytes(message.data)
        length = message.dlc if message.is_remote_frame else len(data)
        if not (
            0 <= length <= 64
            and len(data) <= 64
            and 0 <= message.arbitration_id < 1 << 29
            and abs(message.timestamp) < LAST_S
        ):
            self.unsound += 1
            return
        channel = message.channel if isinstance(message.channel, int) else 0
        self.rows.append(
            (
                round(message.timestamp * 1e6) * 1000,
                message.arbitration_id,
                _flags(message),
                length,
                max(channel, 0),
            )
        )
        self.payloads.append(data)

    def frames(self, rejected: Tally = ()) -> Frames:
        """All of them, with what was ``rejected`` besides."""
        if self.unsound:
            rejected = ((_UNSOUND, self.unsound), *rejected)
        width = 8 if all(len(data) <= 8 for data in self.payloads) else 64
        columns = np.array(self.rows, np.int64).reshape(-1, 5).T
        data = np.frombuffer(b"".join(data.ljust(width, b"\0") for data in self.payloads), np.uint8)
        return Frames(
            np.ascontiguousarray(columns[0]),
            columns[4].astype(np.uint8),
            columns[1].astype(np.uint32),
            columns[2].astype(np.uint8),
            columns[3].astype(np.uint8),
            data.reshape(-1, width),
            rejected=rejected,
        )


def _flags(message: Message) -> int:
    flags = 0
    if message.is_error_frame:
        flags |= _ERROR
    elif message.is_extended_id:
        flags |= _EXTENDED
    if message.is_remote_frame:
        flags |= _REMOTE
    if message.is_fd:
        flags |= _FD
    if message.bitrate_switch:
        flags |= _BITRATE_SWITCH
    if message.error_state_indicator:
        flags |= _ERROR_STATE
    if not message.is_rx:
        flags |= _SENT
    return flags


def blocks_of(messages: Iterable[Message]) -> Iterator[Frames]:
    """Blocks of frames, up to where the reader fails: that is counted as :data:`BROKEN`."""
    rest, reading = iter(messages), True
    while reading:
        columns, broken = MessageColumns(), False
        try:
            for message in islice(rest, BLOCK):
                columns.add(message)
            reading = len(columns) == BLOCK
        except Exception:  # every format's library has its own
            reading, broken = False, True
        yield columns.frames(((BROKEN, 1),) if broken else ())
