"""Vehicle files: TOML read strictly, every error with file, line and key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.checked import checked
from clutchest.errors import ClutchestError, nearest
from clutchest.models import machine_in_file, machine_of
from clutchest.shipped import locate
from clutchest.vehicle.columns_section import read_columns
from clutchest.vehicle.curves import PATCH, read_curves
from clutchest.vehicle.discrepancy_sections import read_healthy_gains, read_smooth_errors
from clutchest.vehicle.effects_section import read_effects
from clutchest.vehicle.named_files import NamedFiles
from clutchest.vehicle.signals_section import read_signals
from clutchest.vehicle.toml import TomlFile
from clutchest.vehicle.trust import check_trusted
from clutchest.vehicle.vehicle import Estimation, ParameterValue, Vehicle, unlikely

if TYPE_CHECKING:
    from clutchest.models.machine import Machine
    from clutchest.models.symbols import Parameter, State

ROLES = ("adaptive", "constant", "nuisance")
MONITORS = ("false_alarms_per_1000h", "codes")
LARGEST_SPN, LARGEST_FMI = 524_287, 31
FEWEST_ALARMS = 1e-6  # per 1000 h

_TOP = (
    "name",
    "model",
    "dbc",
    "checked",
    "effects_files",
    "signals",
    "columns",
    "parameters",
    "effects",
    "effects_spread",
    "estimation",
    "healthy",
    "smooth_errors",
    "modes",
    "limits",
    "monitors",
)
_REQUIRED = ("name", "parameters")


@checked
def load_vehicle(v: Vehicle | str | Path, *, trust: bool = False) -> Vehicle:
    """The vehicle in the TOML file ``v``, or the shipped one of that name; a Vehicle is returned
    as it is.

    Units are checked and values converted to the model's own.  A file that names Python (a machine,
    effects) runs it only where the user has trusted its content (``clutchest trust``), or the
    program does: ``trust``.  Raises ClutchestError naming file, line and key, what was expected and
    the nearest valid key.
    """
    if isinstance(v, Vehicle):
        return v
    return _vehicle(TomlFile.read(locate(str(v), "vehicles").resolve()), trust)


def _vehicle(file: TomlFile, trust: bool) -> Vehicle:
    data = file.data
    file.known((), data, _TOP, "key")
    named = NamedFiles.of(file)
    if not trust:
        check_trusted(file, named)
    model = file.string(("model",), data["model"])
    machine = _machine(file, model, named)  # it says what else the file must have
    for key in _REQUIRED:
        file.required(key)
    if not {"signals", "columns"} & set(data):
        raise file.error((), "this vehicle file has no 'signals' (or 'columns', for tables)")
    limits = _section(file, "limits", machine.limits, f"limit of '{machine.name}'")
    thresholds = _section(
        file, "modes", machine.regimes.threshold_units, f"threshold of '{machine.name}'"
    )
    signals = read_signals(file, data, machine.units, machine.name)
    columns, signals = read_columns(file, machine, signals, load_vehicle)
    checked = file.strings(("checked",), data.get("checked", []))
    file.known(("checked",), checked, {s.bus.message for s in signals.values()}, "mapped message")
    parameters = _parameters(file, machine.parameters)
    curves = read_curves(file, machine, named.patches)
    own_effects = tuple(path for path in named.effects if path not in named.patches)
    of_patches = {name for patch in named.patches.values() for name in patch.effects}
    effects = read_effects(file, machine, named, parameters, of_patches)
    false_alarms, codes = _monitors(file)
    return Vehicle(
        name=file.string(("name",), data["name"]),
        model=model,
        path=file.path,
        hash=_digest(file, named.digests.values()),
        dbc=named.dbc,
        signals=signals,
        parameters=parameters,
        effects={name: {key: n.value for key, n in of.items()} for name, of in effects.items()},
        effects_spread={
            name: spread
            for name, of in effects.items()
            if (spread := {key: n.spread for key, n in of.items() if n.spread > 0.0})
        },
        estimation=_estimation(file, machine.states),
        healthy=read_healthy_gains(file, machine),
        smooth_errors=read_smooth_errors(file, machine),
        modes={key: quantity.value for key, quantity in thresholds.items()},
        limits=limits,
        monitors=false_alarms,
        codes=codes,
        effects_files=own_effects,
        curves=curves,
        notes=(
            *(f"{path.name}: {PATCH}" for path in named.patches),
            *(f"{file.path.name}: {words}" for words in unlikely(machine, parameters, signals)),
        ),
        checked=tuple(checked),
        model_file=named.model,
        digests=named.digests,
        columns=columns,
    )


def _digest(file: TomlFile, named: Iterable[str]) -> str:
    """Over the content of the vehicle file and of the Python files that it names."""
    return sha256("".join([file.text, *named]).encode()).hexdigest()


def _monitors(file: TomlFile) -> tuple[dict[str, float], dict[str, tuple[int, int | None]]]:
    """Numbers of ``[monitors]``, and fault → SPN and, where given, FMI."""
    table = file.table(("monitors",), file.data.get("monitors", {}))
    file.known(("monitors",), table, MONITORS, "key")
    numbers = {
        key: file.number(("monitors", key), value, FEWEST_ALARMS)
        for key, value in table.items()
        if key != "codes"
    }
    codes = {}
    for fault, value in file.table(("monitors", "codes"), table.get("codes", {})).items():
        keys = ("monitors", "codes", fault)
        entry = file.table(keys, value)
        file.known(keys, entry, ("spn", "fmi"), "key")
        if "spn" not in entry:
            raise file.error(keys, f"monitors.codes.{fault} has no 'spn'")
        spn = file.integer((*keys, "spn"), entry["spn"], LARGEST_SPN)
        fmi = file.integer((*keys, "fmi"), entry["fmi"], LARGEST_FMI) if "fmi" in entry else None
        codes[fault] = spn, fmi
    return numbers, codes


def _machine(file: TomlFile, model: str, named: NamedFiles) -> Machine:
    try:
        if named.model:
            return machine_in_file(named.model, named.digests[named.model])
        return machine_of(model)
    except ClutchestError as problem:
        own = file.path.with_name(f"{model}.py")
        hint = f'; the machine of {own.name} is named by its file: model = "{own.name}"'
        complaint = f"{problem}{hint if named.model is None and own.is_file() else ''}"
        raise file.error(("model",), complaint) from None


def _section(
    file: TomlFile, name: str, unit_of: Mapping[str, str], what: str
) -> dict[str, ParameterValue]:
    """A table of quantities whose keys and units are known."""
    table = file.table((name,), file.data.get(name, {}))
    file.known((name,), table, unit_of, what)
    return {
        key: file.quantity((name, key), value, unit_of[key], 0.0) for key, value in table.items()
    }


def _parameters(file: TomlFile, expected: Sequence[Parameter]) -> dict[str, ParameterValue]:
    table = file.table(("parameters",), file.data["parameters"])
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


def _estimation(file: TomlFile, states: Sequence[State]) -> dict[str, Estimation]:
    """Entries of the file; what one leaves out is the state's own."""
    table = file.table(("estimation",), file.data.get("estimation", {}))
    by_name = {state.name: state for state in states}
    file.known(("estimation",), table, by_name, "state")
    return {
        name: _estimation_of(file, by_name[name], file.table(("estimation", name), entry))
        for name, entry in table.items()
    }


def _estimation_of(file: TomlFile, state: State, entry: Mapping[str, Any]) -> Estimation:
    keys = ("estimation", state.name)
    file.known(keys, entry, [f.name for f in fields(Estimation)], "key")
    role = entry.get("role", state.role)
    if role not in ROLES:
        raise file.error((*keys, "role"), f"unknown role {role!r}" + nearest(str(role), ROLES))

    def number(key: str, default: float) -> float:
        return file.number((*keys, key), entry.get(key, default), 0.0)

    return Estimation(
        role,
        number("process_noise", state.process_noise),
        number("initial_std", state.initial_std),
        number("useful_std", state.useful_std),
        number("wander", state.wander),
    )
