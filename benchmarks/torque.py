"""Torque error while slipping: static curve, three-state model open loop, and the filter.

    python benchmarks/torque.py [--seeds 20] [--scenarios city launches] [--json FILE]

Drives come from the independent generator with parameters drawn from the vehicle file's spreads;
every model uses the file's own values.  Errors are root mean squares over the samples (10 Hz) in
which the true clutch slips, as a share of the maximum engine torque; the interval is a 95 %
bootstrap over drives of the mean.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import clutchest
from clutchest.estimate.open_loop import open_loop
from clutchest.models.dry_clutch import (
    DRY_CLUTCH,
    following_speed,
    static,
    with_measured_power,
)


def errors_of(drive: clutchest.Signals, vehicle: clutchest.Vehicle) -> dict[str, float]:
    """RMS torque error in Nm while slipping, by model, for one drive."""
    truth, following = drive.truth, following_speed(DRY_CLUTCH)
    track = clutchest.replay(drive, vehicle).tracks[0]
    found = {"filter": (track.time, track.clutch_torque.value)}
    for name, model in (("static", static(following)), ("P modelled", following),
                        ("P measured", with_measured_power(following))):  # fmt: skip
        found[name] = open_loop(drive, vehicle, model)[:2]
    result = {}
    for name, (time, torque) in found.items():
        row = np.clip(np.searchsorted(truth.time, time), 0, len(truth.time) - 1)
        slipping = truth.columns["mode"][row] == "slipping"
        wrong = torque - np.interp(time, truth.time, truth.columns["clutch_torque"])
        result[name] = float(np.sqrt(np.mean(wrong[slipping] ** 2)))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1000, help="first seed")
    parser.add_argument("--scenarios", nargs="+", default=["city", "launches"])
    parser.add_argument("--vehicle", default="truck")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    vehicle = clutchest.load_vehicle(arguments.vehicle)
    largest = vehicle.parameters["engine_torque_max"].value
    names = ("static", "P modelled", "P measured", "filter")
    table: dict[str, dict[str, list[float]]] = {}
    for scenario in arguments.scenarios:
        seeds = range(arguments.first, arguments.first + arguments.seeds)
        runs = [errors_of(clutchest.simulate(vehicle, scenario, seed), vehicle) for seed in seeds]
        table[scenario] = {name: [100 * r[name] / largest for r in runs] for name in names}
    draw = np.random.default_rng(0)
    print(f"torque RMS error while slipping, % of {largest:.0f} Nm, {arguments.seeds} drives each")
    print(f"{'':12}" + "".join(f"{name:>24}" for name in names))
    for scenario, rows in table.items():
        line = f"{scenario:12}"
        for name in names:
            values = np.array(rows[name])
            means = draw.choice(values, (2000, len(values))).mean(axis=1)
            low, high = np.percentile(means, [2.5, 97.5])
            line += f"{values.mean():8.2f} [{low:.2f}, {high:.2f}]".rjust(24)
        print(line)
    if arguments.json:
        arguments.json.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
