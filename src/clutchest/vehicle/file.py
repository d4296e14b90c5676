"""Vehicle files: TOML read strictly, every complaint with file, line and key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from hashlib import sha256
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError, nearest
from clutchest.models import machine_in_file, machine_of
from clutchest.models.thresholds import THRESHOLD_UNITS
from clutchest.shipped import locate, shipped
from clutchest.vehicle.toml import Keys, TomlFile
from clutchest.vehicle.vehicle import BusSignal, Estimation, ParameterValue, SignalMap, Vehicle

if TYPE_CHECKING:
    from clutchest.models.effects import Effect
    from clutchest.models.machine import Machine

ROLES = ("adaptive", "constant", "nuisance")
MONITORS = ("false_alarms_per_1000h", "codes")
LARGEST_SPN, LARGEST_FMI = 524_287, 31

_TOP = (
    "name",
    "model",
    "dbc",
    "checked",
    "effects_files",
    "signals",
    "parameters",
    "effects",
    "effects_spread",
    "estimation",
    "modes",
    "limits",
    "monitors",
)
_SIGNAL = (
    "message",
    "signal",
    "unit",
    "noise",
    "delay",
    "noise_ar",
    "noise_source",
    "reference",
    "fraction",
    "friction",
    "gears",
    "gear",
    "other",
    "min",
    "max",
    "source_address",
    "channel",
    "period",
)
_BUS = ("message", "signal", "unit")


def load_vehicle(v: str | Path | Vehicle) -> Vehicle:
    """The vehicle in the TOML file ``v``, or the shipped one of that name.

    Units are checked and values converted to the model's own.  Raises ClutchestError naming file,
    line and key, what was expected and the nearest valid key.
    """
    if isinstance(v, Vehicle):  # what is loaded already may stand where a name may
        return v
    file = TomlFile.read(locate(str(v), "vehicles").resolve())
    return _vehicle(file, file.data)


def _vehicle(file: TomlFile, data: dict[str, Any]) -> Vehicle:
    file.known((), data, _TOP, "key")
    for key in ("name", "model", "signals", "parameters"):
        if key not in data:
            raise file.error((), f"no '{key}' in this vehicle file")
    name, model = (file.string((key,), data[key]) for key in ("name", "model"))
    model_file = _beside(file, ("model",), model) if model.endswith(".py") else None
    machine = _machine(file, model, model_file)
    effects_files = tuple(
        _beside(file, ("effects_files",), entry)
        for entry in file.strings(("effects_files",), data.get("effects_files", []))
    )
    modes = _section(file, data, "modes", THRESHOLD_UNITS, "threshold")
    limits = _section(file, data, "limits", machine.limits, "limit")
    signals = _signals(file, file.table(("signals",), data["signals"]), machine)
    checked = file.strings(("checked",), data.get("checked", []))
    file.known(("checked",), checked, {s.bus.message for s in signals.values()}, "mapped message")
    digest = sha256(file.text.encode())
    for named in (*effects_files, *([model_file] if model_file else [])):
        digest.update(named.read_bytes())
    monitors = file.table(("monitors",), data.get("monitors", {}))
    file.known(("monitors",), monitors, MONITORS, "key")
    parameters = _parameters(
        file, file.table(("parameters",), data["parameters"]), machine.parameters
    )
    effects = _effects(file, data, machine, effects_files, parameters)
    return Vehicle(
        name=name,
        model=model,
        path=file.path,
        hash=digest.hexdigest(),
        dbc=tuple(_dbc(file, entry) for entry in file.strings(("dbc",), data.get("dbc", []))),
        signals=signals,
        parameters=parameters,
        effects={name: {key: n.value for key, n in of.items()} for name, of in effects.items()},
        effects_spread={
            name: spread
            for name, of in effects.items()
            if (spread := {key: n.spread for key, n in of.items() if n.spread > 0.0})
        },
        estimation=_estimation(file, data, machine.states),
        modes={key: quantity.value for key, quantity in modes.items()},
        limits=limits,
        monitors={
            key: file.number(("monitors", key), value, 1e-6)
            for key, value in monitors.items()
            if key != "codes"
        },
        codes=_codes(file, file.table(("monitors", "codes"), monitors.get("codes", {}))),
        effects_files=effects_files,
        checked=tuple(checked),
        model_file=model_file,
    )


def _codes(file: TomlFile, table: dict[str, Any]) -> dict[str, tuple[int, int | None]]:
    """Fault → SPN and, where given, FMI."""
    codes = {}
    for fault, value in table.items():
        keys = ("monitors", "codes", fault)
        entry = file.table(keys, value)
        file.known(keys, entry, ("spn", "fmi"), "key")
        if "spn" not in entry:
            raise file.error(keys, f"monitors.codes.{fault} has no 'spn'")
        spn = file.integer((*keys, "spn"), entry["spn"], LARGEST_SPN)
        fmi = file.integer((*keys, "fmi"), entry["fmi"], LARGEST_FMI) if "fmi" in entry else None
        codes[fault] = spn, fmi
    return codes


def _machine(file: TomlFile, model: str, model_file: Path | None) -> Machine:
    try:
        return machine_in_file(model_file) if model_file else machine_of(model)
    except ClutchestError as problem:
        raise file.error(("model",), str(problem)) from None


def _dbc(file: TomlFile, entry: str) -> Path:
    """Beside the file, else among the shipped, else the bare name for the log's folder."""
    beside = file.path.parent / entry
    if beside.is_file():
        return beside.resolve()
    for path in shipped("dbc").values():
        if path.name == entry:
            return path.resolve()
    return Path(entry)


