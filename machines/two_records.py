"""A discovery on one record, and what it is worth on another: the common part of two run.py.

Each gives its files' ``convert``, and ``judge``: the scores of what was found, in result.json.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np
import pandas as pd

from clutchest.discovery.chain import chain, extended_by, summary
from clutchest.identify.fitted_machine import FittedMachine
from clutchest.reading import read_log
from clutchest.record.discovery import write_discovery
from clutchest.signals import Signals
from clutchest.vehicle import dump_vehicle, load_vehicle

RESAMPLED = 1000  # draws of the bootstrap


@dataclass(frozen=True)
class Found:
    """The machines, fitted to the discovery record: as they were, with the first finding alone and
    with the whole chain; and both records, as signals and as tables."""

    before: FittedMachine
    first: FittedMachine
    after: FittedMachine
    signals: tuple[Signals, Signals]
    tables: tuple[pd.DataFrame, ...]


def folder(text: str) -> Path:
    """A folder to write to, made if need be.  Raises ArgumentTypeError where it cannot be."""
    path = Path(text)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise argparse.ArgumentTypeError(f"{path}: no folder ({problem.strerror})") from None
    return path


def run(
    description: str,
    vehicle_file: Path,
    convert: Callable[[Path, Path], Sequence[Path]],
    judge: Callable[[Found, Path], Mapping[str, Any]],
    printed: Sequence[str],
) -> None:
    """Convert the official files, discover, and write what came out; ``printed`` of the results are
    shown too."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("data", type=Path, help="folder of the official files")
    parser.add_argument("--out", type=folder, required=True)
    options = parser.parse_args()
    wall, cpu = perf_counter(), process_time()
    vehicle = load_vehicle(vehicle_file, trust=True)
    with TemporaryDirectory() as place:
        paths = convert(options.data, Path(place))
        signals, held_out = (read_log([path], vehicle) for path in paths)
        tables = tuple(pd.read_parquet(path) for path in paths)
    found = chain(signals, vehicle, held_out.drives)
    extended = extended_by(found, vehicle)
    stages = (vehicle, extended_by(found[:1], vehicle), extended)
    before, first, after = (FittedMachine.of(signals, each) for each in stages)
    result = {
        **summary(found),
        **judge(Found(before, first, after, (signals, held_out), tables), options.out),
        "fitted": {"before": dict(before.numbers), "after": dict(after.numbers)},
        "seconds": perf_counter() - wall,
        "processor_seconds": process_time() - cpu,
    }
    (options.out / "result.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
    dump_vehicle(extended, options.out / "extended.toml")
    write_discovery(found[0], options.out / "first")
    print(json.dumps({key: result[key] for key in printed}, indent=1))


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def less(before: np.ndarray, after: np.ndarray, block: int) -> list[float]:
    """95 % interval of rms before − rms after, by a bootstrap of blocks of so many samples."""
    count = len(before) // block
    squares = np.array([e[: count * block].reshape(count, block) ** 2 for e in (before, after)])
    sums = squares.mean(axis=2)
    drawn = np.random.default_rng(0).integers(count, size=(RESAMPLED, count))
    means = np.sqrt(sums[:, drawn].mean(axis=2))
    return np.quantile(means[0] - means[1], [0.025, 0.975]).tolist()
