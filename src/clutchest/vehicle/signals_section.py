"""``[signals.NAME]`` of a vehicle file: which bus signals make which canonical one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Any

from clutchest import units
from clutchest.budgets import LONGEST_DELAY_S
from clutchest.errors import ClutchestError
from clutchest.vehicle.named_files import LARGEST_CHANNEL
from clutchest.vehicle.toml import Keys, TomlFile
from clutchest.vehicle.vehicle import FORCE, SPEED, TIMING, BusSignal, SignalMap

LARGEST_ADDRESS = 253  # J1939 keeps the addresses above
LARGEST_GEAR = 255
SMALLEST = 1e-9  # that 100 % may stand for

_KEYS = (
    "message",
    "signal",
    "unit",
    "noise",
    "delay",
    "delay_spread",
    "noise_ar",
    "noise_source",
    "reference",
    "reference_source",
    "fraction",
    "friction",
    "gears",
    "radius",
    "gear",
    "gear_numbers",
    "other",
    "less",
    "min",
    "max",
    "source_address",
    "channel",
    "period",
)
_REQUIRED = ("message", "signal", "unit", "noise")
_COMPANION = ("message", "signal", "unit")
_REQUIRES = {
    "fraction": "reference",
    "friction": "reference",
    "reference_source": "reference",
    "gear": "gears",
    "gear_numbers": "gear",
    "other": "gears",
}


def read_signals(
    file: TomlFile, data: Mapping[str, Any], columns: Mapping[str, str], machine: str
) -> dict[str, SignalMap]:
    """Canonical name → how the bus makes it.  ``columns``: canonical name → unit of the
    ``machine``."""
    table = file.table(("signals",), data.get("signals", {}))
    file.known(("signals",), table, columns, f"signal of '{machine}'")
    return {
        name: _signal(_Entry(file, name, file.table(("signals", name), entry), columns[name]))
        for name, entry in table.items()
    }


@dataclass(frozen=True, slots=True)
class _Entry:
    """One ``[signals.NAME]`` table; ``unit`` of the canonical signal."""

    file: TomlFile
    name: str
    table: Mapping[str, Any]
    unit: str

    def keys(self, key: str) -> Keys:
        return ("signals", self.name, key)

    def error(self, key: str, complaint: str) -> ClutchestError:
        return self.file.error(self.keys(key), complaint)

    def number(self, key: str, lower: float = -inf, upper: float = inf) -> float | None:
        value = self.table.get(key)
        return None if value is None else self.file.number(self.keys(key), value, lower, upper)

    def integer(self, key: str, upper: int) -> int | None:
        value = self.table.get(key)
        return None if value is None else self.file.integer(self.keys(key), value, upper)

    def string(self, key: str, default: str = "") -> str:
        value = self.table.get(key)
        return default if value is None else self.file.string(self.keys(key), value)

    def check_keys(self) -> None:
        """Known keys only, the required ones, and those that others require."""
        keys = ("signals", self.name)
        self.file.known(keys, self.table, _KEYS, "key")
        for key in _REQUIRED:
            if key not in self.table:
                raise self.file.error(keys, f"signals.{self.name} has no '{key}'")
        for key, other in _REQUIRES.items():
            if key in self.table and other not in self.table:
                raise self.error(key, f"signals.{self.name}.{key} requires '{other}' beside it")


def _signal(entry: _Entry) -> SignalMap:
    entry.check_keys()
    reference, radius = _reference(entry), _radius(entry)
    expected = entry.unit if reference is None else "%"
    expected = expected if radius is None else _through_radius(entry)
    if radius is None and "gears" in entry.table and _is_speed(entry.table["unit"]):
        raise entry.error(
            "unit",
            f"signals.{entry.name} is in {entry.table['unit']}; with 'radius', the tyre's rolling "
            f"radius (m), it becomes a wheel speed in {entry.unit}",
        )
    if reference is not None and entry.table["unit"] != "%":
        words = f"says what 100 % stands for, and signals.{entry.name} is not in %"
        raise entry.error("reference", f"signals.{entry.name}.reference {words}")
    unit = entry.file.unit(entry.keys("unit"), entry.table["unit"], expected)
    bus = BusSignal(entry.string("message"), entry.string("signal"), unit)
    minimum, maximum = _limits(entry)
    return SignalMap(
        entry.name,
        bus,
        noise=entry.number("noise", 1e-12) or 0.0,
        delay=entry.number("delay", 0.0, LONGEST_DELAY_S) or 0.0,
        delay_spread=entry.number("delay_spread", 1e-6, LONGEST_DELAY_S) or TIMING,
        noise_ar=_noise_ar(entry),
        noise_source=entry.string("noise_source"),
        reference=reference,
        reference_source=entry.string("reference_source"),
        fraction=_companion(entry, "fraction", bus, "%", unit),
        friction=_companion(entry, "friction", bus, "%", unit),
        gears=_gears(entry),
        radius=radius,
        gear=_companion(entry, "gear", bus, "1", "1"),
        gear_numbers=_gear_numbers(entry),
        other=_companion(entry, "other", bus, expected, unit),
        less=_less(entry, bus, expected, unit),
        minimum=minimum,
        maximum=maximum,
        source_address=entry.integer("source_address", LARGEST_ADDRESS),
        channel=entry.integer("channel", LARGEST_CHANNEL),
        period=entry.number("period", 1e-4),
    )


def _reference(entry: _Entry) -> float | None:
    """What 100 % stands for, in the canonical unit."""
    if "reference" not in entry.table:
        return None
    if units.compatible(entry.unit, "%") or "gears" in entry.table:
        what = "a wheel speed" if "gears" in entry.table else f"in {entry.unit}"
        raise entry.error(
            "reference",
            f"'reference' converts percent to another unit; signals.{entry.name} is {what}",
        )
    return entry.file.quantity(
        entry.keys("reference"), entry.table["reference"], entry.unit, SMALLEST
    ).value


def _radius(entry: _Entry) -> float | None:
    """Rolling radius of the tyres, m, by which a speed of the road is one of the wheels, and their
    force a torque."""
    if "radius" not in entry.table:
        return None
    return entry.file.quantity(entry.keys("radius"), entry.table["radius"], "m", 1e-2, 10.0).value


def _through_radius(entry: _Entry) -> str:
    """Unit of what becomes the canonical signal through the tyres' radius."""
    if entry.unit == "Nm":
        if "reference" in entry.table:
            raise entry.error(
                "radius", "'radius' makes a force a torque, 'reference' percent: one of them"
            )
        return FORCE
    if "gears" not in entry.table:
        raise entry.error("radius", f"signals.{entry.name}.radius requires 'gears' beside it")
    return SPEED


