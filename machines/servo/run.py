"""Discovers what the textbook's model of the STS3215 servo gets wrong, and what that is worth.

python machines/servo/run.py DATA --out DIR: DATA holds the table of runs; DIR gets result.json,
extended.toml, the report of the first discovery and a picture.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import published  # noqa: E402
from convert import BEAT, DISCOVERY, HELD_OUT, chosen, convert, duty_of, runs  # noqa: E402
from two_records import folder  # noqa: E402

from clutchest.discovery.chain import chain, extended_by, summary  # noqa: E402
from clutchest.identify.fitted_machine import FittedMachine  # noqa: E402
from clutchest.reading import read_log  # noqa: E402
from clutchest.record.discovery import write_discovery  # noqa: E402
from clutchest.vehicle import dump_vehicle, load_vehicle  # noqa: E402

ERROR_GAIN = (
    0.1649  # duty per rad of error and unit of the firmware's gain, as its authors measured
)
MOST_LATE = 12  # steps
RATES = (*np.arange(4.0, 7.05, 0.1), np.inf)  # rad/s, at most, of the goal that is aimed at
STEP, FINE = 0.005, 5  # s between the bench's rows, and steps of our equations in between
RESAMPLED = 1000  # draws of the bootstrap over runs

Rates = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class Bench:
    """Runs side by side, padded to the longest: arrays (steps, runs), ``counts`` where they are
    measured."""

    def __init__(self, some: list[pd.DataFrame]) -> None:
        longest = max(map(len, some))

        def padded(name: str) -> np.ndarray:
            columns = [run[name].to_numpy().astype(float) for run in some]
            return np.array([np.pad(c, (0, longest - len(c)), mode="edge") for c in columns]).T

        self.goal, self.position, self.supply = map(
            padded, ("goal_rad", "position_rad", "supply_V")
        )
        self.on, self.reported = map(padded, ("torque_enabled", "torque"))
        self.counts = np.arange(longest)[:, None] < np.array([len(run) for run in some])
        self.gain, self.mass, self.arm = (
            np.array([run[name].iloc[0] for run in some]) for name in ("kp", "mass_kg", "arm_m")
        )

    def aims(self, late: int, rate: float) -> np.ndarray:
        """The goal that the controller aims at (steps, runs), rad, where goals take ``late`` steps
        to arrive and it moves towards them by ``rate`` rad/s at most."""
        aim, aims = self.position[0], []
        for k in range(len(self.goal)):
            off = self.goal[max(k - late, 0)] - aim
            aim = aim + np.clip(off, -rate * STEP, rate * STEP)
            aims.append(aim)
        return np.array(aims)

    def duty(self, aim: np.ndarray, position: np.ndarray) -> np.ndarray:
        """What the servo's controller commands (…, runs) that aims there, at a position."""
        return np.clip(ERROR_GAIN * self.gain * (aim - position), -1.0, 1.0)

    def switched(self, k: int, late: int = 0) -> np.ndarray:
        """1 while the bridge is on (runs)."""
        return self.on[max(k - late, 0)]

    def absolute_error(self, simulated: np.ndarray) -> np.ndarray:
        """Mean absolute error of the position in every run (runs), rad."""
        off = np.abs(simulated - self.position) * self.counts
        return off.sum(axis=0) / self.counts.sum(axis=0)


def controller(bench: Bench) -> tuple[int, float, float]:
    """Steps that a goal takes to arrive and the rate, rad/s, at most, of the goal that is aimed at,
    by the duty that the servo reports; and the rms by which that differs from theirs."""
    reported = np.column_stack([duty_of(column) for column in bench.reported.T])
    known = np.isfinite(reported) & bench.counts & (bench.on > 0.0)
    off = {}
    for late, rate in itertools.product(range(MOST_LATE), RATES):
        made = bench.duty(bench.aims(late, rate), bench.position)
        off[late, float(rate)] = float(np.sqrt(np.mean((made - reported)[known] ** 2)))
    late, rate = min(off, key=off.__getitem__)
    return late, rate, off[late, rate]


def by_published(bench: Bench, late: int = 0, rate: float = np.inf) -> np.ndarray:
    """Positions (steps, runs) as M6 simulates them."""
    aims = bench.aims(late, rate)
    position, speed, path = bench.position[0].copy(), np.zeros(len(bench.gain)), []
    known = {"mass": bench.mass, "arm": bench.arm}
    for k in range(len(bench.goal)):
        path.append(position.copy())
        voltage = bench.supply[k] * bench.duty(aims[k], position)
        change = published.acceleration(position, speed, voltage, bench.switched(k, late), known)
        speed = speed + published.STEP * change
        position = position + published.STEP * speed
    return np.array(path)


