"""The road as it is usually built: python-can reads, cantools decodes, filterpy filters."""

from __future__ import annotations

from pathlib import Path

import cantools
from asammdf import MDF

import can

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
