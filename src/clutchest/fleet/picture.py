"""The picture of a fleet: properties of every vehicle beside what the others lead one to expect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from clutchest.fleet.comparison import FleetComparison
from clutchest.pictures import Picture
from clutchest.quantity import Quantity
from clutchest.signals import Floats

BAND = 2.0  # standard deviations


def draw_fleet(
    names: Sequence[str],
    numbers: Mapping[Quantity, tuple[Floats, Floats]],
    compared: Mapping[Quantity, tuple[FleetComparison, NDArray[np.bool_]]],
) -> Picture:
    """A panel a property: of vehicles ``names`` (v,) value and standard deviation (v,) each."""
    width = min(3.6 * len(numbers), 11.0)
    figure = Picture(figsize=(width, 1.2 + 0.28 * len(names)))
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained", w_pad=0.15)  # inches, between the numbers of two axes
    panels = figure.subplots(1, len(numbers), sharey=True, squeeze=False)[0]
    rows = np.arange(len(names))
    for axes, (quantity, (value, std)) in zip(panels, numbers.items(), strict=True):
        comparison, differ = compared[quantity]
        shown, spread = quantity.read(value), BAND * quantity.read_spread(std)
        middle = quantity.read(comparison.expected)
        reach = BAND * quantity.read_spread(comparison.spread)
        axes.barh(rows, 2 * reach, left=middle - reach, height=0.8, color="0.9")
        for mask, colour in ((~differ, "C0"), (differ, "C3")):
            axes.errorbar(
                shown[mask], rows[mask], xerr=spread[mask], fmt="o", ms=4, lw=1.2, color=colour
            )
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.set_xlabel(f"{quantity.label}, ± 2σ")
    panels[0].set_yticks(rows, names)
    panels[0].invert_yaxis()
    return figure