def _beside(file: TomlFile, keys: Keys, entry: str) -> Path:
    path = (file.path.parent / entry).resolve()
    if not path.is_file():
        raise file.error(keys, f"no such file: {entry} (relative to this vehicle file)")
    return path


def _section(
    file: TomlFile, data: Mapping[str, Any], name: str, unit_of: Mapping[str, str], what: str
) -> dict[str, ParameterValue]:
    """A table of quantities whose keys and units are known."""
    table = file.table((name,), data.get(name, {}))
    file.known((name,), table, unit_of, what)
    return {
        key: file.quantity((name, key), value, unit_of[key], 0.0) for key, value in table.items()
    }


def _signals(file: TomlFile, table: dict[str, Any], machine: Machine) -> dict[str, SignalMap]:
    columns = machine.units
    file.known(("signals",), table, columns, f"signal of '{machine.name}'")
    return {
        name: _signal(file, name, file.table(("signals", name), entry), columns[name])
        for name, entry in table.items()
    }


def _signal(file: TomlFile, name: str, entry: dict[str, Any], column_unit: str) -> SignalMap:
    keys = ("signals", name)
    file.known(keys, entry, _SIGNAL, "key")
    for key in ("message", "signal", "unit", "noise"):
        if key not in entry:
            raise file.error(keys, f"signals.{name} has no '{key}'")

    def number(key: str, lower: float = -inf, upper: float = inf) -> float | None:
        return file.number((*keys, key), entry[key], lower, upper) if key in entry else None

    def integer(key: str, upper: int) -> int | None:
        return file.integer((*keys, key), entry[key], upper) if key in entry else None

    def needs(key: str, other: str) -> None:
        if key in entry and other not in entry:
            raise file.error((*keys, key), f"signals.{name}.{key} needs '{other}' beside it")

    reference = None
    if "reference" in entry:
        reference = file.quantity((*keys, "reference"), entry["reference"], "Nm", 1e-3).value
        if column_unit != "Nm":
            raise file.error(
                (*keys, "reference"),
                f"'reference' makes a torque (Nm) of percent; {name} is in {column_unit}",
            )
    for key in ("fraction", "friction"):
        needs(key, "reference")
    for key in ("gear", "other"):
        needs(key, "gears")
    unit = file.unit((*keys, "unit"), entry["unit"], "%" if reference else column_unit)
    message, name_on_bus = (file.string((*keys, key), entry[key]) for key in ("message", "signal"))
    bus = BusSignal(message, name_on_bus, unit)

    def companion(key: str, expected: str, unit: str) -> BusSignal | None:
        return (
            _companion(file, (*keys, key), entry[key], bus, expected, unit)
            if key in entry
            else None
        )

    noise_ar = number("noise_ar", -1.0, 1.0) or 0.0
    if abs(noise_ar) == 1.0:
        raise file.error((*keys, "noise_ar"), f"signals.{name}.noise_ar must be smaller than 1")
    minimum, maximum = number("min"), number("max")
    if minimum is not None and maximum is not None and minimum >= maximum:
        raise file.error(
            (*keys, "min"), f"signals.{name}: min {minimum:g} is not below max {maximum:g}"
        )
    return SignalMap(
        name,
        bus,
        noise=number("noise", 1e-12) or 0.0,
        delay=number("delay", 0.0) or 0.0,
        noise_ar=noise_ar,
        noise_source=file.string((*keys, "noise_source"), entry["noise_source"])
        if "noise_source" in entry
        else "",
        reference=reference,
        fraction=companion("fraction", "%", unit),
        friction=companion("friction", "%", unit),
        gears=_gears(file, (*keys, "gears"), entry["gears"]) if "gears" in entry else (),
        gear=companion("gear", "1", "1"),
        other=companion("other", column_unit, unit),
        minimum=minimum,
        maximum=maximum,
        source_address=integer("source_address", 253),
        channel=integer("channel", 255),
        period=number("period", 1e-4),
    )


