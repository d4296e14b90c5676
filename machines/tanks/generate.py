"""Records in the layout of the official file, of tanks whose upper one spills into the lower.

A program of its own: it shares no equations with tanks.py.  For tests, and to see what the log of a
rig of one's own should look like.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

PERIOD, STEPS = 4.0, 40  # s between samples, and steps of the integration in between
RIM, FULL, NOISE = 9.5, 10.0, 0.015  # V


def pump(rng: np.random.Generator, count: int) -> np.ndarray:
    """Voltages (count): sines of random phase below 14 mHz, with a mean of 3.4 V, at which the
    upper tank spills now and then."""
    time = PERIOD * np.arange(count)
    waves = [np.sin(2 * np.pi * f * time + rng.uniform(0, 7)) for f in rng.uniform(5e-4, 0.014, 30)]
    wave = np.sum(waves, axis=0)
    return np.clip(3.4 + wave / wave.std(), 0.4, 6.5)


def level(rng: np.random.Generator, voltage: np.ndarray) -> np.ndarray:
    """The lower tank's level (V) under the pump's voltages, as its sensor reads it."""
    upper, lower, read = 5.5, 5.2, []
    for u in voltage:
        read.append(min(lower, FULL))
        for _ in range(STEPS):
            dt = PERIOD / STEPS
            out = 0.052 * np.sqrt(max(upper, 0.0))
            upper += dt * (0.044 * u - out)
            over = max(upper - RIM, 0.0)  # what stands above the rim runs over at once
            upper -= over
            lower += dt * (out - 0.053 * np.sqrt(max(lower, 0.0))) + over
    return np.array(read) + NOISE * rng.standard_normal(len(read))


def generate(folder: Path, seed: int = 0, count: int = 1024) -> None:
    """Write ``folder``/cascaded_tanks.csv with both records."""
    rng, columns = np.random.default_rng(seed), {}
    for name in ("Est", "Val"):
        columns[f"u{name}"] = pump(rng, count)
        columns[f"y{name}"] = np.minimum(level(rng, columns[f"u{name}"]), FULL)
    pd.DataFrame(columns).to_csv(folder / "cascaded_tanks.csv", index=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    generate(options.folder, options.seed)
