"""The road as it is usually built: python-can reads, cantools decodes, filterpy filters; and others
who do a part of it, where they are installed (``pip install vblf mf4-rs can-decoder``)."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import cantools
import numpy as np
from asammdf import MDF, Signal

import can
from clutchest.can.frames import Frames

READERS = {
    ".log": can.CanutilsLogReader,
    ".asc": can.ASCReader,
    ".blf": can.BLFReader,
    ".trc": can.TRCReader,
    ".csv": can.CSVReader,
}


def read_and_decode(
    path: Path, database: cantools.database.can.Database, wanted: dict[str, set[str]]
) -> int:
    """Every mapped signal of every frame, in lists; the number of frames.

    Messages are looked up by parameter group, once per id, as J1939 needs it.
    """
    messages = [database.get_message_by_name(name) for name in wanted]
    known: dict[int, object] = {}
    samples: dict[str, list[tuple[float, float]]] = {}
    n = 0
    with READERS[path.suffix](path) as reader:
        for frame in reader:
            n += 1
            can_id = frame.arbitration_id
            if can_id not in known:
                known[can_id] = next(
                    (
                        m
                        for m in messages
                        if not (can_id ^ m.frame_id)
                        & (0x3FFFF00 if can_id >> 16 & 0xFF >= 240 else 0x3FF0000)
                    ),
                    None,
                )
            message = known[can_id]
            if message is None:
                continue
            values = message.decode(frame.data, decode_choices=False)
            for name in wanted[message.name]:
                samples.setdefault(name, []).append((frame.timestamp, values[name]))
    return n


def extract_bus_logging(path: Path, dbc: Path) -> int:
    """asammdf's own way; the number of samples."""
    with MDF(path) as mdf:
        extracted = mdf.extract_bus_logging({"CAN": [(str(dbc), 0)]})
        return sum(
            len(group) for group in (extracted.get_master(i) for i in range(len(extracted.groups)))
        )


def installed(package: str) -> bool:
    """Whether a peer that this project does not need is there; says so if not."""
    there = find_spec(package) is not None
    if not there:
        print(f"  {package} is not installed: left out")
    return there


def by_vblf(
    path: Path, database: cantools.database.can.Database, wanted: dict[str, set[str]]
) -> int:
    """vblf reads, cantools decodes; the number of frames."""
    from vblf.can import CanMessage, CanMessage2
    from vblf.reader import BlfReader

    messages = {database.get_message_by_name(name).frame_id >> 8: name for name in wanted}
    samples: dict[str, list[tuple[float, float]]] = {}
    n = 0
    with BlfReader(path) as reader:
        for item in reader:
            if not isinstance(item, CanMessage | CanMessage2):
                continue
            n += 1
            name = messages.get((item.frame_id & 0x1FFFFFFF) >> 8)
            if name is None:
                continue
            message = database.get_message_by_name(name)
            values = message.decode(item.data, decode_choices=False)
            for signal in wanted[name]:
                time = item.header.object_time_stamp
                samples.setdefault(signal, []).append((time, values[signal]))
    return n


def plain_channels(path: Path, frames: Frames) -> Callable[[], int]:
    """mf4-rs, which does not name the members of a bus record: the same columns as channels of
    their own, in a file at ``path`` that is not compressed."""
    import mf4_rs

    columns = {name: getattr(frames, name) for name in ("channel", "id", "flags", "length")}
    columns |= {f"byte{k}": np.ascontiguousarray(frames.data[:, k]) for k in range(8)}
    time = (frames.t_ns - frames.t_ns[0]) * 1e-9
    with MDF() as file:
        signals = [Signal(value, time, name=name) for name, value in columns.items()]
        file.append(signals, common_timebase=True)
        file.save(path, compression=0, overwrite=True)

    def read() -> int:
        file = mf4_rs.Mdf(str(path))
        return sum(len(file.values(name)) for name in ("time", *columns))

    return read


def by_can_decoder(frames: Frames, dbc: Path) -> Callable[[], int]:
    """can_decoder: every signal of frames that are a DataFrame already."""
    import can_decoder
    import pandas as pd

    rules = can_decoder.load_dbc(str(dbc))
    table = pd.DataFrame(
        {
            "ID": frames.id.astype("uint32"),
            "IDE": True,
            "DataBytes": [row.tolist() for row in frames.data[:, :8]],
            "TimeStamp": pd.to_datetime(frames.t_ns, utc=True),
        }
    )
    return lambda: len(can_decoder.DataFrameDecoder(rules).decode_frame(table))
