"""False alarms on measured machines: the extended model as the truth, its own residuals as noise.

python benchmarks/foreign.py tanks DATA RESULT --draws 20 --shard tanks.jsonl: RESULT is what
machines/tanks/run.py wrote.  Each draw simulates a record of the discovery inputs with the extended
vehicle, adds its residuals drawn in blocks, and asks discover; the shard goes on where it ended.
A finding there is a false alarm: its share, with the interval of Clopper and Pearson, is printed.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np
from scipy.stats import beta

from clutchest.discovery.discover import discover
from clutchest.identify.fitted_machine import FittedMachine
from clutchest.reading import read_log
from clutchest.signals import Signals
from clutchest.vehicle import load_vehicle

MACHINES = Path(__file__).resolve().parents[1] / "machines"
SENSORS = {"tanks": ("level", 10.0)}  # and the highest value that it reads
BLOCK = 64  # readings


def converter(machine: str) -> ModuleType:
    """The machine's convert.py."""
    path = MACHINES / machine / "convert.py"
    spec = importlib.util.spec_from_file_location(f"{machine}_convert", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def drawn(rng: np.random.Generator, error: np.ndarray) -> np.ndarray:
    """As many residuals, in blocks that begin anywhere, on a circle."""
    begins = rng.integers(len(error), size=len(error) // BLOCK + 1)
    rows = (begins[:, None] + np.arange(BLOCK)).ravel() % len(error)
    return error[rows[: len(error)]]


def simulated(signals: Signals, fitted: FittedMachine, machine: str, seed: int) -> Signals:
    """The record as the fitted machine makes it, with noise drawn from its residuals."""
    sensor, highest = SENSORS[machine]
    [own] = fitted.predicted(signals, sensor)
    made = own.measured - own.error + drawn(np.random.default_rng(seed), own.error)
    reading = signals[sensor].only_valid()
    assert np.allclose(reading.time, own.time)
    changed = replace(reading, value=np.minimum(made, highest))
    return replace(signals, signals={**dict(signals.items()), sensor: changed})


def report(lines: list[dict]) -> str:
    """The share of records in which something was found, and its 95 % interval."""
    count, found = len(lines), sum(line["verdict"] != "none" for line in lines)
    low = beta.ppf(0.025, found, count - found + 1) if found else 0.0
    high = beta.ppf(0.975, found + 1, count - found) if found < count else 1.0
    return f"{found} of {count} found something: {found / count:.3f} [{low:.3f}, {high:.3f}]"


def main() -> None:
    """Draw, ask, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machine", choices=SENSORS)
    parser.add_argument("data", type=Path)
    parser.add_argument("result", type=Path)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--shard", type=Path, required=True)
    options = parser.parse_args()
    vehicle = load_vehicle(options.result / "extended.toml", trust=True)
    with TemporaryDirectory() as folder:
        paths = converter(options.machine).convert(options.data, Path(folder))
        signals = read_log(paths[:1], vehicle)
    fitted = FittedMachine.of(signals, vehicle)
    text = options.shard.read_text(encoding="utf-8") if options.shard.is_file() else ""
    lines = [json.loads(line) for line in text.splitlines()]
    with options.shard.open("a", encoding="utf-8") as shard:
        for seed in range(len(lines), options.draws):
            found = discover(simulated(signals, fitted, options.machine, seed), vehicle)
            effects = [cause.effect for cause in found.causes]
            lines.append({"seed": seed, "verdict": found.verdict, "causes": effects})
            shard.write(json.dumps(lines[-1]) + "\n")
            shard.flush()
    print(report(lines))


if __name__ == "__main__":
    main()
