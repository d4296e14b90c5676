"""The picture of a drive's estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from clutchest.pictures import Picture, stacked, thinned
from clutchest.quantity import Quantity
from clutchest.signals import Floats

BAND = 2.0  # standard deviations


class Band(NamedTuple):
    """A quantity over time: ``value``, ``std`` and ``valid``, shape (m,) each."""

    value: Floats
    std: Floats
    valid: NDArray[np.bool_]


def draw_estimates(
    time: Floats, mode: NDArray, modes: Sequence[str], bands: Mapping[Quantity, Band]
) -> Picture:
    """The mode, ``mode`` (m,) of these ``modes``, and estimates at ``time`` (m,)."""
    figure, (first, *panels) = stacked(len(bands) + 1)
    first.step(*thinned(time, mode), where="post", lw=1.0, color="C7")
    seen = np.unique(mode)
    first.set_yticks(seen, [modes[k] for k in seen])
    first.set_title("mode", loc="left", fontsize=9)
    for (quantity, band), axes in zip(bands.items(), panels, strict=True):
        _draw(axes, quantity, time, band)
    return figure


def _draw(axes: Axes, quantity: Quantity, time: Floats, band: Band) -> None:
    time, value, std, valid = thinned(time, *band)
    shown, spread = quantity.read(value), BAND * quantity.read_spread(std)
    known = np.where(valid, shown, np.nan)
    axes.plot(time, shown, lw=0.8, color="0.75")
    axes.plot(time, known, lw=1.2, color="C0")
    axes.fill_between(time, known - spread, known + spread, color="C0", alpha=0.25, lw=0.0)
    axes.set_title(quantity.label, loc="left", fontsize=9)