def _companion(
    file: TomlFile, keys: Keys, value: Any, bus: BusSignal, expected: str, unit: str
) -> BusSignal:
    """A second bus signal: the same message and unit as the first unless it says otherwise."""
    entry = file.table(keys, value)
    file.known(keys, entry, _BUS, "key")
    if "signal" not in entry:
        raise file.error(keys, f"{'.'.join(keys)} has no 'signal'")
    return BusSignal(
        file.string((*keys, "message"), entry.get("message", bus.message)),
        file.string((*keys, "signal"), entry["signal"]),
        file.unit((*keys, "unit"), entry.get("unit", unit), expected),
    )


def _gears(file: TomlFile, keys: Keys, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or not value:
        raise file.error(keys, f"{'.'.join(keys)} must be a list of ratios engine/wheel")
    gears = tuple(file.number(keys, ratio, 1e-3) for ratio in value)
    if any(lower >= higher for higher, lower in pairwise(gears)):
        raise file.error(keys, f"{'.'.join(keys)} must fall from the first gear to the last")
    return gears


def _parameters(
    file: TomlFile, table: dict[str, Any], expected: Iterable[Any]
) -> dict[str, ParameterValue]:
    by_key = {parameter.key: parameter for parameter in expected}
    file.known(("parameters",), table, by_key, "parameter")
    values = {}
    for key, p in by_key.items():
        if key not in table:
            raise file.error(
                ("parameters",), f"parameter '{key}' ({p.what}, in {p.unit}) is missing"
            )
        values[key] = file.quantity(("parameters", key), table[key], p.unit, p.lower, p.upper)
    return values


def _effects(
    file: TomlFile,
    data: Mapping[str, Any],
    machine: Machine,
    effects_files: tuple[Path, ...],
    parameters: Mapping[str, Any],
) -> dict[str, dict[str, ParameterValue]]:
    table = file.table(("effects",), data.get("effects", {}))
    stated = file.table(("effects_spread",), data.get("effects_spread", {}))
    file.known(("effects_spread",), stated, table, "effect of [effects]")
    if not table and not effects_files:
        return {}
    from clutchest.models.effects import effects_of_file

    known = dict(machine.effects)
    for path in effects_files:
        known |= effects_of_file(path)
    if own := [name for name in table if name in known and name not in machine.effects]:
        from clutchest.models.validate_effect import why_invalid

        values = {key: quantity.value for key, quantity in parameters.items()}
        for name in own:
            if wrong := why_invalid(known[name], machine, values):
                raise file.error(("effects", name), f"effect '{name}' {wrong}")
    file.known(("effects",), table, known, f"effect of '{machine.name}'")
    return {
        name: _stated(file, known[name], value, stated.get(name, {}))
        for name, value in table.items()
    }


def _stated(file: TomlFile, effect: Effect, value: Any, spread: Any) -> dict[str, ParameterValue]:
    """The numbers of one effect, and how far its gains may be off."""
    at, off = ("effects", effect.name), ("effects_spread", effect.name)
    entry, stated = file.table(at, value), file.table(off, spread)
    numbers = {number.key: number for number in effect.parameters}
    file.known(at, entry, numbers, f"parameter of effect '{effect.name}'")
    found = {
        key: file.quantity((*at, key), given, numbers[key].unit, numbers[key].least)
        for key, given in entry.items()
    }
    file.known(off, stated, found, f"number in [effects] of '{effect.name}'")
    for key, given in stated.items():
        std = file.quantity((*off, key), given, numbers[key].unit, 0.0).value
        found[key] = replace(found[key], spread=std)
    for key in found:
        if found[key].spread > 0.0 and numbers[key].shape:
            raise file.error(
                (*(off if key in stated else at), key),
                f"{effect.name}.{key} is a shape and takes no spread",
            )
    return found


def _estimation(
    file: TomlFile, data: Mapping[str, Any], expected: Iterable[Any]
) -> dict[str, Estimation]:
    """Entries of the file; what one leaves out is the model's own."""
    table = file.table(("estimation",), data.get("estimation", {}))
    states = {state.name: state for state in expected}
    file.known(("estimation",), table, states, "state")
    settings = {}
    for name, value in table.items():
        keys, state = ("estimation", name), states[name]
        entry = file.table(keys, value)
        file.known(keys, entry, [f.name for f in fields(Estimation)], "key")
        role = entry.get("role", state.role)
        if role not in ROLES:
            raise file.error((*keys, "role"), f"unknown role {role!r}" + nearest(str(role), ROLES))

        def number(
            key: str, default: float, entry: Mapping[str, Any] = entry, keys: Keys = keys
        ) -> float:
            return file.number((*keys, key), entry.get(key, default), 0.0)

        settings[name] = Estimation(
            role,
            number("process_noise", state.process_noise),
            number("initial_std", state.initial_std),
            number("useful_std", state.useful_std),
        )
    return settings
