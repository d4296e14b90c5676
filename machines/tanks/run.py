"""Discovers what the textbook's model of the cascaded tanks gets wrong, and what that is worth.

python machines/tanks/run.py DATA --out DIR: DATA holds the official file; DIR gets result.json,
extended.toml, the report of the first discovery and a picture.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from convert import convert, with_ends  # noqa: E402
from two_records import Found, less, rms, run  # noqa: E402

from clutchest.identify.fitted_machine import FittedMachine, Prediction  # noqa: E402
from clutchest.signals import Signals  # noqa: E402

BLOCK = 32  # samples of a block of the bootstrap


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


def predicted(fitted: FittedMachine, signals: Signals) -> Prediction:
    """The level at every reading; without an error where the sensor ends and the model has it far
    beyond, whatever its numbers."""
    whole = with_ends(signals)
    [own], level = fitted.predicted(whole, "level"), whole["level"]
    error = np.zeros(len(level.time))
    error[np.isin(level.time, own.time)] = own.error
    return Prediction(level.time, level.value, error)


def judge(found: Found, out: Path) -> Mapping[str, Any]:
    """The simulated level on both records, all of their readings."""
    own, other = (
        [predicted(fitted, signals) for fitted in (found.before, found.after)]
        for signals in found.signals
    )
    first = predicted(found.first, found.signals[1])
    draw(*other, out / "level.png")
    return {
        "rmse_before": rms(other[0].error),
        "rmse_after": rms(other[1].error),
        "rmse_of": "simulated level on the validation record, V; starts as the other",
        "less_ci95": less(other[0].error, other[1].error, BLOCK),
        "rmse_first": rms(first.error),
        "less_first_ci95": less(other[0].error, first.error, BLOCK),
        "rmse_estimation": [rms(each.error) for each in own],
    }


if __name__ == "__main__":
    shown = ("verdict", "where", "rmse_before", "rmse_after", "less_ci95", "seconds")
    run(__doc__, HERE / "tanks.toml", convert, judge, shown)
