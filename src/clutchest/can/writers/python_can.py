"""asc, blf, trc and csv, written by python-can.

All four hold times to 1 µs.  Each writer returns what the format could not keep.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from can import ASCWriter, BLFWriter, CSVWriter, Message, TRCWriter
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError

Losses = tuple[str, ...]


def write_asc(frames: Frames, path: Path) -> Losses:
    """Vector's text log.  It starts at a full second, the part of its date that is reliable."""
    with ASCWriter(path) as writer:
        if len(frames):
            writer.log_event("Log written by clutchest", float(frames.t_ns[0] // 10**9))
        _send(frames, writer)
    return ()


def write_blf(frames: Frames, path: Path) -> Losses:
    """Vector's binary log.  Without a date its times count from zero, not from the first frame."""
    with BLFWriter(path) as writer:
        writer.start_timestamp = None if frames.absolute else 0.0
        _send(frames, writer)
    return ()


def write_trc(frames: Frames, path: Path) -> Losses:
    """PEAK's text log, version 2.1.  Raises ClutchestError for FD frames."""
    fd = np.count_nonzero(frames.flags & Flag.FD)
    if fd:
        raise ClutchestError(f"{path}: .trc cannot hold FD frames, of which there are {fd}; "
                             ".log, .asc, .blf and .mf4 can")  # fmt: skip
    kept = (frames.flags & (Flag.ERROR | Flag.REMOTE)) == 0
    with TRCWriter(path) as writer:
        _send(frames.take(kept), writer)
    left_out = len(frames) - np.count_nonzero(kept)
    return (f".trc cannot hold {left_out} error or remote frames",) if left_out else ()


def write_csv(frames: Frames, path: Path) -> Losses:
    """python-can's csv."""
    with CSVWriter(path) as writer:
        _send(frames, writer)
    losses = []
    if len(np.unique(frames.channel)) > 1:
        losses.append(".csv cannot tell the channels apart")
    if np.any(frames.flags & (Flag.BITRATE_SWITCH | Flag.ERROR_STATE | Flag.SENT)):
        losses.append(".csv cannot hold direction, bit rate switch and error state")
    return tuple(losses)


WRITERS: dict[str, Callable[[Frames, Path], Losses]] = {
    ".asc": write_asc, ".blf": write_blf, ".csv": write_csv, ".trc": write_trc,
}  # fmt: skip


def _send(frames: Frames, writer: Any) -> None:
    seconds = (frames.t_ns / 1e9).tolist()
    rows = zip(seconds, frames.channel.tolist(), frames.id.tolist(), frames.flags.tolist(),
               frames.length.tolist(), frames.data, strict=True)  # fmt: skip
    for timestamp, channel, can_id, flags, length, data in rows:
        remote = bool(flags & Flag.REMOTE)
        writer.on_message_received(Message(
            timestamp=timestamp, channel=channel, arbitration_id=can_id,
            is_extended_id=bool(flags & Flag.EXTENDED), is_remote_frame=remote,
            is_error_frame=bool(flags & Flag.ERROR), is_fd=bool(flags & Flag.FD),
            bitrate_switch=bool(flags & Flag.BITRATE_SWITCH),
            error_state_indicator=bool(flags & Flag.ERROR_STATE),
            is_rx=not flags & Flag.SENT, dlc=length,
            data=None if remote else data[:length].tobytes(),
        ))  # fmt: skip
