"""Simulated drives: the generator's truth, encoded for the vehicle's bus and decoded from it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Unpack
from zlib import crc32

import numpy as np

from clutchest import units
from clutchest.can import files
from clutchest.can.database import Database, Message
from clutchest.can.encode import encode
from clutchest.can.frames import Frames
from clutchest.checked import checked
from clutchest.errors import ClutchestError, nearest
from clutchest.generator import (
    Channel,
    Disturbances,
    DriveRequest,
    Mismatch,
    Outsider,
    Sampled,
)
from clutchest.models.effects import Effect, with_files
from clutchest.paths import as_written, named_in_utf8
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.reading.tables import write_signals
from clutchest.reading.wanted import mapped_messages
from clutchest.signals import Floats, Signal, Signals, Truth
from clutchest.simulation_options import Effects, Options, checked_effects, checked_options
from clutchest.vehicle import BusSignal, SignalMap, Vehicle, load_vehicle

FRICTION = 7.0  # %: the engine's own friction, where the bus reports one
_EPOCH = 1_704_067_200  # 1 January 2024, UTC
_DAY, _SLOT = 86_400, 3_600  # s
_ROW_S = 0.01  # from row to row of a vehicle without a bus, unless a signal states its period, s


@partial(checked, own=("effects",))
def simulate(
    vehicle: Vehicle | str | Path,
    scenario: str,
    seed: int = 0,
    effects: Effects | None = None,
    **options: Unpack[Options],
) -> Signals:
    """One drive of ``scenario`` as decoded from the bus, with ``truth`` on the same clock.

    ``effects`` (name → parameter → value) are added to those of the vehicle file; see
    :class:`clutchest.simulation_options.Options` for the rest.  Raises ClutchestError for unknown
    names.
    """
    vehicle = load_vehicle(vehicle)
    source = (f"{scenario}, seed {seed}",)
    if not _on_bus(vehicle):
        sampled = _sampled(vehicle, Database({}), scenario, seed, effects, options)
        start = _start(vehicle, scenario, seed, _all_effects(vehicle, effects), options)
        return replace(_measured(vehicle, sampled, start), sources=source)
    frames, truth, _ = _drive(vehicle, scenario, seed, effects, options)
    signals = signals_of(frames, vehicle, load_database(vehicle), source)
    return replace(signals, truth=truth)


def simulate_frames(
    vehicle: Vehicle,
    scenario: str,
    seed: int = 0,
    effects: Effects | None = None,
    **options: Unpack[Options],
) -> tuple[Frames, Truth]:
    """The same drive as the frames of a log; ``truth.time`` counts from the first frame."""
    frames, truth, _ = _drive(vehicle, scenario, seed, effects, options)
    return frames, truth


def simulate_sampled(
    vehicle: Vehicle,
    scenario: str,
    seed: int = 0,
    effects: Effects | None = None,
    **options: Unpack[Options],
) -> Sampled:
    """The same drive as measured by its sensors, not yet rounded to the steps of the bus."""
    database = load_database(vehicle) if _on_bus(vehicle) else Database({})
    return _sampled(vehicle, database, scenario, seed, effects, options)


def write_simulation(
    path: str | Path,
    vehicle: Vehicle,
    scenario: str,
    seed: int = 0,
    effects: Effects | None = None,
    **options: Unpack[Options],
) -> Path:
    """Write the drive to ``path`` (format by suffix; ``.csv`` and ``.parquet`` hold decoded
    signals) and the truth beside it; returns the truth's path, ``PATH.truth.parquet``."""
    path = as_written(path)
    decoded = path.name.lower().endswith((".parquet", ".csv", ".csv.gz"))
    if not _on_bus(vehicle):
        if not decoded:
            raise ClutchestError(
                f"{path}: {vehicle.path.name} maps no message, so no frames can be made; expected "
                ".csv or .parquet"
            )
        sampled = _sampled(vehicle, Database({}), scenario, seed, effects, options)
        start = _start(vehicle, scenario, seed, _all_effects(vehicle, effects), options)
        signals, truth = _measured(vehicle, sampled, start), sampled.truth
        write_signals(signals, path, vehicle)
    else:
        frames, truth, sampled = _drive(vehicle, scenario, seed, effects, options)
        if decoded:
            write_signals(signals_of(frames, vehicle, load_database(vehicle)), path)
        else:
            files.write_frames(frames, path)
    late = float(sampled.truth.time[-1] - truth.time[-1])  # the log begins with its first frame
    truth_path = path.with_name(path.name + ".truth.parquet")
    _write_truth(
        truth,
        truth_path,
        {
            "scenario": scenario,
            "seed": seed,
            "truck_seed": _truck_seed(seed, options),
            "clutchest": version("clutchest"),
            "vehicle": vehicle.name,
            "vehicle_hash": vehicle.hash,
            "effects": _all_effects(vehicle, effects),
            "disturbances": Disturbances.of(options.get("disturbances", {})).sizes(),
            "parameters": dict(sampled.parameters),
            "options": dict(options),
            "benches": [(start - late, end - late, name) for start, end, name in sampled.benches],
            "truth": "a generator of its own"
            if vehicle.machine.generate
            else "the filter's own equations: truth and model are the same",
        },
    )
    return truth_path


