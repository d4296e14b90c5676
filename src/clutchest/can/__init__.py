"""The bus: log files, databases, decoding and encoding by column.

>>> from clutchest import can
>>> frames = can.read_frames("drive.blf")
>>> frames.decode("vehicle.dbc").to_pandas()

``read_blocks`` gives the same a block at a time, for logs larger than memory.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clutchest.can.database import Database
    from clutchest.can.database import load as load_database
    from clutchest.can.decoded import DecodedFrames
    from clutchest.can.files import read_blocks, read_frames, write_frames
    from clutchest.can.frames import Flag, Frames

# Loaded when first asked for: `import clutchest.can` itself stays quick.
_HOMES = {
    "Database": ("clutchest.can.database", "Database"),
    "DecodedFrames": ("clutchest.can.decoded", "DecodedFrames"),
    "Flag": ("clutchest.can.frames", "Flag"),
    "Frames": ("clutchest.can.frames", "Frames"),
    "load_database": ("clutchest.can.database", "load"),
    "read_blocks": ("clutchest.can.files", "read_blocks"),
    "read_frames": ("clutchest.can.files", "read_frames"),
    "write_frames": ("clutchest.can.files", "write_frames"),
}

__all__ = [
    "Database",
    "DecodedFrames",
    "Flag",
    "Frames",
    "load_database",
    "read_blocks",
    "read_frames",
    "write_frames",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'clutchest.can' has no attribute '{name}'")
    module, member = _HOMES[name]
    value = getattr(import_module(module), member)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
