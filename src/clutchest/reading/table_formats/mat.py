"""MATLAB's MAT files: vectors in the workspace or in structs, and the structs of its tools.

- vectors beside a ``time`` of the same length, units in a struct ``units``; structs within structs
- ``signal.time`` and ``signal.data`` (or ``values``)
- Simulink's structure with time: ``time``, ``signals(k).values``, ``.label``
- ControlDesk's: ``Y(k).Name``, ``.Data``, ``.XIndex``, ``.Unit`` over ``X(j).Data``
- matrices of two columns, time and value
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.reading.channel_groups import Array, Group, table_of
from clutchest.reading.mat_file import MARK_5, MARK_7_3, contents
from clutchest.reading.signal_table import SignalTable
from clutchest.reading.table_kind import TableKind

_DATA = ("data", "values", "value", "signal")
_PAIRS = 3  # samples at least of a matrix that is time and value


def read(path: Path) -> SignalTable:
    """The vectors of numbers in a file."""
    found = contents(path)
    groups = list(_groups(found, ""))
    if not groups:
        held = ", ".join(list(found)[:8]) or "objects only"
        raise ClutchestError(
            f"{path}: no vectors of numbers ({held}); expected vectors beside one called 'time', "
            "or structs of them; save timetables and timeseries as structs"
        )
    return table_of(str(path), groups, ".")


def _groups(struct: dict[str, Any], path: str) -> Iterator[Group]:
    """The groups of columns of one length in a struct and in those within it."""
    lower = {str(name).lower(): name for name in struct}
    if {"x", "y"} <= set(lower):
        yield from _of_controldesk(struct[lower["x"]], struct[lower["y"]], path)
        return
    if "time" in lower and "signals" in lower:
        yield from _of_simulink(struct[lower["time"]], struct[lower["signals"]], path)
        return
    data = next((lower[name] for name in _DATA if name in lower), None)
    if "time" in lower and data is not None and _is_vector(struct[data]):
        unit = next((_text(struct[lower[k]]) for k in ("unit", "units") if k in lower), "")
        time = struct[lower["time"]]
        if _is_vector(time) and len(time) == len(struct[data]):
            where = path or data
            yield Group({where: struct[data]}, {where: unit}, time)
            return
    lengths: dict[int, dict[str, Array]] = {}
    units = _units(struct.get(lower.get("units", "")), path)
    for name, value in struct.items():
        where = f"{path}.{name}" if path else name
        if isinstance(value, dict):
            yield from _groups(value, where)
        elif _is_vector(value):
            lengths.setdefault(len(value), {})[where] = value
        elif _is_pairs(value):
            yield Group({where: value[:, 1]}, units, value[:, 0])
    yield from (Group(columns, units) for columns in lengths.values())


def _units(given: Any, path: str) -> dict[str, str]:
    """Those that a struct ``units`` states, by the names of the vectors beside it."""
    stated = given if isinstance(given, dict) else {}
    names = {f"{path}.{name}" if path else name: unit for name, unit in stated.items()}
    return {name: unit for name, unit in names.items() if isinstance(unit, str)}


def _of_simulink(time: Any, signals: Any, path: str) -> Iterator[Group]:
    """``signals`` (one or a list) over one ``time``."""
    for number, each in enumerate(signals if isinstance(signals, list) else [signals]):
        values = each.get("values") if isinstance(each, dict) else None
        if not _is_vector(time) or not isinstance(values, np.ndarray):
            continue
        name = _text(each.get("label")) or f"signal_{number}"
        where = f"{path}.{name}" if path else name
        if values.ndim == 1 and len(values) == len(time):
            yield Group({where: values}, {}, time)
        elif values.ndim == 2 and len(values) == len(time):
            columns = {f"{where}_{k}": values[:, k] for k in range(values.shape[1])}
            yield Group(columns, {}, time)


def _of_controldesk(times: Any, signals: Any, path: str) -> Iterator[Group]:
    """Signals ``Y`` over those of ``X`` that they name by number."""
    axes: list[Any] = [each.get("Data") for each in _list(times) if isinstance(each, dict)]
    for each in _list(signals):
        if not isinstance(each, dict) or not _is_vector(each.get("Data")) or not axes:
            continue
        index = int(np.ravel(each.get("XIndex", 1))[0]) - 1
        time: Any = axes[index] if 0 <= index < len(axes) else None
        if _is_vector(time) and len(time) == len(each["Data"]):
            name = _text(each.get("Name")).strip('"') or "Y"
            where = f"{path}.{name}" if path else name
            yield Group({where: each["Data"]}, {where: _text(each.get("Unit"))}, time)


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""


def _is_vector(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 1 and len(value) > 1


def _is_pairs(value: Any) -> bool:
    """Whether a matrix is time, which rises, and a value."""
    return (
        isinstance(value, np.ndarray)
        and value.ndim == 2
        and value.shape[1] == 2
        and len(value) >= _PAIRS
        and bool(np.all(np.diff(value[:, 0]) >= 0.0))
    )


FORMAT = TableKind(
    about="MATLAB: vectors, structs, Simulink's and ControlDesk's structures; the extra for v7.3",
    suffixes=(".mat",),
    marks=(MARK_5, MARK_7_3),
    read=read,
    extra="mat",
)
