"""The runs of the STS3215 bench as tables of canonical columns, one file a run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

SOURCE = "https://github.com/kscalelabs/sysid, data/feetech/STS_3215_12V_20250317/processed"
FILE = "servo_sts3215.parquet"
GRAVITY = 9.81  # m/s²
SIGN, SCALE = 10.24, 0.1  # the reported duty: tenths, and this much more where it is positive
BEAT = 8  # samples of 5 ms after which the bench's late readings of the position recur
EVERY = 4  # of these samples, one reading: 50 Hz, of a bench that samples at 100 Hz

DISCOVERY = {"arm_m": (0.10,), "mass_kg": (0.535, 0.969)}
HELD_OUT = {"arm_m": (0.15,), "mass_kg": (0.741, 1.168)}


def duty_of(reported: np.ndarray) -> np.ndarray:
    """The duty with its sign; NaN where interpolation runs from one sign to the other."""
    value = SCALE * np.where(reported >= SIGN, reported - SIGN, -reported)
    jump = np.abs(np.diff(reported, prepend=reported[0])) > 2.0
    mixed = jump | np.roll(jump, 1) | np.roll(jump, -1)
    return np.where(mixed, np.nan, value)


def table(run: pd.DataFrame) -> pd.DataFrame:
    """``time`` s and the machine's columns at 50 Hz.

    Position and duty pass the same filter without delay, as in identification by inverse dynamics:
    two means over a beat, of which late readings leave nothing.
    """
    time, arm, mass = run.time_s.to_numpy(), run.arm_m.iloc[0], run.mass_kg.iloc[0]
    duty = duty_of(run.torque.to_numpy())
    known = np.isfinite(duty)
    duty = np.interp(time, time[known], duty[known])
    mean = np.convolve([0.5, 0.5], np.full(BEAT, 1.0 / BEAT))  # centred on a sample
    window, half = np.convolve(mean, mean), BEAT

    def smooth(value: np.ndarray) -> np.ndarray:
        return np.convolve(np.pad(value.astype(float), half, mode="edge"), window, mode="valid")

    position = smooth(run.position_rad.to_numpy())
    columns = {
        "time": time,
        "duty": smooth(duty),
        "supply": smooth(run.supply_V.to_numpy()),
        "position": position,
        "enabled": smooth(run.torque_enabled.to_numpy()),
        "speed": np.gradient(position, time),
        "moment": np.full(len(time), mass * GRAVITY * arm),
        "load_inertia": np.full(len(time), mass * arm**2),
    }
    rows = slice(half, -half, EVERY)
    return pd.DataFrame({name: value[rows] for name, value in columns.items()})


def runs(data: Path) -> pd.DataFrame:
    """All runs of the folder ``data``."""
    if not (data / FILE).is_file():
        raise SystemExit(f"{data / FILE}: not there; it is made of {SOURCE}")
    try:
        return pd.read_parquet(data / FILE)
    except (ValueError, OSError) as problem:
        raise SystemExit(f"{data / FILE}: not a table of runs ({problem})") from None


def chosen(record: pd.DataFrame, by: dict[str, tuple[float, ...]]) -> list[pd.DataFrame]:
    """The runs with these arms and masses."""
    near: Callable[[str], pd.Series] = lambda key: np.any(  # noqa: E731
        [np.abs(record[key] - value) < 1e-3 for value in by[key]], axis=0
    )
    some = record[near("arm_m") & near("mass_kg")]
    return [run for _, run in some.groupby("run")]


def convert(data: Path, out: Path) -> tuple[list[Path], list[Path]]:
    """Paths of the runs for discovery and of those held out, written to the folder ``out``."""
    record, paths = runs(data), ([], [])
    for kind, by in enumerate((DISCOVERY, HELD_OUT)):
        for run in chosen(record, by):
            paths[kind].append(out / f"run_{run.run.iloc[0]:03d}.parquet")
            table(run).to_parquet(paths[kind][-1], index=False)
    return paths