def _less(entry: _Entry, bus: BusSignal, expected: str, unit: str) -> BusSignal | None:
    """The signal that is subtracted, of a torque that is the difference of two."""
    if "less" in entry.table and (entry.unit != "Nm" or "reference" in entry.table):
        raise entry.error("less", "'less' is for a torque that two signals in Nm or N make")
    return _companion(entry, "less", bus, expected, unit)


def _is_speed(unit: object) -> bool:
    try:
        return isinstance(unit, str) and units.compatible(unit, SPEED)
    except ClutchestError:
        return False


def _noise_ar(entry: _Entry) -> float:
    noise_ar = entry.number("noise_ar", -1.0, 1.0) or 0.0
    if abs(noise_ar) == 1.0:
        raise entry.error("noise_ar", f"signals.{entry.name}.noise_ar must be smaller than 1")
    return noise_ar


def _limits(entry: _Entry) -> tuple[float | None, float | None]:
    """Lowest and highest valid value, bus unit."""
    minimum, maximum = entry.number("min"), entry.number("max")
    check_limits(entry.file, ("signals", entry.name), minimum, maximum)
    return minimum, maximum


def check_limits(file: TomlFile, keys: Keys, minimum: float | None, maximum: float | None) -> None:
    """Raises ClutchestError where no value can lie between both."""
    if minimum is not None and maximum is not None and minimum >= maximum:
        words = f"{'.'.join(keys)}: min {minimum:g} is not below max {maximum:g}"
        raise file.error((*keys, "min"), words)


def _companion(
    entry: _Entry, key: str, bus: BusSignal, expected: str, unit: str
) -> BusSignal | None:
    """A second bus signal: the same message as ``bus`` and this ``unit`` unless it states others;
    its unit must convert to the ``expected`` one."""
    if key not in entry.table:
        return None
    file, keys = entry.file, entry.keys(key)
    table = file.table(keys, entry.table[key])
    file.known(keys, table, _COMPANION, "key")
    if "signal" not in table:
        raise file.error(keys, f"{'.'.join(keys)} has no 'signal'")
    return BusSignal(
        file.string((*keys, "message"), table.get("message", bus.message)),
        file.string((*keys, "signal"), table["signal"]),
        file.unit((*keys, "unit"), table.get("unit", unit), expected),
    )


def _gears(entry: _Entry) -> tuple[float, ...]:
    if "gears" not in entry.table:
        return ()
    keys, value = entry.keys("gears"), entry.table["gears"]
    if not isinstance(value, list) or not value:
        raise entry.error("gears", f"{'.'.join(keys)} must be a list of ratios engine/wheel")
    gears = tuple(entry.file.number(keys, ratio, 1e-3) for ratio in value)
    if any(lower >= higher for higher, lower in pairwise(gears)):
        raise entry.error("gears", f"{'.'.join(keys)} must fall from the first gear to the last")
    return gears


def _gear_numbers(entry: _Entry) -> tuple[int, ...]:
    """What the signal of the gear has in each of ``gears``."""
    if "gear_numbers" not in entry.table:
        return ()
    keys, value = entry.keys("gear_numbers"), entry.table["gear_numbers"]
    if not isinstance(value, list) or len(value) != len(_gears(entry)):
        raise entry.error(
            "gear_numbers", f"{'.'.join(keys)} must be a list with a number for each of 'gears'"
        )
    numbers = tuple(entry.file.integer(keys, number, LARGEST_GEAR) for number in value)
    if any(lower >= higher for lower, higher in pairwise(numbers)):
        raise entry.error(
            "gear_numbers", f"{'.'.join(keys)} must rise from the first gear to the last"
        )
    return numbers
