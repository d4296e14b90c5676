"""Torque requests met by the generator's differential: feedforward by the inverse model against a
constant gain.

python benchmarks/feedforward.py [--seeds 20] [--first 20000]

Every seed is another specimen, drawn from the vehicle file's spreads.  It drives a log first, from
which the estimator learns its free play and friction.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from clutchest.estimate.feedforward import feedforward
from clutchest.estimate.replay import replay
from clutchest.generator.alsd import plant
from clutchest.generator.alsd.effects import EFFECTS, numbers
from clutchest.generator.alsd.generate import draw, run
from clutchest.generator.effects import complete
from clutchest.signals import Floats
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

PERIOD = 1e-3  # s between rows
ON, OFF, END = 0.2, 1.4, 2.0  # s
SLIP, OIL = 25 * np.pi / 30, 40.0  # rad/s, °C
SETTLED = {12.0: 2314.0, 7.0: 1217.0, 2.5: 323.0}  # A → Nm of the nominal rig, held
GAIN = sum(a * t for a, t in SETTLED.items()) / sum(t * t for t in SETTLED.values())  # A/Nm
LEARNT = 20.0  # s of a log
THERE = 0.3  # s, within which a step is to be met
WAYS = ("constant gain", "inverse", "inverse, estimated", "the same, angle fed back")


@dataclass(frozen=True)
class Case:
    """A request (k,) Nm at ``time`` (k,) s, judged ``within`` s."""

    name: str
    time: Floats
    request: Floats
    within: tuple[float, float]


def cases() -> list[Case]:
    """Steps to what 12, 7 and 2.5 A hold, and a sine of 1 Hz."""
    time = np.arange(round(END / PERIOD) + 1) * PERIOD
    steps = [
        Case(
            f"step to {torque:.0f} Nm",
            time,
            np.interp(time, (ON, ON + 0.015, OFF, OFF + 0.015), (0.0, torque, torque, 0.0)),
            (ON, OFF),
        )
        for torque in SETTLED.values()
    ]
    long = np.arange(round(4.5 / PERIOD) + 1) * PERIOD
    sine = 900.0 - 600.0 * np.cos(2 * np.pi * (long - 0.5))
    sine = np.where(long < 0.5, np.interp(long, (0.2, 0.215), (0.0, 300.0)), sine)
    return [*steps, Case("sine of 1 Hz, 300 to 1500 Nm", long, sine, (1.0, 4.5))]


def played(record: np.ndarray, current: Floats, angle: Floats | None, oil: float) -> Floats:
    """Torque (k,) of a specimen whose controller is given a current, and an angle to hold."""
    profile = np.zeros(len(current), plant.PROFILE)
    profile["asked"], profile["driven"], profile["oil"] = current, SLIP, oil
    if angle is not None:
        profile["actuator"], profile["angle"] = plant.GUIDED, angle
        profile["turning"] = np.gradient(angle, PERIOD)
    return run(profile, record)["clutch_torque"]


def specimen(seed: int | None) -> np.ndarray:
    """The generator's numbers: the vehicle file's own, or drawn around them."""
    vehicle = load_vehicle("alsd_rig")
    values = {key: p.value for key, p in vehicle.parameters.items()}
    spreads = {key: p.spread for key, p in vehicle.parameters.items()} if seed is not None else {}
    drawn = draw(values, spreads, seed or 0)
    return numbers(drawn, complete({}, EFFECTS, {}), values["friction_coefficient"], {})


def measure(seed: int | None) -> dict[tuple[str, str], tuple[float, float, float]]:
    """(case, way) → its :func:`figures`."""
    vehicle, record = load_vehicle("alsd_rig"), specimen(seed)
    log = simulate(vehicle, "rig-steps", seed or 0, duration=LEARNT, nominal=seed is None)
    state = replay(log, vehicle).final
    found = {}
    for case in cases():
        request = (case.time, case.request)
        plain, known = feedforward(vehicle, request), feedforward(vehicle, request, state=state)
        ways = (
            (GAIN * case.request, None),
            (plain.columns["current_request"], None),
            (known.columns["current_request"], None),
            (known.columns["current_request"], known.columns["motor_angle"]),
        )
        for way, (current, angle) in zip(WAYS, ways, strict=True):
            torque = played(record, current, angle, OIL)
            found[case.name, way] = figures(case, torque)
    return found


def figures(case: Case, torque: Floats) -> tuple[float, float, float]:
    """Root mean square error from the request on, the same once there was time to get there, and
    overshoot."""
    begin, end = case.within
    error = torque - case.request
    whole = error[(case.time >= begin) & (case.time < end)]
    later = error[(case.time >= begin + THERE) & (case.time < end)]
    return float(np.sqrt(np.mean(whole**2))), float(np.sqrt(np.mean(later**2))), float(whole.max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=20000, help="first seed")
    given = parser.parse_args()
    nominal = measure(None)
    found = [measure(seed) for seed in range(given.first, given.first + given.seeds)]
    print(
        f"constant gain: {1 / GAIN:.0f} Nm/A.  Nm: root mean square error, from {THERE:g} s after"
    )
    print("the request, largest excess; of the nominal rig, then median (largest) of specimens")
    for name, way in nominal:
        each = np.array([of[name, way] for of in found]).reshape(-1, 3)
        words = [
            f"{value:.0f}" + (f", {np.median(column):.0f} ({column.max():.0f})" if found else "")
            for value, column in zip(nominal[name, way], each.T, strict=True)
        ]
        print(f"{name:28s} | {way:24s} | " + " | ".join(words), flush=True)


if __name__ == "__main__":
    main()
