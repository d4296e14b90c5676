"""Other programs on the measured machines: how well they simulate the held-out record.

    python benchmarks/rivals.py DATA [--machine emps] [--program narx]

Three ways of the field that need no equations: sparse regression (``pysindy``), a polynomial NARX
whose terms forward orthogonal regression chooses, and a neural state-space model with an encoder
(``torch``).  The first two are given the textbook's dry friction (a sign of the speed) and outlets
(a root of the level).  Orders, thresholds and sizes are chosen on the discovery record: fitted to
two thirds of it, they simulate the worse of these and the last third best.  The model is then
fitted to all of it.  The held-out record only gives the score: rms of measured − simulated from
the input alone, after START samples that a program without states needs to begin.  A library that
is missing is named.
"""

from __future__ import annotations

import argparse
import importlib.util
import runpy
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from itertools import combinations_with_replacement, islice, product
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import pandas as pd

MACHINES = Path(__file__).resolve().parents[1] / "machines"
COLUMNS = {"emps": ("force", "speed", 0.01), "tanks": ("pump", "level", 4.0)}  # s between samples
START = 10  # samples from which the first state is made
BOUND = 1e3  # times the scale of the output: a simulation that leaves it has diverged
SIZES = ((2, 16), (4, 64))  # states and hidden units of the networks
TURNS, EVERY, LENGTH = 3000, 500, 100  # of training; turns between candidates; samples simulated
STEPS = 10  # of an integration, between two samples

Array = np.ndarray
Simulate = Callable[[Array, Array], Array]  # input (K), first outputs (START) → output (K)
Models = Iterator[tuple[str, Simulate]]  # what it is, and what it makes of an input


@dataclass(frozen=True)
class Record:
    """Input and output (K), both over their scale; and s between samples."""

    u: Array
    y: Array
    period: float

    def part(self, first: int, end: int) -> Record:
        """Some of the samples."""
        return Record(self.u[first:end], self.y[first:end], self.period)


@dataclass(frozen=True)
class Task:
    """Records for discovery and held out, what an output of 1 is, the textbook's shape of it, and
    whether a state is hidden."""

    own: Record
    held_out: Record
    scale: float
    unit: str
    shape: Callable[[Array], Array]
    hidden: bool


def task_of(machine: str, data: Path) -> Task:
    """The machine's records, over the standard deviations of the first."""
    convert = runpy.run_path(str(MACHINES / machine / "convert.py"))["convert"]
    u, y, period = COLUMNS[machine]
    with TemporaryDirectory() as folder:
        tables = [pd.read_parquet(path).dropna(subset=[y]) for path in convert(data, Path(folder))]
    by, scale = float(tables[0][u].std()), float(tables[0][y].std())
    own, other = (Record(t[u].to_numpy() / by, t[y].to_numpy() / scale, period) for t in tables)
    if machine == "emps":
        turns = 2e-4 / scale  # m/s, within which dry friction turns its sign
        return Task(own, other, 1e3 * scale, "mm/s", lambda y: np.tanh(y / turns), False)
    return Task(own, other, scale, "V", lambda y: np.sqrt(np.maximum(y, 0.0)), True)


def powers(count: int, degree: int) -> Array:
    """Exponents (n, count) of all products of up to ``degree`` of so many variables."""
    some = [c for d in range(degree + 1) for c in combinations_with_replacement(range(count), d)]
    return np.array([np.bincount(np.array(c, int), minlength=count) for c in some])


def terms(variables: Array, exponents: Array) -> Array:
    """Products (..., n) of variables (..., count)."""
    return np.prod(variables[..., None, :] ** exponents, axis=-1)


