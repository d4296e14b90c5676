"""A file for a library that waits for ever once a write has failed, as on a full disk."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

PIECE = 1 << 16  # bytes


def open_files() -> Path | None:
    """The folder that names this process's open files by their numbers; Windows has none."""
    folders = (Path("/proc/self/fd"), Path("/dev/fd"))  # a bare Linux has the first alone
    return next((folder for folder in folders if folder.is_dir()), None)


class DrainedFile:
    """``path``, which grows by what is written to its :meth:`entrance`, the end of a pipe.

    Whoever writes there never sees a failure; ``problem`` says why the file grows no more.  What
    comes after that is dropped.  ``names`` is a folder such as :func:`open_files`.  Raises OSError
    where ``path`` cannot be opened.
    """

    def __init__(self, path: Path, names: Path) -> None:
        self.problem = ""
        self._names = names
        self._file = path.open("wb", buffering=0)
        reading, self._entrance = os.pipe()
        self._pipe = os.fdopen(reading, "rb", buffering=0)
        self._thread = Thread(target=self._drain, name=f"drain {path.name}", daemon=True)
        self._thread.start()

    @contextmanager
    def entrance(self) -> Iterator[Path]:
        """A path to open for writing within; the file is complete once the writer closes it."""
        try:
            yield self._names / str(self._entrance)
        finally:
            os.close(self._entrance)

    def close(self, timeout: float) -> None:
        """Wait for what is in the pipe, for at most ``timeout`` s."""
        self._thread.join(timeout)

    def _drain(self) -> None:
        with self._pipe:
            try:
                with self._file:
                    while data := self._pipe.read(PIECE):
                        while data:
                            data = data[self._file.write(data) :]
            except BaseException as problem:  # whatever it is, who writes must not wait
                reason = problem.strerror if isinstance(problem, OSError) else None
                self.problem = reason or repr(problem)
                while self._pipe.read(PIECE):
                    pass
