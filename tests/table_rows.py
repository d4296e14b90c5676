"""Rows of tables: a time and an engine speed, and files that hold them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

RPM = np.pi / 30  # rad/s
N = 400
TIME = 0.01 * np.arange(N)  # s
SPEED = 100.0 + 60.0 * np.sin(np.arange(N) / 60.0)  # rad/s


def written(folder: Path, text: str, name: str = "a.csv") -> Path:
    """A file of this text."""
    (folder / name).write_bytes(text.encode())
    return folder / name
