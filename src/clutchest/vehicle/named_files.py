"""The files that a vehicle file names: DBCs, and Python that runs when the vehicle is used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from clutchest.can.database import DatabaseFile
from clutchest.errors import file_like
from clutchest.models.python_file import digest_of
from clutchest.shipped import shipped_file
from clutchest.vehicle.earlier_patch import EarlierPatch, read_patch
from clutchest.vehicle.toml import Keys, TomlFile

LARGEST_CHANNEL = 255


@dataclass(frozen=True, slots=True)
class NamedFiles:
    """``model`` the Python file of a user's own machine, ``effects`` those of effects, ``patches``
    files of an earlier version that are read and never run, ``dbc`` as paths or, where there is no
    such file yet, bare names.  ``digests`` of the content of what runs; ``content`` the SHA-256
    over the vehicle file and all that it names.
    """

    model: Path | None
    effects: tuple[Path, ...]
    patches: Mapping[Path, EarlierPatch]
    dbc: tuple[DatabaseFile, ...]
    digests: Mapping[Path, str]
    content: str

    @classmethod
    def of(cls, file: TomlFile) -> NamedFiles:
        """Those of one vehicle file.  Raises ClutchestError with file, line and key for Python
        that is not there, or not a ``.py`` below the vehicle file's folder."""
        data = file.data
        model = file.string(("model",), file.required("model"))
        own = _python(file, ("model",), model) if _is_path(model) else None
        entries = file.strings(("effects_files",), data.get("effects_files", []))
        effects = tuple(_python(file, ("effects_files",), entry) for entry in entries)
        read = {path: read_patch(path) for path in effects}
        patches = {path: patch for path, patch in read.items() if patch}
        dbc = _databases(file, data.get("dbc", []))
        code = [*([own] if own else []), *effects]
        digests = {path: digest_of(path) for path in code}
        total = sha256(file.text.encode())
        for path in (database.path for database in dbc):
            if path.is_file():
                total.update(digest_of(path).encode())
        for digest in digests.values():
            total.update(digest.encode())
        return cls(own, effects, patches, dbc, digests, total.hexdigest())

    @property
    def code(self) -> tuple[Path, ...]:
        """The files that run when the vehicle is used."""
        return tuple(path for path in self.digests if path not in self.patches)


def _is_path(model: str) -> bool:
    return model.endswith(".py") or "/" in model or "\\" in model


def _python(file: TomlFile, keys: Keys, entry: str) -> Path:
    """A Python file named relative to the vehicle file, and below it."""
    folder = file.path.parent.resolve()
    path = (folder / entry).resolve()
    if Path(entry).is_absolute() or not path.is_relative_to(folder):
        raise file.error(
            keys,
            f"{'.'.join(keys)}: '{entry}' is not below this vehicle file's folder; expected a "
            "relative path to a file there",
        )
    if path.suffix != ".py":
        raise file.error(
            keys, f"{'.'.join(keys)}: '{entry}' is no Python source, expected a file (.py)"
        )
    if not path.is_file():
        raise file.error(
            keys, f"no such file: {entry} (relative to this vehicle file){file_like(path)}"
        )
    return path


def _databases(file: TomlFile, given: Any) -> tuple[DatabaseFile, ...]:
    """The entries of ``dbc``: names of files, or tables of ``file`` and ``channel``."""
    if not isinstance(given, list):
        raise file.error(
            ("dbc",),
            'dbc must be a list of names, or of { file = "a.dbc", channel = 0 } where every '
            "channel has a database of its own",
        )
    found = []
    for entry in given:
        if isinstance(entry, str):
            found.append(DatabaseFile(_dbc(file, entry)))
            continue
        table = file.table(("dbc",), entry)
        file.known(("dbc",), table, ("file", "channel"), "key")
        for key in ("file", "channel"):
            if key not in table:
                raise file.error(("dbc",), f"an entry of dbc has no '{key}'")
        channel = file.integer(("dbc", "channel"), table["channel"], LARGEST_CHANNEL)
        found.append(DatabaseFile(_dbc(file, file.string(("dbc", "file"), table["file"])), channel))
    return tuple(found)


def _dbc(file: TomlFile, entry: str) -> Path:
    """Beside the file, else among the shipped, else the bare name for the log's folder."""
    beside = file.path.parent / entry
    if beside.is_file():
        return beside.resolve()
    found = shipped_file(entry, "dbc")
    return found.resolve() if found else Path(entry)
