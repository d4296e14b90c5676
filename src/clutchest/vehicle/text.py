"""Vehicles written as complete TOML files, which ``load_vehicle`` reads back equal."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from hashlib import sha256
from pathlib import Path
from typing import Any

from clutchest.can.database import DatabaseFile
from clutchest.errors import ClutchestError
from clutchest.models.error_curve import ErrorCurve
from clutchest.paths import readable
from clutchest.shipped import shipped
from clutchest.vehicle.vehicle import BusSignal, SignalMap, Vehicle


def dump_vehicle(
    vehicle: Vehicle, path: str | Path, heading: str = "", target: Path | None = None
) -> None:
    """Write ``vehicle`` as a complete file; ``load_vehicle`` reads it back equal.

    ``heading`` becomes comment lines at the top.  DBCs that do not travel with the package are
    named relative to the new file; Python files that do not lie below it are copied beside it.
    ``target``: where it will lie in the end, if not at ``path``.  Raises ClutchestError for a
    Python file that was changed since the vehicle was loaded.
    """
    path = Path(path)
    target = path if target is None else target
    text = vehicle_text(vehicle, target, heading)
    if text != readable(text):
        raise ClutchestError(
            f"{target}: a vehicle file cannot name a file whose path from there is not UTF-8"
        )
    path.write_text(text, encoding="utf-8")
    for source, name in _copies(vehicle, target).items():
        content, digest = source.read_bytes(), vehicle.digests.get(source)
        if digest and sha256(content).hexdigest() != digest:
            raise ClutchestError(f"{source}: was changed after its vehicle was loaded")
        (path.parent / name).write_bytes(content)


def _copies(vehicle: Vehicle, target: Path) -> dict[Path, str]:
    """Python file → the name of its copy beside ``target``, of those that do not lie below it; no
    other file of that name is overwritten."""
    folder = target.resolve().parent
    names: dict[Path, str] = {}
    for path in vehicle.python_files:
        if path.resolve().is_relative_to(folder):
            continue
        content, name = path.read_bytes(), path.name
        there = folder / name
        if name in names.values() or (there.exists() and there.read_bytes() != content):
            name = f"{path.stem}_{sha256(content).hexdigest()[:8]}.py"
        names[path] = name
    return names


def vehicle_text(vehicle: Vehicle, target: Path, heading: str = "") -> str:
    """``vehicle`` as TOML, for a file at ``target``."""
    stock = {path.resolve() for path in shipped("dbc").values()}
    folder, copies = target.resolve().parent, _copies(vehicle, target)

    def name(path: Path) -> str:
        if path in copies:
            return copies[path]
        if not path.is_absolute() or path in stock:
            return path.name if path in stock else path.as_posix()
        try:
            return Path(os.path.relpath(path, folder)).as_posix()
        except ValueError:  # another drive
            return path.as_posix()

    lines = [f"# {line}".rstrip() for line in heading.splitlines()]
    lines += [
        f"name = {_toml(vehicle.name)}",
        f"model = {_toml(name(vehicle.model_file) if vehicle.model_file else vehicle.model)}",
        f"dbc = {_toml([_database(file, name(file.path)) for file in vehicle.dbc])}",
    ]
    if vehicle.checked:
        lines.append(f"checked = {_toml(list(vehicle.checked))}")
    if vehicle.effects_files:
        lines.append(f"effects_files = {_toml([name(path) for path in vehicle.effects_files])}")
    on_bus = {key: signal for key, signal in vehicle.signals.items() if signal.on_bus}
    for key, signal in on_bus.items():
        lines += ["", f"[signals.{key}]", *(f"{k} = {_toml(v)}" for k, v in _entry(signal))]

    def section(title: str, table: Mapping[str, Any], entry: Callable[[Any], Any]) -> None:
        if table:
            lines.extend(["", f"[{title}]"])
            lines.extend(f"{key} = {_toml(entry(value))}" for key, value in table.items())

    def record(item: Any) -> dict[str, Any]:
        return {
            f.name: value for f in fields(item) if (value := getattr(item, f.name)) != f.default
        }

    section("columns", {key: _column(key, vehicle) for key in vehicle.columns}, dict)
    section("parameters", vehicle.parameters, record)
    section("effects", vehicle.effects, dict)
    for key, curve in vehicle.curves.items():
        lines += ["", f"[effects.{key}]", *_curve(curve)]
    section("effects_spread", vehicle.effects_spread, dict)
    section("estimation", vehicle.estimation, record)
    section("healthy", _healthy(vehicle), dict)
    for term, over in _smooth_errors(vehicle).items():
        section(f"smooth_errors.{_toml(term)}", over, dict)
    section("modes", vehicle.modes, float)
    section("limits", vehicle.limits, record)
    section("monitors", vehicle.monitors, float)
    section("monitors.codes", _codes(vehicle), dict)
    return "\n".join(lines) + "\n"


def _database(file: DatabaseFile, name: str) -> str | dict[str, Any]:
    """One entry of ``dbc``."""
    return name if file.channel is None else {"file": name, "channel": file.channel}


def _healthy(vehicle: Vehicle) -> dict[str, dict[str, float]]:
    """Effect → gain → how far it goes in a healthy vehicle; 0 of unmodelled parts that it has not,
    which a file that is silent would have."""
    parts = vehicle.machine.unmodelled.items()
    table = {name: {gain.key: 0.0 for gain in effect.gains} for name, effect in parts}
    for gain in vehicle.healthy:
        table.setdefault(gain.effect, {})[gain.key] = gain.std
    return table


def _smooth_errors(vehicle: Vehicle) -> dict[str, dict[str, dict[str, float]]]:
    """Error term → covariate → what is stated of its error."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for error in vehicle.smooth_errors:
        stated = {"std": error.std, "length": error.length}
        table.setdefault(error.error_term, {})[error.covariate] = stated
    return table


