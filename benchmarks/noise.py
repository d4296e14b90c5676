"""Do the intervals of ``identify noise`` hold what is true?

    python benchmarks/noise.py [--seeds 40] [--first 0] [--signals NAME …] [--jobs 2] [--json FILE]

Every seed is another truck on another drive, whose sensors have other noise (half to double),
colour (0, 0.5, 0.9) and delays (0, 20, 50 ms) than the vehicle file says.  Printed are, of every
number that was determined, the share of 95 % intervals that hold the truth with its own interval
(Clopper, Pearson), the mean and the root mean square of the error in standard deviations, and the
median half-width of the interval, for noise as a share of it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

import clutchest
from clutchest.identify import identify_vehicle
from clutchest.identify.sensor_noise import bus_step

SCENARIOS = ("launches", 700.0), ("city", 900.0)  # s; in turn
Number = dict[str, float | str]


def found(task: tuple[int, tuple[str, ...]]) -> list[Number]:
    """Of one seed's drive, what is determined of the signals asked for (all if none): ``true``,
    ``value``, ``std``, ``low`` and ``high``."""
    seed, names = task
    nominal = clutchest.load_vehicle("truck")
    rng = np.random.default_rng(seed)
    sensors = {
        name: replace(
            mapped,
            noise=mapped.noise * rng.choice([0.5, 1.0, 2.0]),
            noise_ar=rng.choice([0.0, 0.5, 0.9]),
            delay=0.0 if name == "engine_speed" else rng.choice([0.0, 0.02, 0.05]),
        )
        for name, mapped in nominal.signals.items()
    }
    scenario, duration = SCENARIOS[seed % 2]
    signals = clutchest.simulate(
        replace(nominal, signals=sensors), scenario, seed, nominal=False, duration=duration
    )
    asked = {name: nominal.signals[name] for name in names or nominal.signals}
    fit = identify_vehicle("noise", signals, replace(nominal, signals=asked))
    numbers: list[Number] = []
    for name in asked:
        rounding = bus_step([signals[name].value]) / np.sqrt(12)
        true = {
            "noise": np.hypot(sensors[name].noise, rounding),
            "delay": sensors[name].delay,
            "noise_ar": sensors[name].noise_ar,
        }
        for leaf, value in true.items():
            f = fit.parameters[f"signals.{name}.{leaf}"]
            if f.determined:
                numbers.append(
                    {
                        "key": f"{name}.{leaf}",
                        "true": float(value),
                        "value": f.value,
                        "std": f.std,
                        "low": f.low,
                        "high": f.high,
                    }
                )
    return numbers


def table(numbers: Iterable[Number]) -> dict[str, dict[str, float]]:
    """By key: ``count``, ``held`` in [``low``, ``high``], ``bias``, ``rms`` and ``half``."""
    numbers, out = list(numbers), {}
    for key in dict.fromkeys(n["key"] for n in numbers):
        true, value, std, low, high = np.array(
            [
                [n[of] for of in ("true", "value", "std", "low", "high")]
                for n in numbers
                if n["key"] == key
            ],
            float,
        ).T
        inside, error = (low <= true) & (true <= high), (value - true) / std
        share = binomtest(int(inside.sum()), len(inside)).proportion_ci(0.95)
        scale = true if key.endswith(".noise") else 1.0
        out[key] = {
            "count": len(true),
            "held": inside.mean(),
            "low": share.low,
            "high": share.high,
            "bias": error.mean(),
            "rms": np.sqrt(np.mean(error**2)),
            "half": np.median((high - low) / 2 / scale),
        }
    return out


def show(rows: dict[str, dict[str, float]]) -> str:
    """The table as text."""
    lines = [f"{'':28}{'drives':>6}  held                 bias, σ  rms, σ  half-width"]
    for key, r in rows.items():
        held = f"{r['held']:.3f} [{r['low']:.3f}, {r['high']:.3f}]"
        lines.append(
            f"{key:28}{r['count']:6.0f}  {held}  {r['bias']:+6.2f}  {r['rms']:6.2f}  "
            f"{r['half']:.3g}" + ("  SHORT" if r["high"] < 0.95 else "")
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="do the intervals of identify noise hold?")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--signals", nargs="+", default=[])
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(arguments)
    tasks = [(seed, tuple(given.signals)) for seed in range(given.first, given.first + given.seeds)]
    numbers: list[Number] = []
    with get_context("spawn").Pool(given.jobs) as pool:
        for done, part in enumerate(pool.imap(found, tasks), 1):
            numbers += part
            print(f"\r{done} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    rows = table(numbers)
    print(show(rows))
    if given.json:
        given.json.write_text(json.dumps({"numbers": numbers, "table": rows}, indent=1))


if __name__ == "__main__":
    main()
