"""Log files: any format in, columns out, and back."""

from __future__ import annotations

from pathlib import Path

from clutchest.can.frames import Frames


def read_frames(path: Path) -> Frames:
    """All frames of a log, in the order of the file."""
    raise NotImplementedError


def write_frames(frames: Frames, path: Path) -> None:
    """Writes a log; the suffix says which format."""
    raise NotImplementedError
