"""asc, blf, trc and csv, written by python-can.

All four hold times to 1 µs.  trc and csv cannot hold every frame: what would be lost is an error.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from can import ASCWriter, BLFWriter, CSVWriter, Message, TRCWriter

from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError


def write_asc(frames: Frames, path: Path) -> None:
    """Vector's text log.  Its date has milliseconds only, so the log starts at a full one."""
    with ASCWriter(path) as writer:
        if len(frames):
            writer.log_event("Log written by clutchest", float(frames.t_ns[0] // 10**6) / 1e3)
        _send(frames, writer)


def write_blf(frames: Frames, path: Path) -> None:
    """Vector's binary log."""
    with BLFWriter(path) as writer:
        _send(frames, writer)


def write_trc(frames: Frames, path: Path) -> None:
    """PEAK's text log, version 2.1.  Raises ClutchestError for error, remote and FD frames."""
    _only(frames, Flag.ERROR | Flag.REMOTE | Flag.FD, "error, remote or FD frames", path)
    with TRCWriter(path) as writer:
        _send(frames, writer)


def write_csv(frames: Frames, path: Path) -> None:
    """python-can's csv.  Raises ClutchestError for FD frames and for several channels."""
    _only(frames, Flag.FD, "FD frames", path)
    if len(np.unique(frames.channel)) > 1:
        raise ClutchestError(f"{path}: csv cannot hold several channels; .log, .asc, .blf, .trc "
                             "and .mf4 can")  # fmt: skip
    with CSVWriter(path) as writer:
        _send(frames, writer)


WRITERS: dict[str, Callable[[Frames, Path], None]] = {
    ".asc": write_asc, ".blf": write_blf, ".csv": write_csv, ".trc": write_trc,
}  # fmt: skip


def _only(frames: Frames, flags: Flag, what: str, path: Path) -> None:
    count = np.count_nonzero(frames.flags & flags)
    if count:
        raise ClutchestError(f"{path}: {path.suffix} cannot hold {what}, of which there are "
                             f"{count}; .log, .asc, .blf and .mf4 can")  # fmt: skip


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
