"""The filter on drives drawn from its own model: against the Cramér–Rao bound, and consistent?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from clutches import CLUTCHES, Clutch
from numpy.typing import NDArray
from scipy.stats import chi2
from statistic import interval, line, shown

import clutchest
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.timeline import Timeline, build
from clutchest.estimate.whole_log import Belief, Compiled, compile_model, run
from clutchest.models import machine_of
from clutchest.models.regimes import MODE_NAMES, Mode, runs
from clutchest.vehicle import Vehicle
from drawn import draw


def certain(vehicle: Vehicle) -> Vehicle:
    """The vehicle with parameters known exactly; those that are a state's prior keep it."""
    priors = {state.prior for state in machine_of(vehicle.model).states}
    known = {
        key: value if key in priors else replace(value, spread=0.0)
        for key, value in vehicle.parameters.items()
    }
    return replace(vehicle, parameters=known)


@dataclass(frozen=True)
class Plan:
    """A schedule of engagements, from which drives are drawn; ``rows`` of its outputs' grid."""

    clutch: Clutch
    compiled: Compiled
    line: Timeline
    prior: Belief
    time: NDArray[np.float64]
    mode: NDArray[np.uint8]
    engagements: NDArray[np.float64]  # s, their ends

    @classmethod
    def of(cls, name: str, seed: int, duration: float) -> Plan:
        """The plan of one simulated drive."""
        vehicle = certain(clutchest.load_vehicle(name))
        clutch = CLUTCHES[vehicle.model]
        signals = clutchest.simulate(vehicle, clutch.plan, seed, duration=duration, nominal=True)
        compiled = compile_model(vehicle, machine_of(vehicle.model).equations(set(signals)))
        line = build(signals, vehicle, compiled.model, 10.0, {})
        rows = np.flatnonzero(line.emit >= 0)[line.grid]
        time, mode = line.t[rows], line.mode[rows]
        starts, ends = runs(mode == Mode.slipping)
        lasting = time[ends - 1] - time[starts] > clutch.lasting
        return cls(
            clutch,
            compiled,
            line,
            fresh(vehicle, compiled, line),
            time,
            mode,
            time[ends - 1][lasting],
        )


def drives(task: tuple[str, int, int, float]) -> dict[str, Any]:
    """``count`` drives of one plan, reduced to what the tables need.

    Per mode: ``error`` and ``bound`` (drives, n), mean squares after the warm-up; ``inside``
    [rows in the band, rows] of the average NEES; per sensor ``nis`` (drives) and ``lag`` (drives)
    of normalised innovations.
    """
    name, seed, count, duration = task
    plan = Plan.of(name, seed, duration)
    model, grid = plan.compiled.model, plan.line.grid
    warm_up = plan.clutch.warm_up
    if len(plan.engagements) <= warm_up:
        raise SystemExit(
            f"{duration:g} s have {len(plan.engagements)} engagements, and {warm_up} "
            "are not scored: expected a longer --duration"
        )
    scored = plan.time > plan.engagements[warm_up - 1]
    found: dict[str, Any] = {"model": model.name, "modes": {}, "sensors": {}}
    squares, bounds, nees = [], [], []
    read = {s.name: plan.line.sensor == i for i, s in enumerate(model.sensors)}
    nis: dict[str, list[list[float]]] = {name: [] for name, of in read.items() if of.any()}
    for number in range(count):
        drawn = draw(
            plan.compiled, plan.line, plan.prior, 10_000 * seed + number, driver=plan.clutch.driver
        )
        filtered = run(plan.compiled, drawn.timeline, plan.prior)
        error = filtered.x[grid] - drawn.x[grid]
        squares.append(error**2)
        bounds.append(drawn.bound[grid])
        solved = np.linalg.solve(filtered.P[grid], error[..., None])[..., 0]
        nees.append(np.einsum("ki,ki->k", error, solved))
        for name in nis:
            normal = filtered.innovation[read[name], 0]
            normal = normal / np.sqrt(filtered.innovation[read[name], 1])
            nis[name].append([np.mean(normal**2), np.mean(normal[1:] * normal[:-1])])
    error, bound, n = np.array(squares), np.array(bounds), len(model.states)
    low, high = chi2.ppf([0.025, 0.975], n * count) / (n * count)
    average = np.mean(nees, axis=0) / n
    for mode, label in enumerate(MODE_NAMES):
        rows = scored & (plan.mode == mode)
        if rows.any():
            inside = (average[rows] > low) & (average[rows] < high)
            found["modes"][label] = {
                "error": error[:, rows].mean(axis=1),
                "bound": bound[:, rows].mean(axis=1),
                "anees": float(average[rows].mean()),
                "inside": [int(inside.sum()), inside.size],
            }
    found["sensors"] = {key: np.array(values) for key, values in nis.items()}
    found["states"] = [state.name for state in model.states]
    return found


def table(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Ratios RMSE / √(mean bound) per mode and state with their intervals, NEES and NIS."""
    names, clutch = results[0]["states"], CLUTCHES[results[0]["model"]]
    out: dict[str, Any] = {"ratio": {}, "anees": {}, "sensors": {}, "judged": {}}
    out["warm_up"] = clutch.warm_up
    out["drives"] = sum(len(next(iter(r["sensors"].values()))) for r in results)
    for mode in MODE_NAMES:
        parts = [r["modes"][mode] for r in results if mode in r["modes"]]
        if not parts:
            continue
        pairs = np.stack([np.concatenate([p[key] for p in parts]) for key in ("error", "bound")], 1)
        out["ratio"][mode] = {
            name: interval(pairs[:, :, i], lambda s: np.sqrt(s[..., 0] / s[..., 1]))
            for i, name in enumerate(names)
        }
        inside, rows = np.sum([p["inside"] for p in parts], axis=0)
        out["anees"][mode] = {
            "mean": float(np.mean([p["anees"] for p in parts])),
            "share_in_band": float(inside / rows),
        }
    for sensor in results[0]["sensors"]:
        values = np.concatenate([r["sensors"][sensor] for r in results])
        out["sensors"][sensor] = {
            key: interval(values[:, k : k + 1], lambda s: s[..., 0])
            for k, key in enumerate(("nis", "lag_1"))
        }
    for name, (modes, allowed) in clutch.judged.items():
        lowest = max(out["ratio"][mode][name]["low"] for mode in modes)
        out["judged"][name] = {"low": lowest, "allowed": allowed, "passed": lowest <= allowed}
    return out


def show(found: dict[str, Any]) -> str:
    """The table as text."""
    lines = [
        f"drawn from the filter's own model: {found['drives']} drives, scored after "
        f"engagement {found['warm_up']}",
        "RMSE / √(mean of the trajectories' Cramér–Rao bounds), 95 % interval",
    ]
    modes = list(found["ratio"])
    lines.append(line("", modes, 21))
    for name in next(iter(found["ratio"].values())):
        lines.append(line(name, (shown(found["ratio"][mode][name]) for mode in modes), 21))
    for key, words in (("mean", "average NEES / n"), ("share_in_band", "in its 95 % band")):
        lines.append(line(words, (f"{found['anees'][mode][key]:.3f}" for mode in modes), 21))
    for sensor, c in found["sensors"].items():
        lines.append(
            f"{sensor}: NIS {shown(c['nis'], '.4f')}, correlation from sample to sample "
            f"{shown(c['lag_1'], '+.4f')}"
        )
    for name, c in found["judged"].items():
        word = "met" if c["passed"] else "NOT MET"
        lines.append(f"{name}: lower end {c['low']:.3f}, at most {c['allowed']:.2f}: {word}")
    return "\n".join(lines)
