"""The official records of the cascaded tanks as tables of canonical columns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from clutchest.signals import Signal, Signals

SOURCE = "https://www.nonlinearbenchmark.org/benchmarks/cascaded-tanks"
FILE = "cascaded_tanks.csv"
RECORDS = {"estimation": ("uEst", "yEst"), "validation": ("uVal", "yVal")}
FULL = 10.0  # V, where the level's sensor ends
PERIOD, HELD = 4.0, 3.9  # s between samples, and how long the pump's voltage surely stays


def table(pump: np.ndarray, level: np.ndarray) -> pd.DataFrame:
    """``time`` s, ``pump`` V at the begin and the end of each step, ``level`` V at the begin."""
    begin = PERIOD * np.arange(len(pump))
    rows = pd.DataFrame({"time": begin, "pump": pump, "level": level})
    ends = pd.DataFrame({"time": begin + HELD, "pump": pump})
    return pd.concat([rows, ends]).sort_values("time", ignore_index=True)


def with_level(signals: Signals, level: np.ndarray) -> Signals:
    """A record with another ``level`` (k) V."""
    own = Signal.of("level", "V", signals["level"].time, level)
    return replace(signals, signals={**dict(signals.items()), "level": own})


def with_ends(signals: Signals) -> Signals:
    """A record with the readings at the sensor's end, which the vehicle file leaves out."""
    level = signals["level"]
    return with_level(signals, np.where(level.valid, level.value, FULL))


def convert(data: Path, out: Path) -> list[Path]:
    """Both records of the folder ``data`` as ``out``/<name>.parquet."""
    if not (data / FILE).is_file():
        raise SystemExit(f"{data / FILE}: not there; it is part of the archive at {SOURCE}")
    try:
        record = pd.read_csv(data / FILE)
        tables = {
            n: table(record[u].to_numpy(), record[y].to_numpy()) for n, (u, y) in RECORDS.items()
        }
    except (KeyError, ValueError, TypeError, OSError) as problem:
        raise SystemExit(f"{data / FILE}: not as it is at {SOURCE} ({problem})") from None
    for name, each in tables.items():
        each.to_parquet(out / f"{name}.parquet", index=False)
    return [out / f"{name}.parquet" for name in tables]
