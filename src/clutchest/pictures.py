"""Pictures of results, drawn without a window and without state of their own.

Loads matplotlib: imported where something is drawn.
"""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

DOTS_PER_INCH = 110
POINTS = 20000  # of a line that are drawn: more lie within the same dots


class Picture(Figure):
    """A figure that a notebook shows, whatever its backend is."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png", dpi=DOTS_PER_INCH)
        return file.getvalue()


def stacked(panels: int, height: float = 1.5) -> tuple[Picture, list[Axes]]:
    """A picture of so many panels over one time axis, each so many inches high."""
    figure = Picture(figsize=(9.0, height * panels + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(panels, sharex=True, squeeze=False)[:, 0])
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def thinned(time: NDArray[np.float64], *values: NDArray) -> list[NDArray]:
    """Times (n,) and values (n,), every so many of them where there are very many."""
    every = slice(None, None, max(len(time) // POINTS, 1))
    return [each[every] for each in (time, *values)]
