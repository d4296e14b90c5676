"""Any result as files: in Python as the verbs write them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.paths import as_written
from clutchest.reading.table_formats import suffix_of, write_table, written_suffixes
from clutchest.reading.tables import write_signals
from clutchest.record.files import finished_into
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, dump_vehicle
from clutchest.vehicle.trust import trust_written

# class → what writes its folder, loaded for it alone
_FOLDERS = {
    "Run": ("clutchest.record.files", "write_run"),
    "Diagnosis": ("clutchest.record.diagnosis", "write_diagnosis"),
    "Discovery": ("clutchest.record.discovery", "write_discovery"),
    "Fit": ("clutchest.record.fit", "write_fit"),
    "Fleet": ("clutchest.fleet.files", "write_fleet"),
    "Feedforward": ("clutchest.record.feedforward", "write_feedforward"),
}


@checked
def save(result: Any, path: str | Path, **options: Any) -> list[Path]:
    """Write a ``result`` of ``clutchest``; gives the paths of the files written.

    A ``path`` with the suffix of a table (``.csv``, ``.parquet``, ``.xlsx``, ``.mf4``, ``.mcap``)
    gets the table alone, that of ``result.to_pandas()``.  Any other is a folder, for the files that
    the verb writes under ``--out``, with the ``options`` of the function that does, as
    ``formats=["csv"]`` of :func:`write_run`.  Signals are a table, a vehicle is one ``.toml``.

    Raises ClutchestError for a path that does not fit the result, OSError if the disk refuses.
    """
    path = as_written(path)
    if isinstance(result, Vehicle):
        if path.suffix != ".toml":
            raise ClutchestError(f"{path}: a vehicle is written as .toml")
        _without(options, path)
        written = _written(path, lambda place: dump_vehicle(result, place, target=path))
        trust_written(result, path)
        return written
    if isinstance(result, Signals):
        _without(options, path)
        return _written(path, lambda place: write_signals(result, place))
    home = _FOLDERS.get(type(result).__name__)
    if home is None:
        kinds = ", ".join(_FOLDERS)
        raise ClutchestError(
            f"expected Signals, a Vehicle or a result ({kinds}), not {type(result).__name__}"
        )
    if suffix_of(path) is not None:
        _without(options, path)
        return _written(path, lambda place: write_table(result.to_pandas(), place))
    if path.suffix[1:].isalpha() and not path.is_dir():
        suffixes = ", ".join(written_suffixes())
        raise ClutchestError(f"{path}: expected a folder, or a table's file ({suffixes})")
    paths: list[Path] = checked(getattr(import_module(home[0]), home[1]))(result, path, **options)
    return paths


def _without(options: Mapping[str, Any], path: Path) -> None:
    """Raises ClutchestError where one file is to be written, and options are those of a folder."""
    for name in options:
        raise ClutchestError(f"save: '{name}' is an option of a folder, not of the file {path}")


def _written(path: Path, write: Callable[[Path], None]) -> list[Path]:
    """A file at ``path``, and what is written beside it, finished before it is moved there."""
    if path.is_dir():
        raise ClutchestError(f"{path}: is a folder, expected a file")
    with finished_into(path.parent) as folder:
        write(folder / path.name)
        names = sorted(each.name for each in folder.iterdir())
    return [path.parent / name for name in names]
