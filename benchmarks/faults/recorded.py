"""Faults injected into recorded drives frame by frame: detection, delay, false isolation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import clutchest
from clutchest.can.database import Message
from clutchest.can.decode import decode, rows_of
from clutchest.can.encode import counter_of, rewritten
from clutchest.can.files import read_frames
from clutchest.can.frames import Frames
from clutchest.diagnosis.faults.messages import fluctuating, messages_of
from clutchest.errors import ClutchestError
from clutchest.reading.log import load_database
from clutchest.reading.mapping import signals_of
from clutchest.vehicle import BusSignal, Vehicle

DRIVES = {"gt350": "gt350_launch.trc", "j1939_t270": "j1939_t270_drive.log"}
WITHIN = (0.3, 0.7)  # of the drive, in which a fault begins
SLOWER, NOISIER = 1.5, 4.0  # times the period; times the signal's own noise
HOTTER = 120.0  # K, of a temperature that jumps

Fault = Callable[[Frames, np.random.Generator, float], Frames]  # (frames, draws, onset in s)


def _since(frames: Frames, message: Message, onset: float) -> np.ndarray:
    """Rows of a message from ``onset`` s on."""
    rows = rows_of(frames, message)
    return rows[frames.t_ns[rows] - frames.t_ns[0] >= onset * 1e9]


def missing(message: Message) -> Fault:
    """The message is no longer sent."""

    def put(frames: Frames, rng: np.random.Generator, onset: float) -> Frames:
        keep = np.ones(len(frames), bool)
        keep[_since(frames, message, onset)] = False
        return frames.take(keep)

    return put


def late(message: Message) -> Fault:
    """The message is sent less often."""

    def put(frames: Frames, rng: np.random.Generator, onset: float) -> Frames:
        rows, t = _since(frames, message, onset), frames.t_ns.copy()
        t[rows] = t[rows[0]] + ((t[rows] - t[rows[0]]) * SLOWER).astype(np.int64)
        return replace(frames, t_ns=t).take(t <= frames.t_ns.max()).sorted()

    return put


def frozen(message: Message) -> Fault:
    """The payload no longer changes."""

    def put(frames: Frames, rng: np.random.Generator, onset: float) -> Frames:
        rows, data = _since(frames, message, onset), frames.data.copy()
        data[rows] = data[rows[0]]
        return replace(frames, data=data)

    return put


def changed(
    message: Message, name: str, change: Callable[[np.ndarray, np.random.Generator], np.ndarray]
) -> Fault:
    """``change`` is applied to one signal's valid values (n)."""

    def put(frames: Frames, rng: np.random.Generator, onset: float) -> Frames:
        column = decode(frames, _since(frames, message, onset), message, [name])[name]
        good = np.isfinite(column.value)
        value = change(column.value[good], rng)
        return rewritten(frames, column.rows[good], message, name, value)

    return put


def own_noise(value: np.ndarray) -> float:
    """Standard deviation from fourth differences, at least a step of the bus."""
    steps = np.abs(np.diff(value))
    least = float(steps[steps > 0].min(initial=np.inf))
    left = float(np.sqrt(np.median(np.diff(value, 4) ** 2) / 0.455 / 70.0))
    return max(left, least if np.isfinite(least) else 0.0)


def faults_of(vehicle: Vehicle, messages: dict[str, Message]) -> dict[str, Fault]:
    """Every fault of frames and single signals that this vehicle can have, by its monitor."""
    faults: dict[str, Fault] = {}
    for name in messages_of(vehicle):
        for kind in (missing, late, frozen):
            faults[f"{kind.__name__}:{name}"] = kind(messages[name])
    for name, signal in vehicle.signals.items():
        carried: tuple[BusSignal, ...] = (signal.bus, *([signal.other] if signal.other else []))
        cases = (
            {
                "stuck": lambda v, rng: np.full(len(v), v[0] if len(v) else 0.0),
                "noise": lambda v, rng: v + NOISIER * own_noise(v) * rng.standard_normal(len(v)),
            }
            if name in fluctuating(vehicle)
            else {"implausible": lambda v, rng: v + HOTTER}
        )
        for kind, change in cases.items():
            puts = [changed(messages[b.message], b.signal, change) for b in carried]

            def put(
                frames: Frames, rng: np.random.Generator, onset: float, puts: list[Fault] = puts
            ) -> Frames:
                for one in puts:
                    frames = one(frames, rng, onset)
                return frames

            faults[f"{kind}:{name}"] = put
    return faults


def table(folder: Path, onsets: int) -> dict[str, Any]:
    """For every vehicle and fault: in how many of ``onsets`` drives it was detected, the median
    delay (s), and other faults that the drive without it does not have; prints a line each."""
    tables: dict[str, Any] = {}
    for name, log in DRIVES.items():
        vehicle = clutchest.load_vehicle(name)
        database = load_database(vehicle, [folder])
        frames = read_frames(folder / log).sorted()
        messages = {m: database.message(m) for m in messages_of(vehicle)}
        length = float(frames.t_ns[-1] - frames.t_ns[0]) / 1e9

        def detected(
            changed: Frames, vehicle: Vehicle = vehicle, database: Any = database
        ) -> dict[str, float]:
            try:
                run = clutchest.replay(signals_of(changed, vehicle, database), vehicle)
            except ClutchestError:
                return {}
            return {f.fault: f.first_detected_s for f in clutchest.diagnose(run).faults}

        usual = set(detected(frames))
        counted = [m for m in messages.values() if counter_of(m) and m.name in vehicle.checked]
        rows: dict[str, Any] = {"without": sorted(usual), "checked": [m.name for m in counted]}
        print(
            f"{name}: {length:.0f} s; without a fault: {', '.join(sorted(usual)) or 'none'}; "
            f"{len(counted)} messages with a known counter or checksum",
            flush=True,
        )
        for fault, put in faults_of(vehicle, messages).items():
            rng = np.random.default_rng(1)
            delays, others, hidden = [], [], 0
            for onset in rng.uniform(WITHIN[0] * length, WITHIN[1] * length, onsets):
                times = detected(put(frames, rng, float(onset)))
                hidden += fault in usual
                if fault in times and (fault not in usual or times[fault] >= onset):
                    delays.append(times[fault] - float(onset))
                others += [f for f in times if f != fault and f not in usual]
            rows[fault] = {
                "drives": onsets,
                "detected": len(delays),
                "hidden": hidden,
                "delay_s": float(np.median(delays)) if delays else None,
                "others": sorted(others),
            }
            words = f"{len(delays)} of {onsets}"
            words += f" after {np.median(delays):.2f} s" if delays else ""
            words += f"; also {', '.join(sorted(set(others)))}" if others else ""
            print(f"  {fault}: {words}", flush=True)
        tables[name] = rows
    return tables
