"""Whether the values of a column fit its unit; where they do not, which unit they fit.

A table states no range as a DBC does, nor does a DBC always state a unit, and a wrong one gives
wrong estimates without a sign of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from clutchest import units
from clutchest.can.database import Database
from clutchest.errors import ClutchestError
from clutchest.models.symbols import Column
from clutchest.models.thresholds import Thresholds
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

FEWEST = 20  # samples by which a unit can be judged
_LIKELY = {  # unit of a canonical signal → others that loggers use
    "rad/s": ("rpm", "rad/s", "°/s", "rev/s"),
    "mm": ("mm", "m", "µm"),
    "m": ("m", "mm", "µm"),
    "°C": ("°C", "K", "°F"),
    "m/s": ("m/s", "km/h"),
    "Nm": ("Nm", "%"),
    "rad": ("rad", "°", "rev"),
}
STATE_PERCENT = "is it in %? Then state that unit, and its 'reference', what 100 % stands for"
_PERCENT_STEP = 0.125  # of a torque in percent on a bus: every step is a multiple of it
_LARGEST_STEP = 1.0  # no bus states a percentage more coarsely
_SHORTEST_S = 5e-5  # from row to row (20 kHz)
_MOST_PERCENT = 125.0
_RATIO = 0.15  # by how much two speeds of one shaft may differ
_LEVEL = 10.0  # times the change from sample to sample: a level, no noise about zero


def check_units(
    signals: Mapping[str, Signal],
    stated: Mapping[str, str],
    vehicle: Vehicle,
    where: str = "column",
) -> None:
    """Raises ClutchestError for the first of ``signals`` whose values cannot be in the unit
    ``stated`` for them, of the ``where`` that they are read from."""
    for name, signal in signals.items():
        column = vehicle.machine.column(name)
        value = signal.value[signal.valid]
        if column is None or len(value) < FEWEST or name not in stated:
            continue
        if _fits(value, column, vehicle, signals):
            continue
        raise ClutchestError(
            f"{name} of {_range(value)} {column.unit}, expected {_expected(column, vehicle)}; "
            f"its {where} is taken to be in {stated[name]}"
            + _likely(value, stated[name], column, vehicle, signals)
        )
    _check_pairs(signals, stated, vehicle)


def check_bus_units(signals: Signals, vehicle: Vehicle, database: Database) -> None:
    """The same of signals of a bus whose ``database`` states no unit, so that the vehicle file's
    could not be compared with it.  Those made of several, or of percentages, are not judged."""
    stated = {}
    for name, how in vehicle.signals.items():
        made = how.gears or how.less or how.radius is not None or how.reference is not None
        if name in signals and not made:
            layout = database.message(how.bus.message).signal(how.bus.signal)
            if not layout.unit:
                stated[name] = how.bus.unit
    try:
        check_units(signals, stated, vehicle, "bus signal, of which the database states no unit,")
    except ClutchestError as problem:
        source = " ".join(Path(each).name for each in signals.sources)
        raise ClutchestError(f"{source or vehicle.path.name}: {problem}") from None


def doubtful_units(
    signals: Mapping[str, Signal], stated: Mapping[str, str], vehicle: Vehicle
) -> Iterator[str]:
    """In words, which signals may be in percent, where what they are relative to is a guess, so
    that :func:`check_units` cannot tell."""
    for name, signal in signals.items():
        column = vehicle.machine.column(name)
        value = signal.value[signal.valid]
        if column is None or column.magnitude is None or name not in stated:
            continue
        if stated[name] != "%" and _scale(column, vehicle) is None and may_be_percent(value):
            yield (
                f"{name} of {_range(value)} {column.unit} reads like percentages: {STATE_PERCENT}, "
                f"or {column.magnitude.of}, which is a guess, if it is in {column.unit}"
            )


def may_be_percent(value: Floats) -> bool:
    """Whether readings (n) are steps of a percentage, and enough to tell."""
    return len(value) >= FEWEST and float(np.ptp(value)) > 0.0 and _is_percent(value)


def _fits(value: Floats, column: Column, vehicle: Vehicle, signals: Mapping[str, Signal]) -> bool:
    """Whether readings (n) in the column's unit are possible in any drive."""
    if column.possible is not None:
        low, high, _ = column.possible
        return low <= float(np.median(value)) <= high
    if column.magnitude is None:
        return True
    size = np.abs(value[value != 0.0])
    if len(size) < FEWEST:
        return True
    small, large = np.percentile(size, (5.0, 99.0))
    scale = _scale(column, vehicle)
    if scale is None:
        return True
    least, most = (scale * edge for edge in column.magnitude.largest)
    if large > most or small > column.magnitude.smallest:
        return False
    if large >= least:
        return True
    if column.magnitude.of:
        return not (_is_percent(value) or _varies(column, signals))
    return bool(large < _LEVEL * np.median(np.abs(np.diff(value))))


def _scale(column: Column, vehicle: Vehicle) -> float | None:
    """What a magnitude is relative to: 1, or a parameter; None where that is a guess."""
    assert column.magnitude is not None
    if not column.magnitude.of:
        return 1.0
    parameter = vehicle.parameters.get(column.magnitude.of)
    return None if parameter is None or parameter.guessed else parameter.value


