"""What a vehicle file asks of the bus, checked against the DBC."""

from __future__ import annotations

from math import isclose

from clutchest import units
from clutchest.can.database import Database, SignalLayout
from clutchest.errors import ClutchestError
from clutchest.vehicle import BusSignal, SignalMap, Vehicle


def mapped_messages(vehicle: Vehicle, database: Database) -> dict[str, dict[str, SignalLayout]]:
    """Message name → signal name → layout of all that ``vehicle`` maps.

    Raises ClutchestError for a name that the DBC does not have, or a unit that it contradicts.
    """
    wanted: dict[str, dict[str, SignalLayout]] = {}
    for signal in vehicle.signals.values():
        for bus in parts(signal):
            try:
                message = database.message(bus.message)
                layout = message.signal(bus.signal)
            except ClutchestError as problem:
                raise _contradiction(vehicle, signal, str(problem)) from None
            if complaint := _unit_complaint(bus, layout):
                raise _contradiction(vehicle, signal, complaint)
            if signal.channel is not None and bus is signal.bus and not message.on(signal.channel):
                raise _contradiction(
                    vehicle,
                    signal,
                    f"channel = {signal.channel}, but 'dbc' says that {bus.message} is on channel "
                    f"{message.channel}",
                )
            wanted.setdefault(bus.message, {})[bus.signal] = layout
    return wanted


def parts(signal: SignalMap) -> list[BusSignal]:
    """Every bus signal that enters one canonical signal, its own first; none of one that only
    tables have."""
    if not signal.on_bus:
        return []
    companions = (signal.fraction, signal.friction, signal.gear, signal.other, signal.less)
    return [signal.bus, *(bus for bus in companions if bus)]


def _contradiction(vehicle: Vehicle, signal: SignalMap, complaint: str) -> ClutchestError:
    return ClutchestError(f"{vehicle.path.name}: signals.{signal.name}: {complaint}")


def _unit_complaint(bus: BusSignal, layout: SignalLayout) -> str:
    """What is wrong with the file's unit; a DBC without a (known) unit accepts any."""
    stated = layout.unit.strip()
    try:
        dbc, file = units.parse(stated or bus.unit), units.parse(bus.unit)
    except ClutchestError:
        return ""
    if (
        dbc.dimensions == file.dimensions
        and isclose(dbc.scale, file.scale, rel_tol=1e-9)
        and isclose(dbc.offset, file.offset, abs_tol=1e-9)
    ):
        return ""
    return f"the file says '{bus.unit}', the DBC '{stated}' for {bus.message}.{bus.signal}"
