"""False alarms on measured machines: the extended model as the truth, its own residuals as noise.

python benchmarks/foreign.py tanks DATA RESULT --draws 20 --shard tanks.jsonl: RESULT is what
machines/tanks/run.py wrote.  Each draw simulates a record of the discovery inputs with the extended
vehicle and noise drawn in blocks, and asks discover; the shard goes on where it ended.  The tanks'
residuals are slow: innovations of an autoregression are drawn, and added to the level.  The emps is
simulated under its own controller, disturbed by a force (machines/emps/closed_loop.py), and so is
the servo (machines/servo/closed_loop.py).
A finding there is a false alarm: its share, with the interval of Clopper and Pearson, is printed.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from scipy.stats import binomtest

from clutchest.discovery.discover import discover
from clutchest.identify.fitted_machine import FittedMachine
from clutchest.reading import read_log
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle

MACHINES = Path(__file__).resolve().parents[1] / "machines"
FULL = 10.0  # V, the highest level that the tanks' sensor reads
EDGE = 0.02  # V, within which it ends (machines/tanks/tanks.py)
ENDS = 9.99  # V, from which on its readings do not count (machines/tanks/tanks.toml)
BLOCK = 64  # readings
ORDER = 3  # of the autoregression of the tanks' residuals, the best by Akaike's criterion
SETTLED = 300  # readings, after which it has forgotten where it began

Draw = Callable[[int], Signals]  # the record of a seed


def innovations(error: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (ORDER) of an autoregression of residuals, less their mean, and what it leaves
    (k'), less its mean, which the colour would make seventy times as large; where the readings and
    those before them are ``known`` (k)."""
    error = error - error[known].mean()
    window = np.lib.stride_tricks.sliding_window_view(error, ORDER + 1)
    window = window[np.lib.stride_tricks.sliding_window_view(known, ORDER + 1).all(axis=1)]
    past, now = window[:, :-1][:, ::-1], window[:, -1]
    taps = np.linalg.lstsq(past, now, rcond=None)[0]
    rest = now - past @ taps
    return taps, rest - rest.mean()


def drawn(rng: np.random.Generator, taps: np.ndarray, rest: np.ndarray, count: int) -> np.ndarray:
    """So many residuals: blocks of innovations, of a circle that begins anywhere, in another order
    and each of either sign, coloured again; none comes twice before all have come once, since noise
    that repeats itself has lines.  Blocks of the residuals themselves would jump where they
    meet."""
    made = np.zeros(0)
    while len(made) < count + SETTLED:
        circle = np.roll(rest, rng.integers(len(rest)))
        blocks = np.split(circle, np.arange(BLOCK, len(rest), BLOCK))
        made = np.append(
            made,
            np.concatenate(
                [rng.choice((-1.0, 1.0)) * blocks[i] for i in rng.permutation(len(blocks))]
            ),
        )
    return lfilter([1.0], [1.0, *-taps], made)[SETTLED : SETTLED + count]


def unlimited(reading: np.ndarray) -> np.ndarray:
    """The level V that the equations' sensor, which ends smoothly at FULL, reads so (k)."""
    below = np.maximum(FULL - reading, 1e-9)
    return FULL + EDGE**2 / (4.0 * below) - below


def tanks(data: Path, signals: Signals, fitted: FittedMachine) -> Draw:
    """The level as the fitted tanks make it, and noise drawn from its residuals: of the level
    itself, before the sensor ends, and so not of readings at the end, which count in no draw."""
    convert, reading = import_module("convert"), signals["level"]
    [own] = fitted.predicted(convert.with_ends(signals), "level")
    inside = np.isin(reading.time, own.time)  # elsewhere the model is far beyond the sensor's end
    level, error = np.full(len(inside), np.inf), np.zeros(len(inside))
    level[inside], error[inside] = unlimited(own.measured - own.error), own.error
    taps, rest = innovations(error, reading.valid & (level < FULL))

    def simulated(seed: int) -> Signals:
        made = level + drawn(np.random.default_rng(seed), taps, rest, len(level))
        return convert.with_level(signals, np.where(made < ENDS, made, np.nan))

    return simulated