def ranked(columns: Array, target: Array, count: int) -> list[int]:
    """The first terms by forward orthogonal regression: each explains most of what is left."""
    left, rest, chosen = columns.copy(), target.copy(), []
    for _ in range(min(count, columns.shape[1])):
        size = np.sum(left**2, axis=0)
        size[size < 1e-9 * np.sum(columns**2, axis=0)] = np.inf
        best = int(np.argmax((rest @ left) ** 2 / size))
        direction = left[:, best] / np.sqrt(size[best])
        rest = rest - direction * (direction @ rest)
        left = left - np.outer(direction, direction @ left)
        left[:, best] = 0.0
        chosen.append(best)
    return chosen


def narx(task: Task, fitted: Record) -> Models:
    """Polynomials of past outputs, inputs and the textbook's shape."""

    def simulate(past: int, used: Array, values: Array, u: Array, first: Array) -> Array:
        made = np.concatenate([first, np.zeros(len(u) - START)])
        for k in range(START, len(u)):
            change = terms(variables(made, u, k, past), used) @ values
            made[k] = np.clip(made[k - 1] + change, -2 * BOUND, 2 * BOUND)
        return made

    def variables(y: Array, u: Array, k: int, past: int) -> Array:
        return np.concatenate([y[k - past : k], u[k - past : k], task.shape(y[k - 1 : k])])

    y, u = fitted.y, fitted.u
    for past, degree in product((1, 2, 4, 8), (1, 2, 3)):
        rows = np.array([variables(y, u, k, past) for k in range(past, len(y))])
        exponents, target = powers(2 * past + 1, degree), y[past:] - y[past - 1 : -1]
        columns = terms(rows, exponents)
        order = ranked(columns, target, 40)
        for count in (4, 6, 10, 15, 20, 30, 40):
            used = order[:count]
            values = np.linalg.lstsq(columns[:, used], target, rcond=None)[0]
            words = f"{past} past samples, degree {degree}, {len(used)} terms"
            yield words, partial(simulate, past, exponents[used], values)


def sindy(task: Task, fitted: Record) -> Models:
    """dy/dt, or d²y/dt² where a state is hidden, as a sparse sum of products."""
    import pysindy

    def variables(state: Sequence[Array], u: Array) -> Array:
        return np.stack([state[0], u, task.shape(state[0]), *state[1:]], axis=-1)

    def simulate(exponents: Array, values: Array, u: Array, first: Array) -> Array:
        slope = np.polyfit(fitted.period * np.arange(START), first, 1)[0]
        now, made = np.array([first[-1], slope][:order]), list(first)
        for k in range(START - 1, len(u) - 1):
            for _ in range(STEPS):
                change = terms(variables(now, u[k]), exponents) @ values
                now = now + fitted.period / STEPS * np.append(now[1:], change)
                now = np.clip(now, -2 * BOUND, 2 * BOUND)
            made.append(now[0])
        return np.array(made)

    order = 2 if task.hidden else 1
    names = ("y", "u", "shape", "dy/dt")[: order + 2]
    for window, degree in product((7, 15, 31), (1, 2, 3)):
        smooth = pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": window})
        state = [fitted.y]
        for _ in range(order):
            state.append(np.asarray(smooth(state[-1][:, None], fitted.period)).ravel())
        exponents, by = powers(order + 2, degree), np.std(state[-1])
        columns = terms(variables(state[:-1], fitted.u), exponents)
        size = np.sqrt(np.mean(columns**2, axis=0))
        for threshold in (0.01, 0.02, 0.05, 0.1, 0.2, 0.5):
            optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-3)
            optimizer.fit(columns / size, (state[-1] / by)[:, None])
            used = np.flatnonzero(optimizer.coef_)
            values = (by * optimizer.coef_.ravel() / size)[used]
            products = ["·".join(np.repeat(names, row)) or "1" for row in exponents[used]]
            words = f"window {window}, degree {degree}, threshold {threshold}: "
            yield words + ", ".join(products), partial(simulate, exponents[used], values)


def unrolled(parts, past, u):
    """Outputs (n, K) of inputs (n, K) after ``past`` outputs and inputs (n, 2 START)."""
    import torch

    step, begin = parts
    x, made = begin(past), []
    for k in range(u.shape[1]):
        made.append(x[:, 0])
        x = x + 0.1 * step(torch.cat([x, u[:, k : k + 1]], 1))
    return torch.stack(made, 1)


