"""Torque error while slipping: static curves, three-state model open loop, no model, the filter.

    python benchmarks/torque.py [--seeds 20] [--scenarios city launches heating] [--jobs 2]
                                [--json FILE] [--undisturbed] [--wear-rate 0]

Drives come from the independent generator with parameters drawn from the vehicle file's spreads;
every model uses the file's own values.  During the drives the clutch wears, and its friction and
the bias of the reported torque wander.  "no model" is the trivial rival, M_e − J dω/dt: reported
engine torque, its mean over 0.1 s, less the inertia times the slope of a straight line through the
engine speed of the same 0.1 s.  "static, refitted" is what a static model can do at best:
its curve is fitted by least squares to the torque that production sensors give on another drive
of the same truck, same scenario, another road.  Errors are root mean squares over the samples
(10 Hz) in which the true clutch slips, as a share of the maximum engine torque; the intervals are
95 % bootstraps over drives.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import clutchest
from clutchest.estimate.open_loop import open_loop
from clutchest.estimate.samples import slope, slope_count
from clutchest.models.dry_clutch.equations import (
    DRY_CLUTCH,
    following_speed,
    static,
    with_measured_power,
)

Floats = NDArray[np.float64]

NAMES = ("static", "static, refitted", "P modelled", "P measured", "no model", "filter")
CURVE = ("torque_cubic", "torque_quadratic", "kiss_point")
WEAR_RATE = 0.02  # mm/MJ
DISTURBANCES = {
    "friction_std": 0.05,  # from drive to drive: humidity, bedding-in
    "friction_walk": 5e-4,  # 1/√s: 2 % in half an hour
    "torque_bias_std": 20.0,  # Nm
    "torque_bias_walk": 0.5,  # Nm/√s: 21 Nm in half an hour
}
OTHER_ROAD = 100_000  # from a drive's seed to that of the drive which the curve is fitted to
RATE = 10.0  # Hz


@dataclass(frozen=True)
class Drives:
    """What is simulated: vehicle's name, and what goes on besides the scenario."""

    vehicle: str
    effects: Mapping[str, Mapping[str, float]]
    disturbances: Mapping[str, float]

    def simulate(self, scenario: str, seed: int, truck_seed: int) -> clutchest.Signals:
        return clutchest.simulate(
            self.vehicle,
            scenario,
            seed,
            self.effects,
            truck_seed=truck_seed,
            disturbances=self.disturbances,
        )


def slipping(drive: clutchest.Signals, time: Floats) -> NDArray[np.bool_]:
    """Where the true clutch slips; shape as ``time``."""
    row = np.clip(np.searchsorted(drive.truth.time, time), 0, len(drive.truth.time) - 1)
    return drive.truth.columns["mode"][row] == "slipping"


def curve(parameters: Sequence[float], x: Floats) -> Floats:
    """M_ref(x), equation (5) of ME12."""
    cubic, quadratic, kiss_point = parameters
    depth = np.minimum(x - kiss_point, 0.0)
    return cubic * depth**3 + quadratic * depth**2


def refitted(drive: clutchest.Signals, vehicle: clutchest.Vehicle) -> clutchest.Vehicle:
    """The vehicle with the torque curve that fits ``drive`` best, as production sensors see it."""
    from scipy.optimize import least_squares

    nominal = {key: parameter.value for key, parameter in vehicle.parameters.items()}
    speed = drive["engine_speed"].only_valid()
    acceleration, _ = slope(speed, vehicle.signals["engine_speed"].noise)
    time = np.arange(0.0, drive.end, 1.0 / RATE)
    time = time[slipping(drive, time)]

    def at(signal: clutchest.Signal) -> Floats:
        return np.interp(time, signal.time, signal.value)

    torque = at(drive["engine_torque"]) - nominal["engine_inertia"] * at(acceleration)
    torque *= np.sign(at(speed) - at(drive["input_shaft_speed"]))
    x = at(drive["slave_position"]) - nominal["position_origin"]
    fitted = least_squares(
        lambda parameters: curve(parameters, x) - torque,
        [nominal[key] for key in CURVE],
        bounds=([-np.inf, 0.0, -np.inf], [0.0, np.inf, np.inf]),  # more closed, more torque
        x_scale="jac",
    )
    values = dict(zip(CURVE, map(float, fitted.x), strict=True))
    changed = {key: replace(vehicle.parameters[key], value=value) for key, value in values.items()}
    return replace(vehicle, parameters={**vehicle.parameters, **changed})