def by_machine(
    bench: Bench, fitted: FittedMachine, late: int, rate: float, pushed: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and duties (steps, runs) as our equations simulate them, controller and all, the
    arm ``pushed`` (steps, runs) by these rad/s².

    Between two rows goal, supply and the bridge's flag are on straight lines, as they are for who
    reads the rows: a goal held there would act half a step, 2.5 ms, later than its duty tells.
    """
    model, rates = fitted.posterior.problem.compiled.model, fitted.rates()
    count, last = len(bench.gain), len(bench.goal) - 1
    x, position = np.zeros((len(model.states), count)), bench.position[0].copy()
    x[[state.unit == "s" for state in model.states]] = -BEAT * STEP  # where a table begins
    place, path, duties, dt = model.state("speed"), [], [], STEP / FINE
    constant = {
        "moment": bench.mass * 9.81 * bench.arm,
        "load_inertia": bench.mass * bench.arm**2,
        "acceleration": np.zeros(count),
    }
    rows = [bench.switched(k, late) for k in range(last + 1)]
    given = np.stack([bench.aims(late, rate), bench.supply, np.array(rows)], axis=1)
    push = np.zeros((*bench.goal.shape, len(x)))
    push[..., place] = pushed

    def slope(k: int, part: float, x: np.ndarray, position: np.ndarray) -> np.ndarray:
        """States' rates (n, runs), this part of the way from row k to the next."""
        aim, supply, on = given[k] + part * (given[min(k + 1, last)] - given[k])
        own = {"duty": bench.duty(aim, position) * on, "supply": supply, "enabled": on}
        known = constant | own | {"position": position}
        u = np.array([known[item.name] for item in model.inputs])
        return np.array(rates(x, u, np.ones((1, count)))) + push[k].T

    for k in range(last + 1):
        path.append(position.copy())
        duties.append(bench.duty(given[k, 0], position) * given[k, 2])
        for i in range(FINE):
            half = x + dt / 2.0 * slope(k, i / FINE, x, position)
            middle = position + dt / 2.0 * x[place]
            x = x + dt * slope(k, (i + 0.5) / FINE, half, middle)
            position = position + dt * half[place]
    return np.array(path), np.array(duties)


def less(before: np.ndarray, after: np.ndarray) -> list[float]:
    """95 % interval of mean(before) − mean(after) over runs, by a bootstrap."""
    drawn = np.random.default_rng(0).integers(len(before), size=(RESAMPLED, len(before)))
    return np.quantile((before - after)[drawn].mean(axis=1), [0.025, 0.975]).tolist()


def draw(bench: Bench, paths: dict[str, np.ndarray], path: Path) -> None:
    """Four runs: the position measured and simulated."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(11, 6), constrained_layout=True)
    for axis, i in zip(axes.ravel(), range(0, len(bench.gain), len(bench.gain) // 4), strict=False):
        inside = bench.counts[:, i]
        time = STEP * np.arange(inside.sum())
        axis.plot(time, bench.position[inside, i], "k", lw=1.5, label="measured")
        for label, each in paths.items():
            axis.plot(time, each[inside, i], lw=1, label=label)
        axis.set(xlabel="time [s]", ylabel="angle [rad]", title=f"{bench.mass[i]:.3g} kg")
        axis.grid(alpha=0.3)
    axes[0, 0].legend()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run, and write what came out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the table of runs")
    parser.add_argument("--out", type=folder, required=True)
    options = parser.parse_args()
    wall, cpu = perf_counter(), process_time()
    vehicle = load_vehicle(HERE / "sts3215.toml", trust=True)
    with TemporaryDirectory() as place:
        own, other = convert(options.data, Path(place))
        signals, held_out = read_log(own, vehicle), read_log(other, vehicle)
    found = chain(signals, vehicle, held_out.drives)
    extended = extended_by(found, vehicle)
    fitted = [FittedMachine.of(signals, each) for each in (vehicle, extended)]
    record = runs(options.data)
    late, rate, off = controller(Bench(chosen(record, DISCOVERY)))
    bench = Bench(chosen(record, HELD_OUT))
    paths = {
        name: by_machine(bench, each, late, rate)[0]
        for name, each in zip(("textbook", "extended"), fitted, strict=True)
    } | {"M6": by_published(bench), "M6, such goals": by_published(bench, late, rate)}
    error = {name: bench.absolute_error(path) for name, path in paths.items()}
    result = {
        **summary(found),
        "rmse_before": float(error["textbook"].mean()),
        "rmse_after": float(error["extended"].mean()),
        "rmse_of": "mean absolute error of the simulated angle, runs held out, rad, untrimmed",
        "m6": float(error["M6"].mean()),
        "m6_with_such_goals": float(error["M6, such goals"].mean()),
        "controller": {"goals_late_s": late * STEP, "goals_rad_per_s": rate, "duty_rms": off},
        "less_ci95": less(error["textbook"], error["extended"]),
        "less_than_m6_ci95": less(error["M6"], error["extended"]),
        "less_than_m6_with_such_goals_ci95": less(error["M6, such goals"], error["extended"]),
        "fitted": {"before": dict(fitted[0].numbers), "after": dict(fitted[1].numbers)},
        "seconds": perf_counter() - wall,
        "processor_seconds": process_time() - cpu,
    }
    (options.out / "result.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
    dump_vehicle(extended, options.out / "extended.toml")
    write_discovery(found[0], options.out / "first")
    draw(bench, paths, options.out / "angle.png")
    words = (
        "verdict",
        "where",
        "rmse_before",
        "rmse_after",
        "m6",
        "m6_with_such_goals",
        "less_ci95",
    )
    print(json.dumps({k: result[k] for k in words}, indent=1))


if __name__ == "__main__":
    main()
