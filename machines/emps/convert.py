"""The official EMPS files as tables of canonical columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.signal import filtfilt
from scipy.signal.windows import hann

SOURCE = "https://www.nonlinearbenchmark.org/benchmarks/emps"
FILES = {"emps": "DATA_EMPS.mat", "emps_pulses": "DATA_EMPS_PULSES.mat"}  # discovery, held out
WIDTH, EVERY = 21, 10  # samples of 1 ms: the smoothing window, and one reading out of so many


def filtered(
    time: np.ndarray, position: np.ndarray, force: np.ndarray, every: int = EVERY
) -> pd.DataFrame:
    """``time`` s, ``position`` m, ``speed`` m/s, ``force`` N: one of ``every`` samples at 1 kHz.

    Position and force pass the same filter (a Hann window forwards and back, no delay), as in
    identification by inverse dynamics: the balance of forces holds for the filtered signals too.
    """
    window = hann(WIDTH + 2)[1:-1]
    window /= window.sum()
    position, force = (filtfilt(window, [1.0], each) for each in (position, force))
    speed = np.gradient(position, time)
    rows = slice(WIDTH, -WIDTH, every)
    columns = {"time": time, "position": position, "speed": speed, "force": force}
    return pd.DataFrame({name: value[rows] for name, value in columns.items()})


def table(path: Path) -> pd.DataFrame:
    """A record at 1 kHz as a table at 100 Hz."""
    record = loadmat(path)
    time, position, voltage = (record[name].ravel() for name in ("t", "qm", "vir"))
    return filtered(time, position, voltage * record["gtau"].item())


def convert(data: Path, out: Path) -> list[Path]:
    """Both records of the folder ``data`` as ``out``/<name>.parquet."""
    paths = []
    for name, file in FILES.items():
        if not (data / file).is_file():
            raise SystemExit(f"{data / file}: not there; it is part of the archive at {SOURCE}")
        paths.append(out / f"{name}.parquet")
        try:
            record = table(data / file)
        except (MatReadError, KeyError, ValueError, TypeError, OSError) as problem:
            raise SystemExit(f"{data / file}: not as it is at {SOURCE} ({problem})") from None
        record.to_parquet(paths[-1], index=False)
    return paths
