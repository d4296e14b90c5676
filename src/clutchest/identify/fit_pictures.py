"""Data against fit, in the pictures that the machine declares."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchest.identify.likelihood import Posterior, along
from clutchest.identify.validation import reading_errors, rows_of
from clutchest.models.experiments import ExperimentCurve, Parameters
from clutchest.models.procedures import (
    CurvePicture,
    Picture,
    PicturePanel,
    Procedure,
    ReadingsPicture,
    TimePicture,
)
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 5.0  # s; a longer pause in what is drawn parts two slips
DOTS_PER_INCH = 110
PANEL_HEIGHT = 2.5  # inches


def draw(procedure: Procedure, posterior: Posterior, vehicle: Vehicle, folder: Path) -> None:
    """The pictures of a procedure; ``vehicle`` has the fitted numbers."""
    for picture in procedure.pictures:
        figure = _drawn(picture, procedure, posterior, vehicle)
        figure.savefig(folder / picture.file, dpi=DOTS_PER_INCH)


def draw_curves(
    curves: Sequence[tuple[ExperimentCurve, Floats]],
    before: Parameters,
    after: Parameters,
    folder: Path,
) -> None:
    """The pictures of experiments, each with the own numbers of its record; those of one file on
    common axes."""
    for file in dict.fromkeys(curve.file for curve, _ in curves):
        figure, (axes,) = _sheet(1, 4.5)
        for i, (curve, own) in enumerate(pair for pair in curves if pair[0].file == file):
            labels = ("measured", "before", "fitted") if i == 0 else (None, None, None)
            if curve.left_out is not None:
                label = "measured, not used" if i == 0 else None
                axes.plot(*curve.left_out(after, own), ".", color="0.8", ms=3, label=label)
            axes.plot(*curve.points(after, own), "C0.", ms=3, label=labels[0])
            axes.plot(*curve.model(before, own), "C7--", lw=1.2, label=labels[1])
            axes.plot(*curve.model(after, own), "k", lw=1.2, label=labels[2])
            axes.set(xlabel=curve.labels[0], ylabel=curve.labels[1])
        axes.legend(fontsize=8)
        figure.savefig(folder / file, dpi=DOTS_PER_INCH)


def _drawn(
    picture: Picture, procedure: Procedure, posterior: Posterior, vehicle: Vehicle
) -> Figure:
    match picture:
        case CurvePicture():
            return _curve(picture, procedure, posterior, vehicle)
        case TimePicture():
            return _over_time(picture, posterior)
        case ReadingsPicture():
            return _readings(picture, posterior)


def _sheet(rows: int, height: float) -> tuple[Figure, list[Axes]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, squeeze=False)[:, 0])


def _curve(
    picture: CurvePicture, procedure: Procedure, posterior: Posterior, vehicle: Vehicle
) -> Figure:
    """Measured values over another quantity, the curve as it was and as it is."""
    was = posterior.problem.vehicle.parameters
    before = {key: was[key].value for key in procedure.parameters}
    after = {key: vehicle.parameters[key].value for key in procedure.parameters}
    figure, (axes,) = _sheet(1, 4.5)
    names = (picture.over, picture.measured, picture.curve)
    for drive in range(len(posterior.problem.drives)):
        time, (x, measured, fitted) = along(posterior, drive, names, after)
        _, (_, _, old) = along(posterior, drive, names, before)
        order = np.argsort(x)
        labels = ("measured", "before", "fitted") if drive == 0 else (None, None, None)
        dots = axes.scatter(x, measured, c=time, s=4, cmap="viridis", label=labels[0])
        axes.plot(x[order], fitted[order], "k", lw=2.5, label=labels[2])
        axes.plot(x[order], old[order], "C1--", lw=1.2, label=labels[1])
    figure.colorbar(dots, ax=axes, label="time [s]")
    axes.grid(alpha=0.3)
    axes.set(xlabel=picture.labels[0], ylabel=picture.labels[1])
    axes.legend()
    return figure


def _over_time(picture: TimePicture, posterior: Posterior) -> Figure:
    """Quantities over time, drive below drive."""
    drives, panels = len(posterior.problem.drives), picture.panels
    names = [line.quantity for panel in panels for line in panel.lines]
    figure, axes = _sheet(len(panels) * drives, PANEL_HEIGHT * len(panels) * drives)
    for drive in range(drives):
        time, values = along(posterior, drive, names)
        values[:, 1:][:, np.diff(time) > LEAST] = np.nan  # no line from one slip to the next
        own = axes[len(panels) * drive : len(panels) * (drive + 1)]
        for panel, frame in zip(panels, own, strict=True):
            _panel(panel, frame, time, dict(zip(names, values, strict=True)))
        own[-1].set_xlabel("time [s]")
    return figure


def _panel(panel: PicturePanel, axes: Axes, time: Floats, values: dict[str, Floats]) -> None:
    for line in panel.lines:
        axes.plot(time, values[line.quantity], line.style, lw=0.8, label=line.label)
    axes.set_ylabel(panel.label)
    axes.legend(fontsize=8)


def _readings(picture: ReadingsPicture, posterior: Posterior) -> Figure:
    """Measured and fitted readings over time, drive below drive."""
    problem = posterior.problem
    figure, axes = _sheet(len(problem.drives), 3.2 * len(problem.drives))
    for i, (drive, frame) in enumerate(zip(problem.drives, axes, strict=True)):
        rows = rows_of(problem, i, picture.sensor)
        time, measured = drive.readings.t[rows], drive.line.z[drive.readings.event[rows]]
        off = reading_errors(problem, i, picture.sensor, posterior.fit.raw[i].r)
        frame.plot(time, measured, "C0.", ms=2, label="measured")
        frame.plot(time, measured - off, "C1.", ms=1, label="fitted")
        frame.set(ylabel=picture.label, xlabel="time [s]")
        frame.legend(fontsize=8, markerscale=5)
    return figure