def emps(data: Path, signals: Signals, fitted: FittedMachine) -> Draw:
    """The carriage under its controller, disturbed by noise of the record's colour."""
    loop = import_module("closed_loop")
    rig = loop.Loop.of(data / import_module("convert").FILES["emps"], fitted)

    def read(table: pd.DataFrame) -> Signals:
        with TemporaryDirectory() as folder:
            made = Path(folder) / "record.parquet"
            table.to_parquet(made, index=False)
            return read_log([made], fitted.vehicle)

    spectrum = loop.spectrum_of(rig, fitted, signals, read)
    return lambda seed: read(rig.drawn(spectrum, seed))


def servo(data: Path, signals: Signals, fitted: FittedMachine) -> Draw:
    """The arm under its controller, disturbed by noise of the record's colour."""
    convert, loop = import_module("convert"), import_module("closed_loop")

    def read(tables: Sequence[pd.DataFrame]) -> Signals:
        with TemporaryDirectory() as folder:
            made = [Path(folder) / f"run_{i:03d}.parquet" for i in range(len(tables))]
            for path, table in zip(made, tables, strict=True):
                table.to_parquet(path, index=False)
            return read_log(made, fitted.vehicle)

    runs = convert.chosen(convert.runs(data), convert.DISCOVERY)
    own = loop.Loop.of(runs, fitted).as_noisy(signals, read)
    return lambda seed: read(own.drawn(seed))


DRAWS = {"tanks": tanks, "emps": emps, "servo": servo}


def exact(vehicle: Vehicle) -> Vehicle:
    """The vehicle with effects exactly as its file states them.

    Fitted within their spreads they may end far from there, and a cause that spares the way back
    would be no false alarm.
    """
    curves = {name: replace(curve, covariance=()) for name, curve in vehicle.curves.items()}
    return replace(vehicle, effects_spread={}, curves=curves)


def draw_of(machine: str, data: Path, vehicle: Vehicle) -> Draw:
    """Records of a machine as the vehicle states it, its parameters fitted to the discovery
    record."""
    sys.path[:0] = [str(MACHINES / machine), str(MACHINES)]
    with TemporaryDirectory() as folder:
        paths = import_module("convert").convert(data, Path(folder))
        signals = read_log(paths[0] if isinstance(paths[0], list) else paths[:1], vehicle)
    return DRAWS[machine](data, signals, FittedMachine.of(signals, exact(vehicle)))


def report(lines: list[dict]) -> str:
    """The share of records in which something was found, and its 95 % interval."""
    count, found = len(lines), sum(line["verdict"] != "none" for line in lines)
    limits = binomtest(found, count).proportion_ci(0.95, "exact")
    share = f"{found / count:.3f} [{limits.low:.3f}, {limits.high:.3f}]"
    return f"{found} of {count} found something: {share}"


def main() -> None:
    """Draw, ask, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machine", choices=DRAWS)
    parser.add_argument("data", type=Path)
    parser.add_argument("result", type=Path)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first draw")
    parser.add_argument("--shard", type=Path, required=True)
    options = parser.parse_args()
    vehicle = load_vehicle(options.result / "extended.toml", trust=True)
    draw = draw_of(options.machine, options.data, vehicle)
    text = options.shard.read_text(encoding="utf-8") if options.shard.is_file() else ""
    lines = [json.loads(line) for line in text.splitlines()]
    with options.shard.open("a", encoding="utf-8") as shard:
        for seed in range(options.first + len(lines), options.first + options.draws):
            found = discover(draw(seed), vehicle)
            effects = [cause.effect for cause in found.causes]
            lines.append({"seed": seed, "verdict": found.verdict, "causes": effects})
            shard.write(json.dumps(lines[-1]) + "\n")
            shard.flush()
    print(report(lines))


if __name__ == "__main__":
    main()
