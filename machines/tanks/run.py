"""Discovers what the textbook's model of the cascaded tanks gets wrong, and what that is worth.

python machines/tanks/run.py DATA --out DIR: DATA holds the official file; DIR gets result.json,
extended.toml, the report of the first discovery and a picture.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from convert import convert  # noqa: E402

from clutchest.discovery.chain import chain, extended_by, summary  # noqa: E402
from clutchest.identify.fitted_machine import FittedMachine, Prediction  # noqa: E402
from clutchest.reading import read_log  # noqa: E402
from clutchest.record.discovery import write_discovery  # noqa: E402
from clutchest.vehicle import dump_vehicle, load_vehicle  # noqa: E402

BLOCK, RESAMPLED = 32, 1000  # samples of a block of the bootstrap, and draws


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def less(before: np.ndarray, after: np.ndarray) -> list[float]:
    """95 % interval of rms before − rms after, by a block bootstrap."""
    count = len(before) // BLOCK
    squares = np.array([e[: count * BLOCK].reshape(count, BLOCK) ** 2 for e in (before, after)])
    sums = squares.mean(axis=2)
    drawn = np.random.default_rng(0).integers(count, size=(RESAMPLED, count))
    means = np.sqrt(sums[:, drawn].mean(axis=2))
    return np.quantile(means[0] - means[1], [0.025, 0.975]).tolist()


def draw(before: Prediction, after: Prediction, path: Path) -> None:
    """The level of the record held out: measured, and simulated by both models."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(10, 4), constrained_layout=True)
    axis.plot(before.time, before.measured, "k", lw=1, label="measured")
    for each, label in ((before, "textbook"), (after, "extended")):
        axis.plot(each.time, each.measured - each.error, lw=1, label=label)
    axis.set(xlabel="time [s]", ylabel="level of the lower tank [V]")
    axis.legend()
    axis.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run, and write what came out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the official file")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    wall, cpu = perf_counter(), process_time()
    vehicle = load_vehicle(HERE / "tanks.toml", trust=True)
    with TemporaryDirectory() as folder:
        paths = convert(options.data, Path(folder))
        signals, held_out = (read_log([path], vehicle) for path in paths)
    found = chain(signals, vehicle, held_out.drives)
    extended = extended_by(found, vehicle)
    fitted = [FittedMachine.of(signals, each) for each in (vehicle, extended)]
    own, other = ([f.predicted(s, "level")[0] for f in fitted] for s in (signals, held_out))
    result = {
        **summary(found),
        "rmse_before": rms(other[0].error),
        "rmse_after": rms(other[1].error),
        "rmse_of": "simulated level on the validation record, V; starts as the other",
        "less_ci95": less(other[0].error, other[1].error),
        "rmse_estimation": [rms(each.error) for each in own],
        "fitted": {"before": dict(fitted[0].numbers), "after": dict(fitted[1].numbers)},
        "seconds": perf_counter() - wall,
        "processor_seconds": process_time() - cpu,
    }
    (options.out / "result.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
    dump_vehicle(extended, options.out / "extended.toml")
    write_discovery(found[0], options.out / "first")
    draw(*other, options.out / "level.png")
    words = ("verdict", "where", "rmse_before", "rmse_after", "less_ci95", "seconds")
    print(json.dumps({k: result[k] for k in words}, indent=1))


if __name__ == "__main__":
    main()
