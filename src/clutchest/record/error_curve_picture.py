"""The picture of an error that no known cause explains: what the data say over its driver."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from clutchest.discovery.result import Discovery
from clutchest.discovery.where import place_words
from clutchest.models.quantities import quantity_of
from clutchest.pictures import Picture
from clutchest.record.error_curve import in_units


def draw_error_curve(discovery: Discovery) -> Picture | None:
    """The curve in the extended model over its driver, in physical units, ± 2σ; None where the
    extended model has none."""
    curve = discovery.extended.curves.get(discovery.curve or "")
    if curve is None:
        return None
    machine = discovery.vehicle.machine
    term, driver = machine.error_terms[curve.error_term], quantity_of(machine, curve.covariate)
    at, (values, std, unit) = driver.read(np.array(curve.knots)), in_units(term, curve)
    figure = Picture(figsize=(7.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.fill_between(at, values - 2 * std, values + 2 * std, color="C0", alpha=0.25, lw=0.0)
    axes.plot(at, values, "o-", ms=4, lw=1.4, color="C0")
    axes.set_title(f"error in {place_words(term.equation)}, ± 2σ", loc="left", fontsize=9)
    axes.set_xlabel(driver.label)
    axes.set_ylabel(f"error [{unit}]" if unit != "1" else "relative error")
    return figure
