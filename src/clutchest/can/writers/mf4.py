"""MDF4 bus logging, as asammdf's own ``extract_bus_logging`` and other tools read it."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from asammdf import MDF, Signal, Source

from clutchest.can.frames import Flag, Frames

_KINDS = {"CAN_DataFrame": 0, "CAN_RemoteFrame": Flag.REMOTE, "CAN_ErrorFrame": Flag.ERROR}
_DLC = np.array([*range(9), *np.repeat(range(9, 16), (4, 4, 4, 4, 8, 16, 16))], np.uint8)


def write(frames: Frames, path: Path) -> None:
    """One group each of data, remote and error frames, as far as there are any."""
    start_s = int(frames.t_ns[0] // 10**9) if len(frames) and frames.absolute else 0
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.fromtimestamp(start_s, UTC)
        for kind, flag in _KINDS.items():
            rows = (frames.flags & (Flag.REMOTE | Flag.ERROR)) == flag
            if rows.any():
                mdf.append(
                    _group(frames.take(rows).sorted(), kind, start_s),
                    comment="written by clutchest",
                )
        mdf.save(path, overwrite=True, compression=2)


def _group(frames: Frames, kind: str, start_s: int) -> Signal:
    def flag(bit: Flag) -> np.ndarray:
        return ((frames.flags & bit) != 0).astype(np.uint8)

    width = frames.data.shape[1]
    columns: dict[str, np.ndarray] = {
        "BusChannel": frames.channel,
        "ID": frames.id,
        "IDE": flag(Flag.EXTENDED),
        "DLC": _DLC[frames.length],
        "DataLength": frames.length,
        "DataBytes": frames.data,
        "Dir": flag(Flag.SENT),
        "EDL": flag(Flag.FD),
        "BRS": flag(Flag.BITRATE_SWITCH),
        "ESI": flag(Flag.ERROR_STATE),
    }
    layout = [
        (f"{kind}.{name}", column.dtype, (width,) if column.ndim == 2 else ())
        for name, column in columns.items()
    ]
    samples = np.zeros(len(frames), layout)
    for name, column in columns.items():
        samples[f"{kind}.{name}"] = column
    bus = Source(kind, kind, "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    return Signal(samples, (frames.t_ns - start_s * 10**9) / 1e9, name=kind, source=bus)