def _on_bus(vehicle: Vehicle) -> bool:
    """Whether any of the vehicle's signals is carried by frames."""
    return any(signal.on_bus for signal in vehicle.signals.values())


def _measured(vehicle: Vehicle, sampled: Sampled, start: int) -> Signals:
    """The samples of a drive as they are, of a vehicle without a bus."""
    unit_of = vehicle.machine.units
    signals = {n: Signal.of(n, unit_of[n], *pair) for n, pair in sampled.signals.items()}
    end = max(float(signal.time[-1]) for signal in signals.values() if len(signal))
    return Signals(signals, start_ns=start, end=end, truth=sampled.truth)


def _drive(
    vehicle: Vehicle, scenario: str, seed: int, effects: Effects | None, options: Options
) -> tuple[Frames, Truth, Sampled]:
    database = load_database(vehicle)
    sampled = _sampled(vehicle, database, scenario, seed, effects, options)
    start = _start(vehicle, scenario, seed, _all_effects(vehicle, effects), options)
    frames = _frames(vehicle, database, sampled, start)
    late = (frames.t_ns[0] - start) / 1e9
    seen = sampled.truth.time >= late
    columns = {name: column[seen] for name, column in sampled.truth.columns.items()}
    return frames, Truth(sampled.truth.time[seen] - late, columns), sampled


def _sampled(
    vehicle: Vehicle,
    database: Database,
    scenario: str,
    seed: int,
    effects: Effects | None,
    options: Options,
) -> Sampled:
    machine = vehicle.machine
    machine.supports("simulate")
    checked_options(options)
    mapped_messages(vehicle, database)
    noise_ar = options.get("noise_ar")
    own_files = map(Path, options.get("effects_files", ()))
    vehicle = replace(vehicle, effects_files=(*vehicle.effects_files, *own_files))
    every = _all_effects(vehicle, effects)
    own = _own_effects(vehicle, every)
    channels = [
        Channel(
            name,
            *_together(vehicle, database, signal),
            signal.noise,
            signal.noise_ar if noise_ar is None else noise_ar,
            signal.delay,
        )
        for name, signal in vehicle.signals.items()
    ]
    request = DriveRequest(
        {key: p.value for key, p in vehicle.parameters.items()},
        {key: p.spread for key, p in vehicle.parameters.items()},
        scenario,
        seed,
        channels,
        nominal=options.get("nominal", False),
        duration=options.get("duration"),
        effects=every,
        onset=options.get("onset", 0.0),
        outliers=options.get("outliers", 0.0),
        truck_seed=options.get("truck_seed"),
        disturbances=Disturbances.of(options.get("disturbances", {})),
        outsider=options.get("outsider"),
        mismatch=options.get("mismatch", Mismatch()),
    )
    if machine.generate is None:
        from clutchest import simulated_from_model  # with CasADi, which no generator needs

        return simulated_from_model.generate(vehicle, request)
    if own:
        library = {name: values for name, values in every.items() if name not in own}
        request = replace(request, effects=library, outsider=_acting(vehicle, own, every, request))
    sampled: Sampled = machine.generate(request)
    return sampled


def _together(vehicle: Vehicle, database: Database, signal: SignalMap) -> tuple[str, float]:
    """What is sampled together with a signal, and how often, s: its message, or in a table all
    that have the same period."""
    if signal.on_bus:
        message = signal.bus.message
        return message, _period(vehicle, database.message(message), signal)
    period = signal.period or _ROW_S
    fastest = min(s.period or _ROW_S for s in vehicle.signals.values() if not s.on_bus)
    return "rows" if period == fastest else f"rows every {period:g} s", period


def _own_effects(vehicle: Vehicle, wanted: Effects) -> dict[str, Effect]:
    """Those of the ``wanted`` effects that stand in files of the user's."""
    files = with_files({}, vehicle.effects_files, vehicle.digests)
    return {name: effect for name, effect in files.items() if name in wanted}


def _acting(
    vehicle: Vehicle, own: Mapping[str, Effect], sizes: Effects, request: DriveRequest
) -> Outsider:
    """A user's ``own`` effects, as the machine's generator takes them."""
    machine = vehicle.machine
    if machine.own_effects is None:
        raise ClutchestError(
            f"{', '.join(own)} cannot be simulated: the generator of '{machine.name}' has the "
            "library's effects only"
        )
    if request.outsider:
        raise ClutchestError(f"{', '.join(own)}: not together with an outsider")
    numbers = {}
    for name, effect in own.items():
        known = {n.key: n.default if n.shape else 0.0 for n in effect.parameters}
        for key in (key for key in sizes[name] if key not in known):
            raise ClutchestError(f"effect '{name}' has no '{key}'" + nearest(key, known))
        numbers[effect] = {**known, **sizes[name]}
    acting: Outsider = machine.own_effects(numbers, request.parameters)
    return acting


