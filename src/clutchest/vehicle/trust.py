"""Trust: which vehicle files may run the Python files that they name.

A vehicle file is data.  One that names Python (a machine, effects) may run it once this user has
said so, for the very content of the file and of all that it names; a folder of the user's keeps it.
"""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

from clutchest.errors import ClutchestError
from clutchest.models.python_file import check_syntax
from clutchest.vehicle.named_files import NamedFiles
from clutchest.vehicle.toml import TomlFile
from clutchest.vehicle.vehicle import Vehicle


def check_trusted(file: TomlFile, named: NamedFiles) -> None:
    """Raises ClutchestError where the vehicle file names Python that this user has not trusted."""
    if not named.code or _is_trusted(named.content):
        return
    names = ", ".join(os.path.relpath(path, file.path.parent.resolve()) for path in named.code)
    key = "model" if named.model else "effects_files"
    raise file.error(
        (key,),
        f"runs Python ({names}) that is not trusted, or was changed since: read it, then "
        f"`clutchest trust {file.path.name}`, or --trust for once (in Python: trust=True)",
    )


def trust(path: Path) -> NamedFiles:
    """Trust the vehicle file at ``path``, with its present content and that of all it names.

    The Python that it names is compiled, and not run.  Raises ClutchestError where one of them
    cannot be read, or that cannot be kept.
    """
    named = NamedFiles.of(TomlFile.read(path))
    for code in named.code:
        check_syntax(code)
    folder, complaint = trust_folder(), "others may write there"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with (folder / named.content).open("w", encoding="utf-8", errors="replace") as kept:
            (folder / named.content).chmod(0o600)
            kept.write(f"{path.absolute()}\n")
    except OSError as problem:
        complaint = str(problem.strerror)
    if not _is_trusted(named.content):
        raise ClutchestError(f"{folder}: cannot keep there what is trusted: {complaint}")
    return named


def trust_written(vehicle: Vehicle, path: Path) -> None:
    """Trust the file that ``vehicle`` was written to: the Python that it names runs already.

    Where that cannot be kept, the file's next use says so.
    """
    if vehicle.python_files:
        with suppress(ClutchestError):
            trust(path)


def trust_folder() -> Path:
    """``CLUTCHEST_TRUST`` if set, else a folder of the user's own data."""
    from platformdirs import user_data_path

    chosen = os.environ.get("CLUTCHEST_TRUST")
    return Path(chosen) if chosen else user_data_path("clutchest", appauthor=False) / "trusted"


def _is_trusted(content: str) -> bool:
    """Whether this user has said so; what others may have written there does not count."""
    return all(map(_own, (trust_folder(), trust_folder() / content)))


def _own(path: Path) -> bool:
    try:
        found = path.stat()
    except OSError:
        return False
    if not hasattr(os, "getuid"):  # folders of a user are the user's there
        return True
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
