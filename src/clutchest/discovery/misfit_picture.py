"""The picture of a discovery: residuals of the model, and what they correlate with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray

from clutchest.discovery.residuals import Bins, Misfit
from clutchest.models.declarations import Comparison
from clutchest.models.effects.effect import TIME
from clutchest.models.machine import Machine
from clutchest.models.quantities import quantity_of
from clutchest.pictures import Picture
from clutchest.quantity import Quantity
from clutchest.signals import Floats

VISIBLE = 9.0  # χ² of binned residuals that an extended model removes: a line in the picture
GAP = 10.0  # usual steps between samples; a longer one parts two slips


def pieces(time: Floats) -> Iterator[slice]:
    """Stretches of ``time`` (n,) without a gap, in order."""
    if not len(time):
        return
    steps = np.diff(time)
    usual = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0  # some share a time stamp
    cuts = np.flatnonzero(steps > GAP * usual) + 1
    edges = [0, *(int(cut) for cut in cuts), len(time)]
    yield from (slice(a, b) for a, b in pairwise(edges))


def worst_stretch(misfit: Misfit) -> tuple[int, slice] | None:
    """Drive and samples of the slip with the largest torque error, simulated less measured, as the
    sum of squares; None where there is none."""
    slips = [
        (float(np.nansum((measured[piece] - simulated[piece]) ** 2)), drive, piece)
        for drive, (time, measured, simulated, _) in enumerate(misfit.torque)
        for piece in pieces(time)
    ]
    if not slips:
        return None
    _, drive, piece = max(slips, key=lambda entry: entry[0])
    return drive, piece


def most_significant(bins: Sequence[Bins], covariate: str, extended: bool) -> Bins | None:
    """Of the bins over ``covariate`` those whose means deviate most from noise; of an ``extended``
    model those in which it removed most of that."""

    def excess(b: Bins) -> float:
        if extended:
            return removed(b)
        n = np.count_nonzero(_counted(b))
        return float((_chi2(b, b.mean) - n) / np.sqrt(2 * n)) if n else -np.inf

    return max((b for b in bins if b.covariate == covariate), key=excess, default=None)


def removed(bins: Bins) -> float:
    """χ² of the means that the extended model removes."""
    return _chi2(bins, bins.mean) - _chi2(bins, bins.after)


def _chi2(bins: Bins, mean: Floats) -> float:
    counted = _counted(bins)
    return float(np.sum((mean[counted] / bins.error[counted]) ** 2))


def _counted(bins: Bins) -> NDArray[np.bool_]:
    return np.asarray((bins.count > 0) & (bins.error > 0))


def draw_misfit(
    misfit: Misfit,
    machine: Machine,
    drivers: Sequence[str],
    extended: bool,
    unproven: float | None = None,
) -> Picture:
    """The compared pair over the worst slip, of the ``extended`` model too where there is one, if
    the machine has such a pair; binned residuals over the first of their ``drivers``, over time
    where they have none; ``unproven``: the p-value of an error over it that is not established."""
    compared = machine.compared
    figure = Picture(figsize=(10 if compared else 5, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    if compared is None:
        residuals = figure.subplots()
    else:
        pair, residuals = figure.subplots(1, 2, width_ratios=(3, 2))
        _draw_compared(misfit, compared, extended, pair)
    binned = {b.covariate for b in misfit.bins}
    driver = next((name for name in drivers if name in binned), TIME)
    _draw_bins(misfit, machine, driver, extended, residuals)
    if unproven is not None and driver in drivers and misfit.bins:
        said = f"strongest driver, not established (p = {unproven:.2g})"
        title = f"{said}\n{residuals.get_title('left')}"
        residuals.set_title(title, loc="left", fontsize=9)
    return figure


def _draw_compared(misfit: Misfit, compared: Comparison, extended: bool, axes: Axes) -> None:
    worst = worst_stretch(misfit)
    if worst is None:
        _say(axes, "no open-loop comparison")
        return
    drive, piece = worst
    time, measured, simulated, mended = (c[piece] for c in misfit.torque[drive])
    if np.array_equal(measured, simulated):
        _say(axes, f"no independent measurement of the {compared.what}")
        return
    axes.plot(time, measured, ".", ms=3, color="0.55", label="measured")
    axes.plot(time, simulated, lw=1.4, color="C0", label="simulated")
    if extended:
        axes.plot(time, mended, lw=1.4, color="C1", label="extended model")
    drives = f"drive {drive}, " if len(misfit.torque) > 1 else ""
    axes.set_title(f"largest error of the {compared.what}", loc="left", fontsize=9)
    axes.set_xlabel(f"{drives}time [s]")
    axes.set_ylabel(f"{compared.what} [{compared.unit}]")
    axes.legend(fontsize=8)


def _draw_bins(misfit: Misfit, machine: Machine, driver: str, extended: bool, axes: Axes) -> None:
    bins = most_significant(misfit.bins, driver, extended)
    if bins is None:
        _say(axes, "too few readings for binned residuals")
        return
    quantity = quantity_of(machine, bins.covariate)
    axes.axhline(0.0, color="0.6", lw=0.8)
    edges = quantity.read(bins.edges)
    shown = bins.count > 0
    series = [("original model", "C3", bins.mean, bins.error)]
    if extended:
        series.append(("extended model", "C1", bins.after, bins.after_error))
    for label, colour, mean, error in series:
        axes.errorbar(
            (0.5 * (edges[:-1] + edges[1:]))[shown],
            mean[shown],
            xerr=(0.5 * np.diff(edges))[shown],
            yerr=2 * error[shown],
            fmt="o",
            ms=4,
            lw=1.2,
            color=colour,
            label=label,
        )
    if extended:
        axes.margins(y=0.3)  # room for the legend
        axes.legend(fontsize=8, ncols=2, loc="upper center")
    sensor = Quantity(bins.sensor, "1").words
    title = f"{sensor}, {bins.mode}: mean ± 2 standard errors"
    if extended and removed(bins) < VISIBLE:
        title = f"not visible here: in the original model\nits parameters make up for it\n{title}"
    axes.set_title(title, loc="left", fontsize=9)
    axes.set_xlabel(quantity.label)
    axes.set_ylabel("residual [standard deviations]")


def _say(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, ha="center", va="center")
    axes.set_axis_off()
