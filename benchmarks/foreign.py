"""False alarms on measured machines: the extended model as the truth, its own residuals as noise.

python benchmarks/foreign.py tanks DATA RESULT --draws 20 --shard tanks.jsonl: RESULT is what
machines/tanks/run.py wrote.  Each draw simulates a record of the discovery inputs with the extended
vehicle, with its residuals drawn in blocks, and asks discover; the shard goes on where it ended.
The tanks' residuals are added to the level; those of emps are forces that disturb the carriage
under its own controller (machines/emps/closed_loop.py).
A finding there is a false alarm: its share, with the interval of Clopper and Pearson, is printed.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import beta

from clutchest.discovery.discover import discover
from clutchest.identify.fitted_machine import FittedMachine
from clutchest.reading import read_log
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle

MACHINES = Path(__file__).resolve().parents[1] / "machines"
FULL = 10.0  # V, the highest level that the tanks' sensor reads
BLOCK = 64  # readings

Draw = Callable[[int], Signals]  # the record of a seed


def drawn(rng: np.random.Generator, error: np.ndarray) -> np.ndarray:
    """As many residuals, in blocks that begin anywhere, on a circle."""
    begins = rng.integers(len(error), size=len(error) // BLOCK + 1)
    rows = (begins[:, None] + np.arange(BLOCK)).ravel() % len(error)
    return error[rows[: len(error)]]


def tanks(data: Path, signals: Signals, fitted: FittedMachine) -> Draw:
    """The level as the fitted tanks make it, and noise drawn from its residuals."""
    [own] = fitted.predicted(signals, "level")
    reading = signals["level"].only_valid()
    assert np.allclose(reading.time, own.time)

    def simulated(seed: int) -> Signals:
        made = own.measured - own.error + drawn(np.random.default_rng(seed), own.error)
        changed = replace(reading, value=np.minimum(made, FULL))
        return replace(signals, signals={**dict(signals.items()), "level": changed})

    return simulated


def emps(data: Path, signals: Signals, fitted: FittedMachine) -> Draw:
    """The carriage under its controller, disturbed by forces drawn from the residuals."""
    path = data / import_module("convert").FILES["emps"]
    loop = import_module("closed_loop").Loop.of(path, fitted)

    def simulated(seed: int) -> Signals:
        with TemporaryDirectory() as folder:
            made = Path(folder) / "record.parquet"
            loop.record(np.random.default_rng(seed)).to_parquet(made, index=False)
            return read_log([made], fitted.vehicle)

    return simulated


DRAWS = {"tanks": tanks, "emps": emps}


def draw_of(machine: str, data: Path, vehicle: Vehicle) -> Draw:
    """Records of a machine without an error of this vehicle, fitted to the discovery record."""
    sys.path[:0] = [str(MACHINES / machine), str(MACHINES)]
    with TemporaryDirectory() as folder:
        paths = import_module("convert").convert(data, Path(folder))
        signals = read_log(paths[:1], vehicle)
    return DRAWS[machine](data, signals, FittedMachine.of(signals, vehicle))


def report(lines: list[dict]) -> str:
    """The share of records in which something was found, and its 95 % interval."""
    count, found = len(lines), sum(line["verdict"] != "none" for line in lines)
    low = beta.ppf(0.025, found, count - found + 1) if found else 0.0
    high = beta.ppf(0.975, found + 1, count - found) if found < count else 1.0
    return f"{found} of {count} found something: {found / count:.3f} [{low:.3f}, {high:.3f}]"


def main() -> None:
    """Draw, ask, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machine", choices=DRAWS)
    parser.add_argument("data", type=Path)
    parser.add_argument("result", type=Path)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--shard", type=Path, required=True)
    options = parser.parse_args()
    vehicle = load_vehicle(options.result / "extended.toml", trust=True)
    draw = draw_of(options.machine, options.data, vehicle)
    text = options.shard.read_text(encoding="utf-8") if options.shard.is_file() else ""
    lines = [json.loads(line) for line in text.splitlines()]
    with options.shard.open("a", encoding="utf-8") as shard:
        for seed in range(len(lines), options.draws):
            found = discover(draw(seed), vehicle)
            effects = [cause.effect for cause in found.causes]
            lines.append({"seed": seed, "verdict": found.verdict, "causes": effects})
            shard.write(json.dumps(lines[-1]) + "\n")
            shard.flush()
    print(report(lines))


if __name__ == "__main__":
    main()