def _all_effects(vehicle: Vehicle, effects: Effects | None) -> dict[str, dict[str, float]]:
    """Those of the vehicle file, overridden by ``effects``."""
    if vehicle.curves:
        raise ClutchestError(
            f"{vehicle.path.name}: {', '.join(vehicle.curves)} cannot be simulated: the generator "
            "has the library's effects only"
        )
    merged = {name: dict(values) for name, values in vehicle.effects.items()}
    for name, values in checked_effects({} if effects is None else effects).items():
        merged[name] = {**merged.get(name, {}), **values}
    return merged


def _truck_seed(seed: int, options: Options) -> int:
    given = options.get("truck_seed")
    return seed if given is None else given


def _start(vehicle: Vehicle, scenario: str, seed: int, effects: Effects, options: Options) -> int:
    """Epoch ns of t = 0: the same for the same drive and different for others, so that logs read
    together are not taken for pieces of one drive; a higher seed is a later drive."""
    ordered = sorted((name, sorted(values.items())) for name, values in effects.items())
    drive: list[object] = [vehicle.name, scenario, ordered]
    if (truck := _truck_seed(seed, options)) != seed:
        drive.append(truck)
    if disturbances := options.get("disturbances"):
        drive.append(sorted(disturbances.items()))
    fingerprint = repr(tuple(drive))
    slot = crc32(fingerprint.encode()) % 240
    return (_EPOCH + seed % 1000 * 10 * _DAY + slot * _SLOT) * 1_000_000_000


def _period(vehicle: Vehicle, message: Message, signal: SignalMap) -> float:
    period = signal.period or message.cycle_time_s
    if not period:
        raise ClutchestError(
            f"{vehicle.path.name}: signals.{signal.name} requires a 'period' (s) to be simulated: "
            f"the DBC has no cycle time for {message.name}"
        )
    return period


def _frames(vehicle: Vehicle, database: Database, sampled: Sampled, start: int) -> Frames:
    """Every mapped message, encoded; sorted by time."""
    units_of = vehicle.machine.units
    times: dict[str, Floats] = {}
    values: dict[str, dict[str, Floats]] = {}
    senders: dict[str, SignalMap] = {}

    def put(bus: BusSignal, value: Floats) -> None:
        values.setdefault(bus.message, {})[bus.signal] = value

    for name, (time, value) in sampled.signals.items():
        signal = vehicle.signals[name]
        for bus in (signal.bus, signal.other, signal.less):
            if bus:
                times.setdefault(bus.message, time)
                senders.setdefault(bus.message, signal)
        if signal.reference is not None:
            _put_torque(signal, value / signal.reference * 100, database, put)
            continue
        # First gear throughout, which is the constant gear that the bus sends below.
        shown = value / signal.gears[0] if signal.gears else value
        unit = units_of[name]
        if signal.radius is not None:
            shown, unit = signal.before_radius(shown), signal.bus.unit
        if signal.less:  # as much of it on either side
            put(signal.less, units.convert(-shown / 2, unit, signal.less.unit))
            shown = shown / 2
        put(signal.bus, units.convert(shown, unit, signal.bus.unit))
        if signal.other:
            put(signal.other, units.convert(shown, unit, signal.other.unit))
    for name in sampled.signals:  # messages of companions alone have their own period
        signal = vehicle.signals[name]
        for companion, constant in ((signal.friction, FRICTION), (signal.gear, 1.0)):
            if companion:
                message = database.message(companion.message)
                if message.name not in times:
                    end = max(time[-1] for time, _ in sampled.signals.values() if len(time))
                    times[message.name] = np.arange(0.0, end, _period(vehicle, message, signal))
                    senders[message.name] = signal
                put(companion, np.full(len(times[message.name]), constant))
    parts = [
        encode(
            database.message(name),
            columns,
            start + np.rint(times[name] * 1e9).astype(np.int64),
            senders[name].source_address or 0,
            database.message(name).channel or senders[name].channel or 0,
        )
        for name, columns in values.items()
    ]
    return Frames.concatenate(parts).sorted()


def _put_torque(
    signal: SignalMap, percent: Floats, database: Database, put: Callable[[BusSignal, Floats], None]
) -> None:
    """Percent torque plus the engine's friction, split into whole steps and fraction."""
    shown = percent + FRICTION if signal.friction else percent
    if signal.fraction:
        whole = database.message(signal.bus.message).signal(signal.bus.signal).scale
        fine = database.message(signal.fraction.message).signal(signal.fraction.signal).scale
        steps, per_whole = np.rint(shown / fine), round(whole / fine)
        shown = steps // per_whole * whole
        put(signal.fraction, steps % per_whole * fine)
    put(signal.bus, shown)


def _write_truth(truth: Truth, path: Path, about: Mapping[str, object]) -> None:
    """Columns of the truth; ``about`` goes into the file's metadata as JSON."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({"time": truth.time, **truth.columns})
    about = {
        key: value if isinstance(value, str) else json.dumps(value, default=repr)
        for key, value in about.items()
    }
    with named_in_utf8(path) as file:
        pq.write_table(table.replace_schema_metadata(about), file)
