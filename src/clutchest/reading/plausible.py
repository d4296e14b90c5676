"""Columns of tables, compared with the range of the bus signals that they replace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest import units
from clutchest.can.database import Database, SignalLayout
from clutchest.signals import Floats, Signal, Signals, Why
from clutchest.vehicle import SignalMap, Vehicle

# A reading of zero scatters about the end of its range; in a wrong unit most are far outside.
_MARGIN = 0.05  # of the range
_OFTEN = 0.01  # of the samples


def plausible(signals: Signals, vehicle: Vehicle, database: Database) -> Signals:
    """The signals of a table without samples outside the vehicle file's min … max; warns of those,
    and of columns outside the range of the DBC's signal, which are probably in another unit.

    The ``database`` may be empty.
    """
    kept, warnings = dict(signals.signals), list[str]()
    for name, signal in signals.items():
        how = vehicle.signals.get(name)
        if how is None or how.gears or how.reference is not None or not len(signal):
            continue  # made of several bus signals, so it has no range of its own
        kept[name], words = _within_file(signal, how)
        warnings += words
        if how.bus.message in database.messages:
            warnings += _beyond_bus(signal, how, database)
    return replace(signals, signals=kept, warnings=(*signals.warnings, *warnings))


def excluded(
    value: Floats, why: NDArray[np.uint8], how: SignalMap
) -> tuple[NDArray[np.uint8], str | None]:
    """``why`` (n) of samples, of ``value`` (n) in the bus unit, with the vehicle file's min … max
    applied; in words, how many samples they exclude."""
    outside = np.zeros(len(value), bool)
    if how.minimum is not None:
        outside |= value < how.minimum
    if how.maximum is not None:
        outside |= value > how.maximum
    if not outside.any():
        return why, None
    words = f"{outside.sum()} samples outside the vehicle file's min … max"
    return np.where(outside, np.uint8(Why.OUT_OF_RANGE), why), words


def clipped(value: Floats, layout: SignalLayout) -> list[str]:
    """In words, how many samples ``value`` (n) lie at the ends of the range that the DBC states.

    Zero is no sign of clipping, and a switch has nothing but ends.
    """
    if layout.width <= 4 or layout.maximum == layout.minimum:
        return []
    words = []
    for end, edge in ((layout.maximum, "upper"), (layout.minimum, "lower")):
        if not end:
            continue
        count = int(np.count_nonzero(value >= end if edge == "upper" else value <= end))
        if count:
            words.append(
                f"{count} samples at the {edge} end of the DBC's range "
                f"({end:g} {layout.unit})".rstrip()
            )
    return words


def _within_file(signal: Signal, how: SignalMap) -> tuple[Signal, list[str]]:
    if how.minimum is None and how.maximum is None:
        return signal, []
    on_bus = units.convert_reading(signal.value, signal.unit, how.bus.unit)
    why, words = excluded(on_bus, signal.why, how)
    if words is None:
        return signal, []
    limited = Signal.of(signal.name, signal.unit, signal.time, signal.value, why)
    return limited, [f"{signal.name}: {words}"]


def _beyond_bus(signal: Signal, how: SignalMap, database: Database) -> list[str]:
    layout = database.message(how.bus.message).signal(how.bus.signal)
    if layout.minimum is None or layout.maximum is None or layout.minimum >= layout.maximum:
        return []
    low, high = (
        units.convert(float(end), how.bus.unit, signal.unit)
        for end in (layout.minimum, layout.maximum)
    )
    margin = _MARGIN * (high - low)
    value = signal.value[signal.valid]
    beyond = np.count_nonzero((value < low - margin) | (value > high + margin))
    if beyond <= _OFTEN * len(value):
        return []
    other = f"; is it in {how.bus.unit}?" if how.bus.unit != signal.unit else ""
    return [
        f"{signal.name}: {beyond} of {len(value)} samples lie outside of what "
        f"{how.bus.message}.{how.bus.signal} can carry, {low:.4g} to {high:.4g} {signal.unit}; "
        f"expected the column in {signal.unit}{other}"
    ]
