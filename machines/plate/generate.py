"""Records of a plate that radiates, which plate.py has only as an effect.

python machines/plate/generate.py DATA writes DATA/own.csv and DATA/other.csv.  A program of its
own: it shares no equations with plate.py.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

STEPS = 10  # of the integration, within a second
STAYS = 240  # s, for which the heater's power does
RADIATION = 12.0  # W, the radiated power at 300 K
NOISE = {"power": 0.3, "ambient": 0.2, "middle": 0.1, "edge": 0.1}  # W, °C


def record(seed: int, seconds: int = 7200) -> pd.DataFrame:
    """A row a second: heater and air as they are from there on, temperatures as they are there."""
    rng, rows = np.random.default_rng(seed), []
    power = np.repeat(rng.uniform(0.0, 200.0, seconds // STAYS + 1), STAYS)
    middle = edge = 22.0
    for k in range(seconds):
        air = 22.0 + 0.3 * np.sin(k / 900.0)
        rows.append((k, power[k], air, middle, edge))
        for _ in range(STEPS):
            across = 2.6 * (middle - edge)
            hot, cold = (middle + 273.15) / 300.0, (air + 273.15) / 300.0
            lost = 0.4 * (middle - air) + RADIATION * (hot**4 - cold**4)
            middle += (power[k] - across - lost) / 330.0 / STEPS
            edge += (across - 0.9 * (edge - air)) / 370.0 / STEPS
    table = pd.DataFrame(rows, columns=["time [s]", *NOISE], dtype=float)
    for name, noise in NOISE.items():
        table[name] += noise * rng.standard_normal(seconds)
    return table


def held(table: pd.DataFrame, period: float = 1.0) -> pd.DataFrame:
    """With a row at the end of each step of so many s, as the inputs stand until there."""
    ends = table[["time [s]", "power", "ambient"]].copy()
    ends["time [s]"] += 0.99 * period
    return pd.concat([table, ends]).sort_values("time [s]", ignore_index=True)


def generate(folder: Path, seed: int = 1) -> None:
    """Write both records."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, of in (("own", seed), ("other", seed + 1)):
        held(record(of)).to_csv(folder / f"{name}.csv", index=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    generate(options.folder, options.seed)
