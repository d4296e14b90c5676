"""Time per event of the two engines on one drive: filterpy's online filter, the compiled kernel.

    python benchmarks/engines.py [--duration 60] [--repeats 7] [--json FILE]

Processor time.  Both take the same timeline and give state and covariance at every event.  They run
in turn, so that whatever else the machine does meets both; a ratio is formed within each turn.
"Output as replay" has only the rows that ``replay`` takes: ten a second, and fifty while slipping.
"With signatures" the kernel also follows the response of every innovation to every uncertain
number.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import clutchest
from clutchest.estimate.ekf import OnlineFilter
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.timeline import build
from clutchest.estimate.whole_log import CONSIDERING, FilterOptions, compile_model, delays, run
from clutchest.models import machine_of

ONLINE, KERNEL, SPARSE = "online (filterpy)", "kernel", "kernel, output as replay"
SIGNATURES = "kernel with signatures"


def compare(drive: clutchest.Signals, vehicle: clutchest.Vehicle, repeats: int) -> dict[str, Any]:
    """µs per event of each engine and the ratio to the kernel, (repeats,) each.

    ``difference``: largest difference between the engines' states, in standard deviations.
    """
    compiled = compile_model(vehicle, machine_of(vehicle.model).equations(drive))
    sparse = build(drive, vehicle, compiled.model, 10.0, delays(vehicle))
    line = replace(sparse, emit=np.arange(len(sparse.t)))
    start = fresh(vehicle, compiled, line)

    def online() -> tuple[np.ndarray, np.ndarray, float]:
        return OnlineFilter(compiled, start, line).run()

    engines: dict[str, Callable[[], Any]] = {
        ONLINE: online,
        KERNEL: lambda: run(compiled, line, start, FilterOptions(signature=False)),
        SPARSE: lambda: run(compiled, sparse, start, FilterOptions(signature=False)),
        SIGNATURES: lambda: run(compiled, line, start, CONSIDERING),
    }
    engines[SIGNATURES]()  # compiled before the clock starts, as is what both engines call
    x, P, _ = online()
    spread = np.sqrt(np.einsum("kii->ki", P))
    difference = np.max(np.abs(engines[KERNEL]().x - x) / spread)

    per_event: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(repeats):
        for name, engine in engines.items():
            if name != ONLINE:
                engine()  # memory for what it gives is this process's own before the clock starts
            begin = process_time()
            engine()
            per_event[name].append((process_time() - begin) / len(line.t) * 1e6)
    ratio = np.array(per_event[ONLINE]) / np.array(per_event[KERNEL])
    return {
        "events": len(line.t),
        "states": len(start.x),
        "signatures": len(compiled.thetas),
        "us_per_event": per_event,
        "ratio": ratio.tolist(),
        "difference": float(difference),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicle", default="truck")
    parser.add_argument("--scenario", default="city")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--duration", type=float, default=60.0, help="s")
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    vehicle = clutchest.load_vehicle(arguments.vehicle)
    drive = clutchest.simulate(
        vehicle, arguments.scenario, arguments.seed, duration=arguments.duration
    )
    result = compare(drive, vehicle, arguments.repeats)
    busy = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(
        f"{arguments.duration:g} s of {arguments.scenario}: {result['events']} events, "
        f"{result['states']} states, {result['signatures']} signatures, "
        f"{arguments.repeats} turns; load average {busy:.2f}, this program's own included"
    )
    print(f"{'µs per event':26}{'min':>9}{'median':>9}{'max':>9}")
    for name, times in result["us_per_event"].items():
        print(f"{name:26}{min(times):9.2f}{np.median(times):9.2f}{max(times):9.2f}")
    ratio = result["ratio"]
    print(f"{'online / kernel':26}{min(ratio):9.0f}{np.median(ratio):9.0f}{max(ratio):9.0f}")
    print(f"largest difference of a state: {result['difference']:.1e} standard deviations")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
