"""Inputs that are no logs: what each is made of, and how it is judged."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from functools import cache
from io import BytesIO
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import msgpack
import numpy as np
import pandas as pd
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

import clutchest
from clutchest.can.database import load
from clutchest.can.udp import message_in
from clutchest.errors import ClutchestError
from clutchest.models.effects import effects_of_file
from clutchest.reading.table_formats import is_table
from clutchest.reading.table_formats.mf4 import write
from clutchest.reading.tables import read_table
from clutchest.record.files import read_state
from clutchest.shipped import locate
from clutchest.signals import Signals
from clutchest.vehicle import load_vehicle
from fuzz.mutate import member_damaged, mutated, stored, tree_damaged

SEEDS = Path(__file__).parent / "seeds"  # the others
EFFECT = """
from clutchest.machine import Effect, Number
class Humidity(Effect):
    name, model, equation, scales = "humidity", "dry_clutch", "torque", {"clutch_torque": "change"}
    parameters = (Number("change", "1", -0.1, 0.1),)
"""
FRAME = {
    "timestamp": 0.0,
    "arbitration_id": 0xCF00400,
    "is_extended_id": True,
    "is_remote_frame": False,
    "is_error_frame": False,
    "channel": None,
    "dlc": 8,
    "data": b"12345678",
    "is_fd": False,
    "bitrate_switch": False,
    "error_state_indicator": False,
}


@cache
def drive() -> Signals:
    """The first seconds of the shipped log."""
    from clutchest.reading.window import TimeWindow

    return clutchest.read_log("demo", "truck", TimeWindow.parse(None, "10"))


def seeds(wanted: Collection[str]) -> dict[str, bytes]:
    """Name → content of a sound input of each ``wanted`` kind, of every one if none is."""
    time = np.arange(50) * 0.1
    speed = 100.0 + np.sin(time)
    table = pd.DataFrame(
        {
            "time": time,
            "engine_speed": speed,
            "engine_torque": 500.0 + speed,
            "input_shaft_speed": speed,
        }
    )
    columns, sheets = BytesIO(), BytesIO()
    table.to_parquet(columns)
    table.head(8).to_excel(sheets, index=False)
    state: dict[str, Any] = {}
    if not wanted or ".json" in wanted:
        state = {**clutchest.replay(drive(), "truck").final, "time_ns": None}  # of no time
    matlab, waveforms = BytesIO(), BytesIO()
    numbers = {str(name): column.to_numpy() for name, column in table.items()}
    savemat(matlab, {"drive": numbers, "pairs": table[["time", "engine_speed"]].to_numpy()})
    with TdmsWriter(waveforms) as writer:
        writer.write_segment([ChannelObject("drive", name, numbers[name]) for name in numbers])
    return {
        "vehicle.toml": locate("truck", "vehicles").read_bytes(),
        "state.json": json.dumps(state).encode(),
        "decoded.table.csv": table.to_csv(index=False).encode(),
        "decoded.parquet": columns.getvalue(),
        "decoded.xlsx": stored(sheets.getvalue()),
        "decoded.mat": matlab.getvalue(),
        "decoded.v73.mat": matlab_7_3(numbers),
        "decoded.tdms": waveforms.getvalue(),
        "decoded.table.mf4": measurement(table),
        "own.py": EFFECT.encode(),
        "frame.datagram": msgpack.packb(FRAME),
    }


def measurement(table: pd.DataFrame) -> bytes:
    """Channel groups of a measurement: one of all rows, one of some, one of words."""
    some = table["engine_torque"].where(table.index % 5 == 0)
    words = np.where(table["time"] < 2.0, "1", "neutral")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "whole.mf4"
        write(table.assign(engine_torque=some, gear=words), path)
        return path.read_bytes()


def matlab_7_3(numbers: Mapping[str, np.ndarray]) -> bytes:
    """A struct of vectors, text and a cell array, as MATLAB's -v7.3 lays them out."""
    content = BytesIO()
    with h5py.File(content, "w", userblock_size=512) as file:
        struct = file.create_group("drive")
        for name, values in numbers.items():
            struct[name] = values[None, :]
            struct[name].attrs["MATLAB_class"] = np.bytes_("double")
        struct["driver"] = np.frombuffer("nobody".encode("utf-16-le"), np.uint16)[:, None]
        struct["driver"].attrs["MATLAB_class"] = np.bytes_("char")
        file["#refs#/a"] = np.arange(4.0)
        file["cells"] = np.array([[file["#refs#/a"].ref, file["drive/time"].ref]], h5py.ref_dtype)
        file["cells"].attrs["MATLAB_class"] = np.bytes_("cell")
        file.create_dataset("packed", data=numbers["time"], chunks=(10,), compression="gzip")
    return b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + content.getvalue()[128:]


def _vehicle(path: Path) -> None:
    load_vehicle(path)


def _dbc(path: Path) -> None:
    load([path])


def _state(path: Path) -> None:
    clutchest.replay(drive(), "truck", state=read_state(path))


def _table(path: Path) -> None:
    vehicle = load_vehicle("truck")
    read_table(path, vehicle.machine.units, vehicle)


def _measurement(path: Path) -> None:
    is_table(path)  # else it is a log, which is another kind
    _table(path)


def _effects(path: Path) -> None:
    effects_of_file(path)


def _datagram(path: Path) -> None:
    message, defect = message_in(path.read_bytes(), 0.0)
    assert (message is None) == bool(defect), "neither a frame nor a reason"
    if message is None:
        raise ClutchestError(f"{path}: {defect}")


KINDS: Mapping[str, Callable[[Path], None]] = {
    ".toml": _vehicle,
    ".dbc": _dbc,
    ".arxml": _dbc,
    ".kcd": _dbc,
    ".sym": _dbc,
    ".json": _state,
    ".table.csv": _table,
    ".parquet": _table,
    ".v73.mat": _table,
    ".mat": _table,
    ".xlsx": _table,
    ".tdms": _table,
    ".table.mf4": _measurement,
    ".py": _effects,
    ".datagram": _datagram,
}


def kind_of(name: str) -> str:
    """The end of the name by which an input is judged; empty for a log."""
    return next((end for end in KINDS if name.endswith(end)), "")


def damaged(name: str, content: bytes, others: list[bytes], random: Random) -> bytes:
    """``content`` with damage; to a workbook mostly within one of its files, as it is packed, to
    XML mostly to its elements."""
    if name.endswith(".xlsx") and random.random() < 0.8:
        return member_damaged(content, others, random)
    if name.endswith((".arxml", ".kcd")) and random.random() < 0.8:
        return tree_damaged(content, random)
    return mutated(content, others, random)


def judged(folder: Path, name: str, content: bytes) -> str:
    """``read`` or ``refused``.  Raises AssertionError, or whatever else was let through."""
    path = folder / f"input{kind_of(name)}"
    path.write_bytes(content)
    try:
        KINDS[kind_of(name)](path)
    except ClutchestError as problem:
        assert "\n" not in str(problem), "the error has several lines"
        return "refused"
    return "read"