def _codes(vehicle: Vehicle) -> dict[str, dict[str, int]]:
    """Fault, quoted as names have colons, → its SPN and, where stated, FMI."""
    return {
        _toml(fault): {"spn": spn} | ({} if fmi is None else {"fmi": fmi})
        for fault, (spn, fmi) in vehicle.codes.items()
    }


def _entry(signal: SignalMap) -> Iterable[tuple[str, Any]]:
    """Keys and values of one ``[signals.…]`` table, defaults left out."""
    yield from _bus(signal.bus).items()
    for f in fields(SignalMap)[2:]:
        value = getattr(signal, f.name)
        if value == f.default:
            continue
        key = {"minimum": "min", "maximum": "max"}.get(f.name, f.name)
        yield key, _bus(value) if isinstance(value, BusSignal) else value


def _column(name: str, vehicle: Vehicle) -> dict[str, Any]:
    """One entry of ``[columns]``, with what is stated nowhere else."""
    place = vehicle.columns[name]
    entry: dict[str, Any] = {"column": place.column, **({"unit": place.unit} if place.unit else {})}
    signal = vehicle.signals.get(name)
    if signal is not None and not signal.on_bus:
        entry |= {key: value for key, value in _entry(signal) if key not in (*_bus(signal.bus),)}
    return entry


def _curve(curve: ErrorCurve) -> Iterable[str]:
    """The lines of one ``[effects.curve_1]`` table."""
    for key in ("error_term", "covariate", "knots", "values"):
        yield f"{key} = {_toml(getattr(curve, key))}"
    if curve.covariance:
        yield from ("covariance = [", *(f"    {_toml(row)}," for row in curve.covariance), "]")


def _bus(signal: BusSignal) -> dict[str, str]:
    return {"message": signal.message, "signal": signal.signal, "unit": signal.unit}


def _toml(value: Any) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda m: f"\\u{ord(m[0]):04x}", escaped) + '"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, float):
        return repr(float(value))  # numpy's floats print otherwise
    return repr(value)