def without_model(drive: clutchest.Signals, vehicle: clutchest.Vehicle, time: Floats) -> Floats:
    """M_e − J dω/dt at ``time``, Nm: both over the samples of SLOPE_WINDOW s around it."""
    torque = drive["engine_torque"].only_valid()
    count = slope_count(float(np.median(np.diff(torque.time))))
    mean = np.convolve(torque.value, np.full(count, 1.0 / count), mode="valid")
    mean = np.interp(time, torque.time[count // 2 : count // 2 + len(mean)], mean)
    acceleration, _ = slope(drive["engine_speed"].only_valid(), 0.0)
    inertia = vehicle.parameters["engine_inertia"].value
    return mean - inertia * np.interp(time, acceleration.time, acceleration.value)


def errors_of(
    drive: clutchest.Signals, other: clutchest.Signals, vehicle: clutchest.Vehicle
) -> dict[str, float]:
    """RMS torque error in Nm while slipping, by model, for one drive; ``other`` is another drive
    of the same truck."""
    truth, following = drive.truth, following_speed(DRY_CLUTCH)
    track = clutchest.replay(drive, vehicle, rate=RATE).tracks[0]
    torques = {
        "filter": (track.time, track.clutch_torque.value),
        "no model": (track.time, without_model(drive, vehicle, track.time)),
    }
    for name, model, car in (
        ("static", static(following), vehicle),
        ("static, refitted", static(following), refitted(other, vehicle)),
        ("P modelled", following, vehicle),
        ("P measured", with_measured_power(following), vehicle),
    ):
        run = open_loop(drive, car, model, RATE)
        torques[name] = run.time, run.torque
    result = {}
    for name, (time, torque) in torques.items():
        wrong = torque - np.interp(time, truth.time, truth.columns["clutch_torque"])
        result[name] = float(np.sqrt(np.mean(wrong[slipping(drive, time)] ** 2)))
    return result


def one(task: tuple[Drives, str, int]) -> tuple[str, int, dict[str, float]]:
    """(scenario, seed, errors in % of the maximum engine torque) of one pair of drives."""
    drives, scenario, seed = task
    vehicle = clutchest.load_vehicle(drives.vehicle)
    errors = errors_of(
        drives.simulate(scenario, seed, seed),
        drives.simulate(scenario, seed + OTHER_ROAD, seed),
        vehicle,
    )
    largest = vehicle.parameters["engine_torque_max"].value
    return scenario, seed, {name: 100 * errors[name] / largest for name in NAMES}


def summary(errors: Mapping[str, Floats]) -> dict[str, tuple[float, float, float]]:
    """(mean, 2.5 %, 97.5 %) by model, and of the ratios of the filter's mean error to those of the
    refitted static curve and of M_e − J dω/dt; ``errors`` (drives,) by model."""
    count = len(errors["filter"])
    picks = np.random.default_rng(0).integers(0, count, (4000, count))
    means = {name: values[picks].mean(axis=1) for name, values in errors.items()}
    means["ratio"] = means["filter"] / means["static, refitted"]
    means["ratio to no model"] = means["filter"] / means["no model"]
    mean = {name: float(values.mean()) for name, values in errors.items()}
    mean["ratio"] = mean["filter"] / mean["static, refitted"]
    mean["ratio to no model"] = mean["filter"] / mean["no model"]
    limits = {name: np.percentile(values, [2.5, 97.5]) for name, values in means.items()}
    return {name: (mean[name], float(low), float(high)) for name, (low, high) in limits.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1000, help="first seed")
    parser.add_argument("--scenarios", nargs="+", default=["city", "launches", "heating"])
    parser.add_argument("--vehicle", default="truck")
    parser.add_argument("--wear-rate", type=float, default=WEAR_RATE, help="mm/MJ")
    parser.add_argument("--undisturbed", action="store_true", help="friction and bias stand still")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="drives at a time")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    drives = Drives(
        arguments.vehicle,
        {"wear": {"rate": arguments.wear_rate}},
        {} if arguments.undisturbed else DISTURBANCES,
    )
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    tasks = [(drives, *pair) for pair in product(arguments.scenarios, seeds)]
    errors_by_drive: dict[str, dict[int, dict[str, float]]] = {
        name: {} for name in arguments.scenarios
    }
    with get_context("spawn").Pool(arguments.jobs) as pool:
        for done, (scenario, seed, errors) in enumerate(pool.imap_unordered(one, tasks), 1):
            errors_by_drive[scenario][seed] = errors
            print(f"{done}/{len(tasks)}: {scenario}, seed {seed}", file=sys.stderr)

    largest = clutchest.load_vehicle(arguments.vehicle).parameters["engine_torque_max"].value
    print(f"torque RMS error while slipping, % of {largest:.0f} Nm, {arguments.seeds} drives each")
    wandering = [f"{key} {value:g}" for key, value in drives.disturbances.items()]
    print(f"wear {arguments.wear_rate:g} mm/MJ; " + (", ".join(wandering) or "undisturbed"))
    columns = (*NAMES, "ratio", "ratio to no model")
    titles = (*NAMES, "filter / refitted", "filter / no model")
    print(f"{'':12}" + "".join(f"{title:>22}" for title in titles))
    table = {}
    for scenario, runs in errors_by_drive.items():
        by_model = {name: [runs[seed][name] for seed in seeds] for name in NAMES}
        row = summary({name: np.array(values) for name, values in by_model.items()})
        cells = ["{:.2f} [{:.2f}, {:.2f}]".format(*row[name]) for name in columns]
        print(f"{scenario:12}" + "".join(cell.rjust(22) for cell in cells))
        table[scenario] = {"mean_low_high": row, "errors": by_model}
    if arguments.json:
        about = {
            "seeds": list(seeds),
            "vehicle": arguments.vehicle,
            "effects": drives.effects,
            "disturbances": drives.disturbances,
        }
        arguments.json.write_text(json.dumps({**about, "scenarios": table}, indent=1))


if __name__ == "__main__":
    main()