def _is_percent(value: Floats) -> bool:
    """Whether all values are steps of a percentage."""
    steps, apart = value / _PERCENT_STEP, np.diff(np.unique(value))
    return bool(
        np.abs(value).max() <= _MOST_PERCENT
        and np.all(steps == np.rint(steps))
        and not np.all(apart > _LARGEST_STEP)
    )


def _varies(column: Column, signals: Mapping[str, Signal]) -> bool:
    """Whether the signal that this one changes varies as it does in driving."""
    assert column.magnitude is not None
    moved = signals.get(column.magnitude.moves)
    if moved is None or np.count_nonzero(moved.valid) < FEWEST:
        return False
    low, high = np.percentile(np.abs(moved.value[moved.valid]), (5.0, 99.0))
    return bool(high > 1.5 * low > 0.0)


def _likely(
    value: Floats, stated: str, column: Column, vehicle: Vehicle, signals: Mapping[str, Signal]
) -> str:
    """A unit in which the same numbers would fit, as a question."""
    raw = units.convert_reading(value, column.unit, stated)
    for unit in _LIKELY.get(column.unit, ()):
        if unit == stated:
            continue
        if unit == "%":
            if np.abs(raw).max() <= _MOST_PERCENT:
                return f"; {STATE_PERCENT}"
            continue
        if _fits(units.convert_reading(raw, unit, column.unit), column, vehicle, signals):
            return f"; is it in {unit}?"
    return ""


def _expected(column: Column, vehicle: Vehicle) -> str:
    if column.possible is not None:
        return f"{column.possible[0]:g} to {column.possible[1]:g} {column.unit}"
    assert column.magnitude is not None
    scale = _scale(column, vehicle) or 1.0
    least, most = (scale * edge for edge in column.magnitude.largest)
    smallest = column.magnitude.smallest
    words = f"largest readings of {least:.3g} to {most:.4g} {column.unit}"
    return words + (f" and smallest below {smallest:g}" if np.isfinite(smallest) else "")


def _range(value: Floats) -> str:
    return f"{value.min():.4g} to {value.max():.4g}"


def _check_pairs(
    signals: Mapping[str, Signal], stated: Mapping[str, str], vehicle: Vehicle
) -> None:
    """Two speeds of one shaft, as long as it is locked, must not differ by the factor of a unit."""
    factor = units.parse("rpm").scale
    for name, signal in signals.items():
        column = vehicle.machine.column(name)
        other = signals.get(column.geared_by) if column and column.geared_by else None
        if other is None or name not in stated:
            continue
        mine, theirs = signal.only_valid(), other.only_valid()
        if min(len(mine), len(theirs)) < FEWEST:
            continue
        both = np.abs(theirs.at(mine.time))
        moving = (np.abs(mine.value) > 0.0) & (both > 0.0)
        if np.count_nonzero(moving) < FEWEST:
            continue
        with np.errstate(over="ignore"):  # of damaged numbers
            ratio = float(np.median(np.abs(mine.value[moving]) / both[moving]))
        for times, unit in ((1.0 / factor, "rpm"), (factor, "rad/s")):
            if abs(ratio / times - 1.0) < _RATIO:
                raise ClutchestError(
                    f"{name} is {ratio:.3g} times {column.geared_by if column else ''}: one of "
                    f"them is in another unit; is {name} in {unit}?"
                )


def check_steps(time: Floats, stated: bool, vehicle: Vehicle) -> None:
    """Raises ClutchestError where times (n) whose unit is not ``stated`` are too far apart to be in
    s, and those of a stated unit too close to each other for any log."""
    gap = Thresholds.of(vehicle.modes).gap
    steps = np.diff(time)
    if stated and len(time) >= FEWEST and 0.0 < (step := float(np.median(steps))) < _SHORTEST_S:
        raise ClutchestError(
            f"its rows are {step:.3g} s apart by the unit of time that the header or [columns] of "
            f"the vehicle file states, expected at least {_SHORTEST_S:g} s"
        )
    if stated or len(time) < FEWEST or 2 * np.count_nonzero(steps > gap) < len(steps):
        return
    if (step := float(np.median(steps))) > gap:
        unit = "ms" if step * 1e-3 <= gap else "us" if step * 1e-6 <= gap else "ns"
        raise ClutchestError(
            f"its rows are {step:.3g} s apart, more than the gap of {gap:g} s that can be bridged; "
            f"is the time in {unit}? A header such as 'time [{unit}]' or [columns] of the vehicle "
            "file states it. Of a log that is as slow as that, [modes] gap states how long may be "
            "bridged"
        )


def by_guess(column: Column) -> bool:
    """Whether loggers use several units of a quantity, and nothing tells which by its values."""
    return column.magnitude is None and column.possible is None and column.unit in _LIKELY


def likely_unit(value: Floats, column: Column, template: Vehicle) -> str:
    """The unit, of those that loggers use, that readings (n) of an unknown one fit best."""
    fitting = (
        unit
        for unit in (column.unit, *_LIKELY.get(column.unit, ()))
        if unit != "%"
        and _fits(units.convert_reading(value, unit, column.unit), column, template, {})
    )
    return column.unit if len(value) < FEWEST else next(fitting, column.unit)
