"""What two plain ways of looking make of the same cases, at their best: the true states given.

    python benchmarks/blind/rivals.py --out blind-out

Both look at the torque that the engine's acceleration lacks when the equations are fed with the
true temperatures, speeds and zero position, and the vehicle file's numbers.  ``regression`` takes
every driver that goes with it significantly; ``sindy`` is pysindy's sparse regression on all
drivers and their products, its threshold chosen by what it explains of the other half of the
drive.  Neither knows a cause by name: a finding is any term at all.  What ``discover`` found in the
same cases, from the log alone, stands beside them.  A run that was stopped goes on where it was.
Needs pysindy.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import pearsonr

from clutchest.models import machine_of

sys.path.insert(0, str(Path(__file__).parent.parent))  # started as a file, not as a package

from kept_records import keep, kept

from blind.cases import answer, drive_of, outsider_of
from blind.drives import NOISES, Drive
from blind.filtered import large, left_over
from blind.first_run import at_driver
from blind.plan import Case
from blind.row import Record, share
from blind.sealed import KNOWN, unseal
from blind.table import finished
from clutchest.estimate.samples import slope
from clutchest.signals import Floats, Signals

LEVEL = 0.01  # family-wise, of what plain regression takes for significant
WINDOW = 0.2  # s of a straight line through the engine speed
EDGE = 0.2  # s after slip begins and before it ends that are left out
THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # sparse regression's, in standard deviations


def lacking(signals: Signals, drive: Drive) -> tuple[dict[str, Floats], Floats]:
    """Drivers (name → (K,)) and the torque (K), Nm, that the engine's acceleration lacks, at every
    reading of the engine speed while the clutch slips."""
    truth = signals.truth
    assert truth is not None
    model = machine_of(drive.vehicle.model).equations(set(signals))
    e = model.expressions()
    rate = e.rate[model.state("engine_speed")]
    speed = signals["engine_speed"]
    slips = (truth.columns["mode"] == "slipping").astype(float)
    at_reading = np.interp(speed.time, truth.time, slips)
    count = max(round(EDGE / float(np.median(np.diff(speed.time)))), 1)
    inside = np.convolve(at_reading, np.ones(2 * count + 1), "same") > 2 * count + 1 - 1e-6
    t = speed.time[inside]
    given = {name: np.interp(t, signals[name].time, signals[name].value) for name in signals}
    true = {
        name: np.interp(t, truth.time, column)
        for name, column in truth.columns.items()
        if column.dtype.kind == "f"
    }
    values = {**given, **true}
    parameters = {q.key: drive.vehicle.parameters[q.key].value for q in model.parameters}
    rest = drive.vehicle.machine.at_rest(
        parameters, {name: value[0] for name, value in given.items()}
    )
    for state in model.states:  # what adapts would hide what is sought
        if state.healthy_std is not None:
            values[state.name] = np.full(len(t), rest.get(state.name, 0.0))
    x = np.column_stack([values[state.name] for state in model.states])
    u = np.column_stack([given.get(item.name, np.zeros(len(t))) for item in model.inputs])
    p = np.array(list(parameters.values()))
    w = np.ones((len(t), len(model.regime)))
    w[:, model.regime.index("engaged")] = 0.0
    (expected,) = e.along(rate, x, u, w, p, np.zeros(e.g.numel()))
    inertia = parameters["engine_inertia"]
    measured = slope(speed, 0.0, WINDOW)[0].value[inside]
    found = {item.name: u[:, j] for j, item in enumerate(model.inputs) if item.name in given}
    found |= {state.name: x[:, i] for i, state in enumerate(model.states)}
    moving = slope(signals["slave_position"], 0.0, WINDOW)[0]
    found["position_rate"] = np.interp(t, moving.time, moving.value)
    found["slip_speed"] = values["slip_speed"]
    found["energy"], found["time"] = values["slip_energy"], t
    moves = {k: v for k, v in found.items() if np.ptp(v) > 1e-9 * np.max(np.abs(v))}
    return moves, inertia * (measured - expected)


def regression(drivers: dict[str, Floats], lacks: Floats) -> list[str]:
    """Drivers that go with what is lacking, the closest first."""
    tests = {name: pearsonr(value, lacks) for name, value in drivers.items()}
    taken = [name for name, test in tests.items() if test.pvalue < LEVEL / len(tests)]
    return sorted(taken, key=lambda name: -abs(tests[name].statistic))


def sindy(drivers: dict[str, Floats], lacks: Floats) -> list[str]:
    """Drivers in the terms that sparse regression keeps, the weightiest first."""
    import pysindy

    names = list(drivers)
    x = np.column_stack([(v - np.mean(v)) / np.std(v) for v in drivers.values()])
    library = pysindy.PolynomialLibrary(degree=2, include_bias=True)
    terms = np.asarray(library.fit_transform(x))
    y = lacks / np.std(lacks)
    half, best, kept = len(y) // 2, 1.0, np.zeros(terms.shape[1])
    for threshold in THRESHOLDS:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=0.05)
        with warnings.catch_warnings():  # that nothing passes a threshold is an answer
            warnings.simplefilter("ignore", UserWarning)
            optimizer.fit(terms[:half], y[:half, None])
        weights = optimizer.coef_[0]
        left = np.var(y[half:] - terms[half:] @ weights) / np.var(y[half:])
        if left < best and np.any(weights[1:]):
            best, kept = left, weights
    weight = dict.fromkeys(names, 0.0)
    for term, size in zip(library.get_feature_names(names), kept, strict=True):
        for name in term.replace("^2", "").split(" "):
            if name in weight:
                weight[name] = max(weight[name], abs(float(size)))
    return sorted((n for n in names if weight[n] > 0.0), key=lambda n: -weight[n])


METHODS = {"regression": regression, "sindy": sindy}


def judged(record: Record, answer: dict[str, Any]) -> Record:
    """What each method finds in a case that was scored."""
    case = case_of(record)
    drive = drive_of(case, answer)
    drivers, lacks = lacking(drive.signals(answer["effects"], outsider_of(answer)), drive)
    return {"name": record["name"]} | {n: method(drivers, lacks) for n, method in METHODS.items()}


def case_of(record: Record) -> Case:
    return Case(*(record[key] for key in ("part", "cause", "d_prime", "noise", "number")))


def answer_of(record: Record, out: Path, known: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """What was hidden in a case; asks no oracle where nothing was."""
    case = case_of(record)
    sealed = out / "answers" / f"{case.blind_name}.sealed"
    if sealed.exists():
        return unseal(sealed)
    return known[case.name] if case.name in known else answer(case)


def counted(scored: Sequence[Record]) -> dict[str, list[Record]]:
    """Part → the cases that a line of the table is about."""
    nulls = [r for r in scored if r["part"] == "null"]
    return {"null": nulls, "effect": large(scored), "outsider": left_over(scored)}


def lines(scored: Sequence[Record], found: Mapping[str, Record]) -> str:
    """The table: discover's column, and one of each method; what each ``found`` by name."""
    of = counted([r for r in scored if r["name"] in found])

    def line(
        what: str,
        cases: list[Record],
        ours: Callable[[Record], bool],
        theirs: Callable[[Record, list[str]], bool],
    ) -> str:
        hits = [[ours(r) for r in cases]]
        hits += [[theirs(r, found[r["name"]][method]) for r in cases] for method in METHODS]
        return f"{what:36}{len(cases):6}" + "".join(f"{_share(each):>22}" for each in hits)

    def finds(what: str, cases: list[Record]) -> str:
        return line(what, cases, lambda r: bool(r["verdict"] != "none"), lambda _, n: bool(n))

    return "\n".join(
        [
            f"{'what':36}{'cases':>6}" + "".join(f"{n:>22}" for n in ("discover", *METHODS)),
            *(
                finds(f"false findings, {noise}", [r for r in of["null"] if r["noise"] == noise])
                for noise in NOISES
            ),
            finds("finds effects, d′ ≥ 12", of["effect"]),
            line(
                "outsiders, driver in the first two",
                of["outsider"],
                lambda r: at_driver(r, r["drivers"]),
                at_driver,
            ),
        ]
    )


def _share(hits: list[bool]) -> str:
    row = share("", "", hits, lambda _: True)
    return "–" if row.value is None else f"{row.value:.2f} [{row.low:.2f}, {row.high:.2f}]"


def main() -> None:
    parser = argparse.ArgumentParser(description="plain methods on the cases that were scored")
    parser.add_argument("--out", type=Path, default=Path("blind-out"))
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    scored, path = list(finished(given.out).values()), given.out / "rivals.jsonl"
    found = {r["name"]: r for r in kept(path)}
    left = [r for part in counted(scored).values() for r in part if r["name"] not in found]
    known = unseal(KNOWN)
    with ProcessPoolExecutor(given.jobs) as pool:
        told = [answer_of(r, given.out, known) for r in left]
        for i, each in enumerate(pool.map(judged, left, told), 1):
            found[each["name"]] = each
            keep(path, each)
            print(f"{i}/{len(left)}", file=sys.stderr, flush=True)
    table = lines(scored, found)
    (given.out / "rivals.txt").write_text(table + "\n", encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
