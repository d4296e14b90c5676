"""The cache folder: what takes long to make is kept there from one run to the next.

What is kept there is executed, so the folder has to be this user's alone.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
from functools import lru_cache
from pathlib import Path


def cache_folder() -> Path:
    """``CLUTCHEST_CACHE`` if set, else the user's cache folder; where it cannot be written to, or
    others may write there, a folder of this user's among the temporary ones, which is said once."""
    from platformdirs import user_cache_path

    chosen = os.environ.get("CLUTCHEST_CACHE")
    return _usable(Path(chosen) if chosen else user_cache_path("clutchest", appauthor=False))


@lru_cache(maxsize=8)
def _usable(folder: Path) -> Path:
    if (complaint := _complaint(folder)) is None:
        return folder
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "")
    other = Path(tempfile.gettempdir()) / f"clutchest-{user}"
    if _complaint(other) is not None:  # somebody else's
        other = Path(tempfile.mkdtemp(prefix="clutchest-"))
    print(f"clutchest: cache {folder}: {complaint}; {other} is used instead", file=sys.stderr)
    return other


def _complaint(folder: Path) -> str | None:
    """Why nothing can be kept in a folder, made if need be; None where it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        found = folder.stat()
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as problem:
        return f"cannot be written to ({problem.strerror})"
    if hasattr(os, "getuid") and found.st_uid != os.getuid():
        return "belongs to another user"
    if os.name == "posix" and found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "others may write there"
    return None


def kept(folder: Path, name: str, text: str) -> Path:
    """The file ``name`` in ``folder`` with ``text`` in it, written unless it is there already; one
    with other content is damaged, which is said, and made anew."""
    path, content = folder / name, text.encode()
    try:
        if path.read_bytes() == content:
            return path
        print(f"clutchest: cache: {path} is damaged, made anew", file=sys.stderr)
    except OSError:  # not there yet
        pass
    with tempfile.NamedTemporaryFile(dir=folder, suffix=".tmp", delete=False) as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    Path(file.name).replace(path)  # atomic: two processes may do this at once
    return path


def recalled(name: str) -> bytes | None:
    """What :func:`remember` has kept under this name; None if nothing, or if it is damaged, which
    is said."""
    path = cache_folder() / "native" / name
    try:
        found = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(found[32:]).digest() == found[:32]:
        return found[32:]
    print(f"clutchest: cache: {path} is damaged, made anew", file=sys.stderr)
    return None


def remember(name: str, content: bytes) -> None:
    """Keep something, unless the folder cannot be written to."""
    folder = cache_folder() / "native"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".tmp", delete=False) as file:
            file.write(hashlib.sha256(content).digest() + content)
        Path(file.name).replace(folder / name)
    except OSError:
        return
