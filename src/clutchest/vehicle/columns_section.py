"""``[columns]`` of a vehicle file: which column of a table is which canonical signal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from clutchest.budgets import LONGEST_DELAY_S
from clutchest.models.machine import Machine
from clutchest.vehicle.signals_section import SMALLEST, check_limits
from clutchest.vehicle.toml import TomlFile
from clutchest.vehicle.vehicle import TIMING, BusSignal, SignalMap, TableColumn, Vehicle

TIME = "time"
_PLACE = ("column", "unit")
_QUALITY = (
    "noise",
    "noise_ar",
    "noise_source",
    "delay",
    "delay_spread",
    "min",
    "max",
    "reference",
    "period",
)


def read_columns(
    file: TomlFile,
    machine: Machine,
    signals: dict[str, SignalMap],
    template: Callable[[str], Vehicle],
) -> tuple[dict[str, TableColumn], dict[str, SignalMap]]:
    """Canonical name (or ``time``) → column of a table, and ``signals`` with those that only
    tables have.

    A signal that ``[signals]`` maps as well takes noise and limits from there.  ``template`` loads
    the machine's shipped vehicle by name, where a noise is not stated.
    """
    table = file.table(("columns",), file.data.get("columns", {}))
    units_of = {TIME: "s", **machine.units}
    file.known(("columns",), table, units_of, f"signal of '{machine.name}'")
    columns, made = {}, dict(signals)
    known: dict[TableColumn, str] = {}
    for name, given in table.items():
        keys = ("columns", name)
        entry = {"column": given} if isinstance(given, str) else file.table(keys, given)
        elsewhere = name == TIME or name in signals
        file.known(keys, entry, _PLACE if elsewhere else (*_PLACE, *_QUALITY), "key")
        reference = _reference(file, name, entry, units_of[name])
        expected = "%" if reference is not None else units_of[name]
        stated = signals[name].bus.unit if name in signals else expected
        unit = file.unit((*keys, "unit"), entry["unit"], stated) if "unit" in entry else ""
        place = file.string((*keys, "column"), entry.get("column", name))
        columns[name] = TableColumn(place, unit)
        if (first := known.setdefault(columns[name], name)) != name:
            raise file.error(keys, f"columns.{name}: column '{place}' is columns.{first} already")
        if not elsewhere:
            like = None if "noise" in entry else _like(machine, name, template)
            made[name] = _signal(file, machine, name, entry, like)
            bus = BusSignal("", "", unit or expected)
            made[name] = replace(made[name], bus=bus, reference=reference)
    return columns, made


def _reference(file: TomlFile, name: str, entry: dict[str, Any], unit: str) -> float | None:
    """What 100 % of a column in percent stands for, in the ``unit`` of its signal."""
    if "reference" not in entry:
        return None
    return file.quantity(("columns", name, "reference"), entry["reference"], unit, SMALLEST).value


def _signal(
    file: TomlFile, machine: Machine, name: str, entry: dict[str, Any], like: SignalMap | None
) -> SignalMap:
    """A signal without a message; its noise is that of the machine's template unless stated."""
    keys = ("columns", name)

    def number(key: str, lower: float = -float("inf"), upper: float = float("inf")) -> Any:
        return file.number((*keys, key), entry[key], lower, upper) if key in entry else None

    if "noise" not in entry and like is None:
        raise file.error(keys, f"columns.{name} has no 'noise' (in {machine.units[name]})")
    stated = file.string((*keys, "noise_source"), entry.get("noise_source", "-"))
    source = "" if stated == "-" else stated
    if "noise" not in entry and like is not None:
        source = source or f"guess: the shipped {machine.template}'s"
        noise, noise_ar, spread = like.noise, like.noise_ar, like.delay_spread
    else:
        noise, noise_ar, spread = number("noise", 1e-12), 0.0, TIMING
    minimum, maximum = number("min"), number("max")
    check_limits(file, keys, minimum, maximum)
    return SignalMap(
        name,
        BusSignal("", "", ""),
        noise=noise,
        delay=number("delay", 0.0, LONGEST_DELAY_S) or 0.0,
        delay_spread=number("delay_spread", 1e-6, LONGEST_DELAY_S) or spread,
        noise_ar=number("noise_ar", -0.999, 0.999) if "noise_ar" in entry else noise_ar,
        noise_source=source,
        minimum=minimum,
        maximum=maximum,
        period=number("period", 1e-4),
    )


def _like(machine: Machine, name: str, template: Callable[[str], Vehicle]) -> SignalMap | None:
    """The same signal of the machine's shipped template; a signal that the equations do not use
    has any noise."""
    if machine.template and name in (signals := template(machine.template).signals):
        return signals[name]
    return SignalMap(name, BusSignal("", "", ""), 1.0) if name in machine.optional_columns else None
