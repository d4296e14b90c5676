"""What is unlikely in a vehicle file, against the ranges that its machine declares."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from clutchest.vehicle.vehicle import ParameterValue, SignalMap

if TYPE_CHECKING:
    from clutchest.models.machine import Machine


def unlikely(
    machine: Machine,
    parameters: Mapping[str, ParameterValue],
    signals: Mapping[str, SignalMap],
) -> Iterator[str]:
    """One line for each number that no such machine, and no such sensor, is known to have."""
    for p in machine.parameters:
        value, (low, high) = parameters[p.key].value, p.plausible
        if not low <= value <= high:
            yield f"unlikely: {p.key} = {value:g} {p.unit}, such machines have {low:g} … {high:g}"
    for name, signal in signals.items():
        column = machine.column(name)
        if column is not None and signal.noise > column.noisiest:
            yield (
                f"unlikely: signals.{name}.noise = {signal.noise:g} {column.unit}, such sensors "
                f"have at most {column.noisiest:g}"
            )
