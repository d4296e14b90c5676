"""Pictures of the benchmark: detection delays beside an oracle and a fixed threshold."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def delays(results: dict[str, Any], path: Path) -> None:
    """Mean delay over size of every fault."""
    import matplotlib.pyplot as plt

    shown = {name: of for name, of in results.items() if of.get("delays")}
    figure, axes = plt.subplots(1, len(shown), figsize=(3.2 * len(shown), 3.2), squeeze=False)
    for axis, (name, of) in zip(axes[0], shown.items(), strict=True):
        sizes = [row["size"] for row in of["delays"]]
        for test, label, style in (
            ("plain", "fixed threshold, 3 consecutive", "s:"),
            ("glr", "GLR, size unknown", "o-"),
            ("cusum", "CUSUM, size known", "^-"),
            ("oracle", "oracle", "k--"),
        ):
            axis.loglog(sizes, [60 * row[f"{test}_h"] for row in of["delays"]], style, label=label)
        axis.set_title(name, fontsize=9)
        axis.set_xlabel(f"size [{of['unit']}]" if of["unit"] != "1" else "size")
    axes[0][0].set_ylabel("mean delay [min]")
    axes[0][0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
