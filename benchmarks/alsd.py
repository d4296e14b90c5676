"""The active differential: how fast its models run, and how often its intervals hold the truth.

python benchmarks/alsd.py [--seeds 8] [--first 0]
"""

from __future__ import annotations

import argparse
from time import process_time

import numpy as np

from clutchest.estimate import whole_log
from clutchest.estimate.ekf import OnlineFilter
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.replay import replay
from clutchest.estimate.timeline import build
from clutchest.models import machine_of
from clutchest.reproduce.id08.rig import Rig
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

SETTLED, PRESSED = 5.0, 100.0  # s, N
RUNS = (
    ("alsd_rig", "rig-steps", 20.0),
    ("alsd_rig", "rig-slow", 18.0),
    ("alsd_rig", "rig-ramps", 62.0),
    ("alsd_car", "car", 60.0),
)


def speed() -> None:
    """Full rig against the clock; kernel against filterpy on the same events."""
    rig = Rig(load_vehicle("alsd_rig"))
    rig.step(12.0, 25.0, 0.5, 1.4, 2.1)  # compiles
    begun = process_time()
    for _ in range(5):
        rig.step(12.0, 25.0, 0.5, 1.4, 2.1)
    print(f"full rig at 50 µs: {5 * 2.1 / (process_time() - begun):.0f} times real time")

    vehicle, signals = rig.vehicle, simulate("alsd_rig", "rig-steps", 0, duration=1.0)
    compiled = whole_log.compile_model(vehicle, machine_of("alsd").equations(set(signals)))
    line = build(signals, vehicle, compiled.model, 10.0, {})
    start = fresh(vehicle, compiled, line)
    whole_log.run(compiled, line, start, whole_log.FilterOptions(signature=False))  # compiles
    begun = process_time()
    for _ in range(20):
        whole_log.run(compiled, line, start, whole_log.FilterOptions(signature=False))
    ours = (process_time() - begun) / 20
    begun = process_time()
    OnlineFilter(compiled, start, line).run()
    theirs = process_time() - begun
    print(f"filterpy takes {theirs / ours:.0f} times as long as the kernel")


def coverage(name: str, scenario: str, duration: float, seeds: range) -> None:
    """Share of the pressed time in which the 95 % interval holds the truth with its standard error
    over the seeds, and RMS errors."""
    inside: dict[str, list[float]] = {}
    errors: dict[str, list[float]] = {}
    for seed in seeds:
        signals = simulate(name, scenario, seed, duration=duration)
        track, truth = replay(signals, name, rate=50.0).tracks[0], signals.truth
        assert truth is not None
        force = np.interp(track.time, truth.time, truth.columns["pack_force"])
        rows = (track.time > SETTLED) & (force > PRESSED)
        for state, estimate in {**track.states, "clutch_torque": track.clutch_torque}.items():
            if state in truth.columns:
                true = np.interp(track.time, truth.time, truth.columns[state])
                error = (estimate.value - true)[rows]
                inside.setdefault(state, []).append(
                    float(np.mean(np.abs(error) < 1.96 * estimate.std[rows]))
                )
                errors.setdefault(state, []).append(float(np.mean(error**2)))
    print(f"{scenario}, {len(seeds)} seeds from {seeds[0]}")
    for state, shares in inside.items():
        rmse = np.sqrt(np.mean(errors[state]))
        error = np.std(shares) / np.sqrt(len(shares))
        print(
            f"  {state:15s} {np.mean(shares):.3f} ± {error:.3f} (least {min(shares):.2f}), "
            f"rmse {rmse:.3g}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    given = parser.parse_args()
    speed()
    for run in RUNS:
        coverage(*run, range(given.first, given.first + given.seeds))


if __name__ == "__main__":
    main()
