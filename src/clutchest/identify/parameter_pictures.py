"""Data against fit, on axes like those of [ME12]."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchest.identify.likelihood import Posterior, along
from clutchest.identify.validation import zero_position_errors, zero_position_rows
from clutchest.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CURVE = ("torque_cubic", "torque_quadratic", "kiss_point")
LEAST = 5.0  # s; a longer pause in what is drawn parts two slips


def _sheet(rows: int, height: float) -> tuple[Figure, list[Axes]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, squeeze=False)[:, 0])


def draw_curve(posterior: Posterior, vehicle: Vehicle, folder: Path) -> None:
    """``torque_curve.png``: measured torque over corrected position, the curve as it was and as it
    is (Fig. 8)."""
    before = {key: posterior.problem.vehicle.parameters[key].value for key in CURVE}
    after = {key: vehicle.parameters[key].value for key in CURVE}
    figure, (axes,) = _sheet(1, 4.5)
    names = ("corrected_position", "measured_torque", "reference_torque")
    for drive in range(len(posterior.problem.drives)):
        time, (x, measured, reference) = along(posterior, drive, names, after)
        _, (_, _, old) = along(posterior, drive, names, before)
        order = np.argsort(x)
        axes.scatter(x, measured, c=time, s=2, cmap="jet")
        labels = ("before", "fitted") if drive == 0 else (None, None)
        axes.plot(x[order], old[order], "C7--", lw=1.5, label=labels[0])
        axes.plot(x[order], reference[order], "k", lw=1.5, label=labels[1])
    axes.set(xlabel="corrected position, mm", ylabel="clutch torque, Nm")
    axes.legend()
    figure.savefig(folder / "torque_curve.png", dpi=110)


def draw_torque(posterior: Posterior, vehicle: Vehicle, folder: Path) -> None:
    """``torque.png``: measured and fitted torque over time, temperatures below (Fig. 10)."""
    names = ("measured_torque", "clutch_torque", "temp_body", "temp_housing", "temp_disc")
    drives = len(posterior.problem.drives)
    figure, axes = _sheet(2 * drives, 5.0 * drives)
    for drive in range(drives):
        torques, temperatures = axes[2 * drive : 2 * drive + 2]
        time, values = along(posterior, drive, names)
        values[:, 1:][:, np.diff(time) > LEAST] = np.nan  # no line from one slip to the next
        torques.plot(time, values[0], "k", lw=0.8, label="measured")
        torques.plot(time, values[1], "C1", lw=0.8, label="fitted")
        torques.set_ylabel("clutch torque, Nm")
        for value, label in zip(values[2:], ("body", "housing", "disc"), strict=True):
            temperatures.plot(time, value, lw=0.9, label=label)
        temperatures.set(ylabel="temperature, °C", xlabel="time, s")
        torques.legend(fontsize=8)
        temperatures.legend(fontsize=8)
    figure.savefig(folder / "torque.png", dpi=110)


def draw_zero_position(posterior: Posterior, vehicle: Vehicle, folder: Path) -> None:
    """``zero_position.png``: measured and fitted zero position over time (Fig. 5)."""
    drives = posterior.problem.drives
    figure, axes = _sheet(len(drives), 3.2 * len(drives))
    for i, (drive, frame) in enumerate(zip(drives, axes, strict=True)):
        rows = zero_position_rows(posterior.problem, i)
        time, measured = drive.readings.t[rows], drive.line.z[drive.readings.event[rows]]
        off = zero_position_errors(posterior.problem, i, posterior.fit.raw[i].r)
        frame.plot(time, measured, "C0.", ms=2, label="measured")
        frame.plot(time, measured - off, "C1.", ms=1, label="fitted")
        frame.set(ylabel="zero position, mm", xlabel="time, s")
        frame.legend(fontsize=8, markerscale=5)
    figure.savefig(folder / "zero_position.png", dpi=110)
