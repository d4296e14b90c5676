"""What two plain ways of looking make of the same cases, at their best: the true states given.

    python benchmarks/blind/rivals.py --out blind-out

Both look at the torque that the engine's acceleration lacks when the equations are fed with the
true temperatures, speeds and zero position, and the vehicle file's numbers.  ``regression`` takes
every driver that goes with it significantly; ``sindy`` is pysindy's sparse regression on all
drivers and their products, its threshold chosen by what it explains of the other half of the
drive.  Neither knows a cause by name: a finding is any term at all.  Needs pysindy.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import pearsonr

sys.path.insert(0, str(Path(__file__).parent.parent))  # started as a file, not as a package

from blind.cases import drive_of, outsider_of
from blind.drives import NOISES, Drive
from blind.plan import Case
from blind.sealed import unseal
from blind.table import LEFT, NAMED, Row, share, show
from clutchest.estimate.samples import slope
from clutchest.models import model_for, resting
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
    model = model_for(drive.vehicle.model, set(signals))
    e = model.expressions()
    rate = e.rate[model.state("engine_speed")]
    speed = signals["engine_speed"]
    slips = (truth.columns["mode"] == "slipping").astype(float)
    at_reading = np.interp(speed.time, truth.time, slips)
    count = max(round(EDGE / float(np.median(np.diff(speed.time)))), 1)
    inside = np.convolve(at_reading, np.ones(2 * count + 1), "same") > 2 * count + 1 - 1e-6
    t = speed.time[inside]
    given = {name: np.interp(t, signals[name].time, signals[name].value) for name in signals}
    true = {name: np.interp(t, truth.time, column) for name, column in truth.columns.items()
            if column.dtype.kind == "f"}  # fmt: skip
    values = {**given, **true}
    parameters = {q.key: drive.vehicle.parameters[q.key].value for q in model.parameters}
    rest = resting(model.name, parameters, {name: value[0] for name, value in given.items()})
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


def judged(case: Case, answer: dict[str, Any]) -> dict[str, Any]:
    """What each method finds in one case."""
    drive = drive_of(case, answer)
    signals = drive.signals(answer["effects"], outsider_of(answer))
    drivers, lacks = lacking(signals, drive)
    return {
        "part": case.part, "noise": case.noise, "reached": answer.get("d_prime", 0.0),
        "drivers": (answer.get("where") or {}).get("drivers", []),
        **{name: method(drivers, lacks) for name, method in METHODS.items()},
    }  # fmt: skip


def rows(records: list[dict[str, Any]]) -> list[Row]:
    """The table's lines, method by method."""
    found = []
    for name in METHODS:
        for noise in NOISES:
            nulls = [bool(r[name]) for r in records if r["part"] == "null" and r["noise"] == noise]
            found.append(share(f"{name}: false findings, {noise}", "", nulls, lambda _: True, 0.99))
        large = [r for r in records if r["part"] == "effect" and r["reached"] >= NAMED]
        found.append(share(f"{name}: finds effects, d′ ≥ 12", "", [bool(r[name]) for r in large],
                           lambda _: True))  # fmt: skip
        left = [r for r in records if r["part"] == "outsider" and r["reached"] >= LEFT]
        found.append(share(f"{name}: outsiders, driver in the first two", "",
                           [bool(set(r["drivers"]) & set(r[name][:2])) for r in left],
                           lambda _: True))  # fmt: skip
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="plain methods on the cases that were scored")
    parser.add_argument("--out", type=Path, default=Path("blind-out"))
    out = parser.parse_args().out
    lines = [line for path in sorted(out.glob("records-*.jsonl")) for line in path.open()]
    scored = [r for r in map(json.loads, lines) if r["part"] != "hour"]
    records = []
    for i, r in enumerate(scored, 1):
        case = Case(r["part"], r["cause"], r["d_prime"], r["noise"], r["number"])
        records.append(judged(case, unseal(out / "answers" / f"{case.blind_name}.sealed")))
        print(f"{i}/{len(scored)}", file=sys.stderr, flush=True)
    (out / "rivals.json").write_text(json.dumps(records, indent=1), encoding="utf-8")
    print(show(rows(records)))


if __name__ == "__main__":
    main()
