"""Logs to measure with: a simulated drive whose five main messages all come at 100 Hz."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import clutchest
from clutchest.can.decode import decode, rows_of
from clutchest.can.encode import encode
from clutchest.can.files import read_frames
from clutchest.can.formats import candump
from clutchest.can.frames import Frames
from clutchest.reading import load_database
from clutchest.simulated import write_simulation

VEHICLE = "truck"
FAST = ("EEC1", "ETC1", "ClutchActuator")  # come at 100 Hz already
MADE_FAST = {"EEC3": "NominalFrictionPercentTorque", "CCVS1": "WheelBasedVehicleSpeed"}
FRAMES_PER_S = 502  # with the two temperatures, once a second each


def drive(seconds: float) -> Frames:
    """A city drive of one simulated truck, five messages at 100 Hz and two at 1 Hz."""
    vehicle = clutchest.load_vehicle(VEHICLE)
    database = load_database(vehicle)
    with TemporaryDirectory() as folder:
        log = Path(folder) / "drive.log"
        write_simulation(log, vehicle, "city", 1, {}, duration=seconds)
        frames = read_frames(log)
    clock = frames.t_ns[rows_of(frames, database.message("EEC1"))]
    parts = [frames]
    for name, signal in MADE_FAST.items():
        message = database.message(name)
        rows = rows_of(frames, message)
        slow = decode(frames, rows, message, [signal])[signal]
        value = np.interp(clock, frames.t_ns[rows], slow.value)
        address = int(frames.id[rows[0]]) & 0xFF
        parts.append(encode(message, {signal: value}, clock + 1_000_000, address))
        parts[0] = parts[0].take(~np.isin(np.arange(len(frames)), rows))
        frames = parts[0]
    return Frames.concatenate([frames, *parts[1:]]).sorted()


def repeated(frames: Frames, n: int) -> Frames:
    """``n`` frames: the drive over and over, one second between the rounds."""
    span = int(frames.t_ns[-1] - frames.t_ns[0]) + 10**9
    rounds = -(-n // len(frames))
    later = [replace(frames, t_ns=frames.t_ns + i * span) for i in range(rounds)]
    return Frames.concatenate(later).take(np.arange(n))


def busy(frames: Frames) -> Frames:
    """The drive on a bus that carries nine times as many frames that no one asks for."""
    rng = np.random.default_rng(0)
    n = 9 * len(frames)
    other = Frames.empty(n)
    other.t_ns[:] = np.sort(rng.integers(frames.t_ns[0], frames.t_ns[-1], n))
    other.id[:], other.length[:] = rng.integers(0x100, 0x200, n), 8
    other.data[:] = rng.integers(0, 256, (n, 8), np.uint8)
    return Frames.concatenate([frames, other]).sorted()


def write_repeated(frames: Frames, path: Path, size: int) -> None:
    """The drive over and over, as candump, until the file has ``size`` bytes."""
    span = int(frames.t_ns[-1] - frames.t_ns[0]) + 10**9
    with path.open("wb") as file:
        i = 0
        while file.tell() < size:
            for piece in candump.write(replace(frames, t_ns=frames.t_ns + i * span)):
                file.write(piece)
                if file.tell() >= size:
                    break
            i += 1
