"""What the figures of every paper are drawn on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def sheet(rows: int = 1, height: float = 3.6) -> tuple[Figure, list[Axes]]:
    """A figure, ``height`` inches high, and its axes from top to bottom."""
    figure = Figure(figsize=(7.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, squeeze=False)[:, 0])


def save(figures: Mapping[str, Figure], folder: Path) -> None:
    """Every figure as ``NAME.png``."""
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=110)