def network(task: Task, fitted: Record) -> Models:
    """x + f(x, u) with x₁ = y, the first x from the START samples before: f and that are networks
    of one hidden layer, trained on simulations of LENGTH samples, with one seed."""
    import torch

    def simulate(parts, u: Array, first: Array) -> Array:
        past = torch.tensor(np.concatenate([first, u[:START]]), dtype=torch.float32)[None]
        with torch.no_grad():
            made = unrolled(parts, past, torch.tensor(u[START:], dtype=torch.float32)[None])
        return np.concatenate([first, made[0].numpy()])

    def layers(inputs: int, hidden: int, outputs: int) -> torch.nn.Module:
        ends = torch.nn.Linear(inputs, hidden), torch.nn.Linear(hidden, outputs)
        return torch.nn.Sequential(ends[0], torch.nn.Tanh(), ends[1])

    torch.set_num_threads(1)
    y, u = (torch.tensor(each, dtype=torch.float32) for each in (fitted.y, fitted.u))
    for states, hidden in SIZES:
        torch.manual_seed(0)
        sizes = (states + 1, hidden, states), (2 * START, hidden, states)
        parts = torch.nn.ModuleList([layers(*each) for each in sizes])
        adam = torch.optim.Adam(parts.parameters(), lr=2e-3)
        for turn in range(1, TURNS + 1):
            begins = torch.randint(START, len(y) - LENGTH, (64, 1))
            past, rows = begins + torch.arange(-START, 0), begins + torch.arange(LENGTH)
            made = unrolled(parts, torch.cat([y[past], u[past]], 1), u[rows])
            adam.zero_grad()
            torch.mean((made - y[rows]) ** 2).backward()
            adam.step()
            if turn % EVERY == 0:
                words = f"{states} states, {hidden} hidden units, {turn} turns"
                yield words, partial(simulate, deepcopy(parts))


PROGRAMS = {"pysindy": sindy, "narx": narx, "torch": network}


def score(simulate: Simulate, record: Record) -> float:
    """rms of measured − simulated, over the scale; infinite where the simulation diverges."""
    simulated = simulate(record.u, record.y[:START])
    bounded = bool(np.all(np.abs(simulated) < BOUND))
    return float(np.sqrt(np.mean((record.y - simulated)[START:] ** 2))) if bounded else np.inf


def judged(task: Task, program: Callable[[Task, Record], Models]) -> tuple[str, ...]:
    """How many were tried, which was chosen, its scores on discovery and held out, time."""
    begun, end = process_time(), 2 * len(task.own.y) // 3
    first, last = task.own.part(0, end), task.own.part(end - START, len(task.own.y))
    tried = [max(score(each, first), score(each, last)) for _, each in program(task, first)]
    words, simulate = next(islice(program(task, task.own), int(np.argmin(tried)), None))
    scores = [f"{task.scale * each:.3g}" for each in (min(tried), score(simulate, task.held_out))]
    return (f"{len(tried)}, {words}", *scores, task.unit, f"{process_time() - begun:.0f} s")


def main() -> None:
    """Fit, choose, score, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the official files")
    parser.add_argument("--machine", choices=COLUMNS, action="append")
    parser.add_argument("--program", choices=PROGRAMS, action="append")
    options = parser.parse_args()
    print("machine | program | tried, chosen | discovery | held out | unit | processor time")
    for machine, name in product(options.machine or COLUMNS, options.program or PROGRAMS):
        if name != "narx" and importlib.util.find_spec(name) is None:
            print(f"{machine} | {name} | not installed: pip install {name}")
            continue
        columns = judged(task_of(machine, options.data), PROGRAMS[name])
        print(" | ".join((machine, name, *columns)), flush=True)


if __name__ == "__main__":
    main()
