"""The picture of causes over their drivers: as the effect has each, and as the data have it."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg

from clutchest.discovery.result import Cause, Discovery, FormCurve
from clutchest.discovery.where import place_words
from clutchest.models.quantities import quantity_of
from clutchest.pictures import Picture


def draw_forms(discovery: Discovery) -> Picture | None:
    """One panel a cause; None where no form was tested."""
    drawn = [(c, c.form.curve) for c in discovery.causes if c.form.curve is not None]
    if not drawn:
        return None
    figure = Picture(figsize=(5.0 * len(drawn), 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(drawn), squeeze=False)[0]
    for axes, (cause, curve) in zip(panels, drawn, strict=True):
        _draw(discovery, axes, cause, curve)
    return figure


def _draw(discovery: Discovery, axes: Axes, cause: Cause, curve: FormCurve) -> None:
    driver = quantity_of(discovery.vehicle.machine, curve.covariate)
    at = driver.read(curve.at)
    low, high = curve.data - 2.0 * curve.std, curve.data + 2.0 * curve.std
    axes.fill_between(at, low, high, color="C0", alpha=0.25, lw=0.0, label="data, ± 2 σ")
    axes.plot(at, curve.data, lw=1.4, color="C0")
    axes.plot(at, curve.effect, lw=1.4, color="C1", label=cause.effect)
    spread = max(float((abs(curve.data) + 2.0 * curve.std).max()), float(abs(curve.effect).max()))
    if spread > (reach := 3.0 * max(float(abs(v).max()) for v in (curve.effect, curve.data))):
        axes.set_ylim(-reach, reach)  # beyond, the band says no more than that nothing is known
    axes.set_title(
        f"{cause.effect}: form {cause.form.state or 'not tested'}", loc="left", fontsize=9
    )
    axes.set_xlabel(driver.label)
    what = curve.of if curve.of_gain else f"error in {place_words(curve.of)}"
    axes.set_ylabel(what if curve.unit == "1" else f"{what} [{curve.unit}]")
    axes.legend(fontsize=8)
