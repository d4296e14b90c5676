"""Reading of a log while what takes its frames is still being loaded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from clutchest.can.files import is_log, read_blocks
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.made_ahead import made_ahead
from clutchest.shipped import locate

COMPILED = (".log", ".asc", ".blf", ".trc")  # their readers hardly take Python from others
AHEAD = 32  # blocks


@contextmanager
def read_ahead(log: str) -> Iterator[Mapping[Path, Iterator[Frames]]]:
    """The blocks of a ``log``, a path or the name of a shipped one, by its path, to be taken
    within; nothing of what is none, or whose reader runs in Python.  An error is raised where its
    block is taken."""
    path = _path(log)
    if path is None:
        yield {}
        return
    with made_ahead(read_blocks(path), AHEAD) as blocks:
        yield {path: blocks}


def _path(log: str) -> Path | None:
    """Where it is, if it is to be read ahead."""
    try:
        path = locate(log, "logs")
    except ClutchestError:  # whoever reads the log says so
        return None
    streamed = path.name.lower().removesuffix(".gz").endswith(COMPILED)
    return path if streamed and is_log(path) else None
