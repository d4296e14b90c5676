"""The tables as pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def recovery(results: Sequence[dict[str, Any]], wrong: Mapping[str, float], path: Path) -> None:
    """Errors of the first drives over time, from the wrong start on."""
    figure, axes = plt.subplots(1, len(wrong), figsize=(4.2 * len(wrong), 3.2), layout="tight")
    for axis, (state, size) in zip(axes, wrong.items(), strict=True):
        for result in results[:4]:
            for course in result[state]["course"]:
                axis.semilogy(result["time"], course / size, lw=0.6, color="C0", alpha=0.6)
        axis.axhline(0.05, color="C3", lw=1)
        axis.set(
            title=state.replace("_", " "),
            xlabel="time [s]",
            ylim=(1e-3, 3),
            ylabel="error / error of the start",
        )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def accuracy(found: Mapping[str, Any], path: Path) -> None:
    """RMSE over bound, and coverage on the generator's drives, each with its interval."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="tight")
    for k, (mode, states) in enumerate(found.get("own_model", {}).get("ratio", {}).items()):
        _bars(left, list(states), list(states.values()), 0.15 * (k - 1.5), f"C{k}", mode)
    left.axvline(1.0, color="k", lw=0.8)
    left.set(xlabel="RMSE / √ mean Cramér–Rao bound", title="drawn from the filter's own model")
    for k, (case, part) in enumerate(found.get("generator", {}).items()):
        shares = [state["coverage"] for state in part["states"].values()]
        _bars(right, list(part["states"]), shares, 0.15 * (k - 1.5), f"C{k}", case)
    right.axvline(0.95, color="k", lw=0.8)
    right.set(xlabel="share of the time within the 95 % interval", title="the generator's drives")
    for axis in (left, right):
        axis.invert_yaxis()
        if axis.has_data() and axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=7, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.15))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _bars(
    axis: Any,
    names: list[str],
    values: list[dict[str, float]],
    shift: float,
    color: str,
    of: str,
) -> None:
    at = [k + shift for k in range(len(names))]
    middle = [v["value"] for v in values]
    reach = [[v["value"] - v["low"] for v in values], [v["high"] - v["value"] for v in values]]
    axis.errorbar(middle, at, xerr=reach, fmt="o", ms=3, lw=1, color=color, label=of)
    axis.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
