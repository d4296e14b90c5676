"""What a vehicle file asks of the bus, checked against the DBC."""

from __future__ import annotations

import re
from math import isclose

from clutchest import units
from clutchest.can.database import Database, Message, SignalLayout
from clutchest.errors import ClutchestError
from clutchest.vehicle import BusSignal, SignalMap, Vehicle
from clutchest.vehicle.toml import error_in

_COMPANIONS = ("fraction", "friction", "gear", "other", "less")


def mapped_messages(vehicle: Vehicle, database: Database) -> dict[str, dict[str, SignalLayout]]:
    """Message name → signal name → layout of all that ``vehicle`` maps.

    Raises ClutchestError for a name that the DBC does not have, what it contradicts, and two
    signals that are the same one of the bus.
    """
    wanted: dict[str, dict[str, SignalLayout]] = {}
    known: dict[object, str] = {}
    for signal in vehicle.signals.values():
        for bus in parts(signal):
            try:
                message = database.message(bus.message)
            except ClutchestError as problem:
                words = f"{problem}{_left_out(database, bus.message)}"
                raise _contradiction(vehicle, signal, bus, words, "message") from None
            try:
                layout = message.signal(bus.signal)
            except ClutchestError as problem:
                there = [m.name for m in database.messages.values() if bus.signal in m.signals]
                words = f"; {' and '.join(there)} has it" if there else ""
                words = f"{problem}{words}{_left_out(database, bus.signal)}"
                raise _contradiction(vehicle, signal, bus, words) from None
            if layout.width > 64:
                words = f"{bus.message}.{bus.signal} has {layout.width} bits; a number has 64"
                raise _contradiction(vehicle, signal, bus, words)
            if complaint := _unit_complaint(bus, layout):
                raise _contradiction(vehicle, signal, bus, complaint, "unit")
            if bus is signal.bus:
                _check_sender(vehicle, signal, message)
            wanted.setdefault(bus.message, {})[bus.signal] = layout
        made_of = (*parts(signal), signal.source_address, signal.channel, signal.gears)
        if signal.on_bus and (first := known.setdefault(made_of, signal.name)) != signal.name:
            words = f"{signal.bus.message}.{signal.bus.signal} is signals.{first} already"
            raise _contradiction(vehicle, signal, signal.bus, words)
    for name in (name for name in vehicle.checked if name in wanted):
        if not any(key.endswith(("Counter", "Checksum")) for key in database.message(name).signals):
            words = f"checked: {name} has no signal whose name ends in Counter or Checksum"
            raise error_in(vehicle.path, ("checked",), words)
    return wanted


def parts(signal: SignalMap) -> list[BusSignal]:
    """Every bus signal that enters one canonical signal, its own first; none of one that only
    tables have."""
    if not signal.on_bus:
        return []
    companions = (getattr(signal, key) for key in _COMPANIONS)
    return [signal.bus, *(bus for bus in companions if bus)]


def _check_sender(vehicle: Vehicle, signal: SignalMap, message: Message) -> None:
    """Raises ClutchestError for a sender that the message cannot have."""
    bus = signal.bus
    if signal.channel is not None and not message.on(signal.channel):
        words = (
            f"channel = {signal.channel}, but 'dbc' says that {bus.message} is on channel "
            f"{message.channel}"
        )
        raise _contradiction(vehicle, signal, bus, words, "channel")
    if signal.source_address is not None and not message.is_j1939:
        words = f"source_address = {signal.source_address}, but {bus.message} is not of J1939"
        raise _contradiction(vehicle, signal, bus, words, "source_address")


def _left_out(database: Database, name: str) -> str:
    """In words, the message or signal that could not be read of the DBC: of this ``name``, else
    the first one; nothing where all could."""
    lost = [words for words in database.warnings if re.search(r"'(BO_|SG_)\s.*left out", words)]
    lost.sort(key=lambda words: not re.search(rf"\b{re.escape(name)}\b", words))
    return f"; {lost[0]}" if lost else ""


def _contradiction(
    vehicle: Vehicle, signal: SignalMap, bus: BusSignal, complaint: str, key: str = "signal"
) -> ClutchestError:
    """An error about the ``key`` of what maps ``bus``, with its line."""
    key = next((name for name in _COMPANIONS if getattr(signal, name) is bus), key)
    keys = ("signals", signal.name, key)
    return error_in(vehicle.path, keys, f"signals.{signal.name}: {complaint}")


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
