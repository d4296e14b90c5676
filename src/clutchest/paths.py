"""Paths that are not UTF-8, which a file system may have: as text, and for libraries that refuse
them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory


def readable(path: str | os.PathLike[str]) -> str:
    r"""``path``, or a text with paths in it, as any file can hold it: bytes that are not UTF-8 as
    ``\udcff``, which is what JSON calls them."""
    return os.fspath(path).encode("utf-8", "backslashreplace").decode()


def as_written(path: str | os.PathLike[str]) -> Path:
    """The path that a user writes: ``~`` is their home, which only some libraries know."""
    return Path(os.path.expanduser(path))  # noqa: PTH111 (which raises for a name of no user)


def names_of(paths: Iterable[str | os.PathLike[str]]) -> str:
    """The names of files in words, without their folders."""
    return ", ".join(readable(Path(path).name) for path in paths)


@contextmanager
def named_in_utf8(path: Path) -> Iterator[Path]:
    """``path``, of a file or folder that need not be there yet, if its name is UTF-8; else a link
    to it among the temporary files."""
    if readable(path) == os.fspath(path):
        yield path
        return
    with TemporaryDirectory(prefix="clutchest-") as place:
        link = Path(place) / f"link{readable(path.suffix)}"
        link.symlink_to(path.absolute(), target_is_directory=path.is_dir())
        yield link
