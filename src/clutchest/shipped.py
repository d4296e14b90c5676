"""The DBCs, vehicles and logs that are installed with the package."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from clutchest.errors import ClutchestError, alike, file_like
from clutchest.paths import as_written

MOST_NAMED = 3  # files in a folder that was given
_PACKAGE = Path(__file__).parent
# In the wheel they are inside the package; in a checkout at its top level.
_ROOTS = (_PACKAGE / "data", _PACKAGE.parents[1])


def shipped(kind: str) -> dict[str, Path]:
    """Name → path of every shipped file of ``kind`` (``dbc``, ``logs`` or ``vehicles``)."""
    for root in _ROOTS:
        folder = root / kind
        if folder.is_dir():
            return {p.name.split(".")[0]: p for p in sorted(folder.iterdir()) if p.is_file()}
    return {}


def shipped_file(name: str, kind: str) -> Path | None:
    """The shipped file of that name, with or without its suffix; None where there is none."""
    for stem, path in shipped(kind).items():
        if name in (stem, path.name):
            return path
    return None


def locate(name: str, kind: str, beside: tuple[Path, ...] = ()) -> Path:
    """The file ``name``: as a path, else in one of the folders ``beside``, else a shipped one.

    Raises ClutchestError, naming the nearest shipped file, where there is none.
    """
    if not name:
        raise ClutchestError("a file name is empty")
    direct = Path(name)
    for candidate in (direct, as_written(name), *(folder / direct for folder in beside)):
        if candidate.is_file():
            return candidate
    if found := shipped_file(name, kind):
        return found
    stock = shipped(kind)
    if direct.is_dir():
        named = "*.toml" if kind == "vehicles" else "[!.]*.*"
        inside = sorted(path for path in direct.glob(named) if path.is_file())
        such = f" such as {' or '.join(map(str, inside[:MOST_NAMED]))}" if inside else ""
        whole = "; clutchest fleet takes whole folders" if kind == "logs" else ""
        raise ClutchestError(f"{name}: is a folder, expected a file{such}{whole}")
    hint = file_like(direct, stock) or alike(direct.name.split(".")[0], stock)
    hint = hint or (f"; shipped {kind}: {', '.join(stock)}" if stock else "")
    raise ClutchestError(f"no such file: {name}{hint}")


def locate_each(names: Iterable[str], kind: str) -> list[Path]:
    """The files of these ``names``.  Raises ClutchestError where one is given twice, too."""
    once: dict[Path, Path] = {}
    for path in (locate(name, kind) for name in names):
        if path.resolve() in once:
            raise ClutchestError(f"{path}: given twice; expected each log once")
        once[path.resolve()] = path
    return list(once.values())
