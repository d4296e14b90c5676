"""The counterparts of Figs. 5b and 9–13, on axes like the paper's, and of what A9 explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from clutchest.reproduce.id08.deviations import Explained
from clutchest.reproduce.id08.ramps import DEGREES
from clutchest.reproduce.id08.rig import Columns
from clutchest.reproduce.id08.steps import PLOTS, Response
from clutchest.reproduce.sheet import save, sheet
from clutchest.signals import Floats

STARTS = {12.0: 0.7 - 0.3, 7.0: 0.5 - 0.1, 2.5: 0.4}  # s, where the plots' time begins


def draw(data: Mapping[str, Any], folder: Path) -> None:
    """``fig5.png``, ``fig9.png`` … ``fig13.png`` and ``deviations.png``."""
    figures = {
        "fig5": spring(data["A8"]),
        "fig9": loop(data["A7"], 2000.0, 0.08),
        "fig10": loop(data["A6"], 1600.0, 0.8),
        "fig11": steps(data["A1"]),
        "fig12": slow(data["A4"]),
        "fig13": ramps(data["A5"]),
        "deviations": explained(data["A9"]),
    }
    save(figures, folder)


def _transient(axes: Axes, response: Response, low: float, high: float) -> None:
    """Request, current, voltage, angle and torque, scaled as the paper scales them."""
    o = response.columns
    curves: tuple[tuple[str, Floats], ...] = (
        ("100 i_aR [A]", 100.0 * o["request"]),
        ("100 i_a [A]", 100.0 * o["current"]),
        ("50 u_a [V]", 50.0 * o["armature_voltage"]),
        ("50 α_m1 [rad]", 50.0 * o["motor_angle"]),
        ("T_c [Nm]", o["clutch_torque"]),
    )
    for label, value in curves:
        axes.plot(o["time"], value, label=label, lw=1.8 if label.startswith("T_c") else 0.9)
    axes.set(xlabel="t [s]", ylim=(low, high), xlim=(STARTS[response.amps], o["time"][-1]))
    axes.grid(alpha=0.4)


def steps(results: Mapping[float, Response]) -> Figure:
    """Fig. 11: engagement and release at 25 rpm."""
    figure, sheets = sheet(3, 10.0)
    for axes, (amps, response) in zip(sheets, results.items(), strict=True):
        _transient(axes, response, *PLOTS[amps][2:])
        axes.set_title(f"i_aR = {amps:g} A", fontsize=9)
    sheets[0].legend(fontsize=7, ncols=5)
    return figure


def slow(response: Response) -> Figure:
    """Fig. 12: 12 A at 0.5 rpm."""
    figure, (axes,) = sheet(height=4.2)
    _transient(axes, response, -500.0, 3000.0)
    axes.legend(fontsize=7, ncols=5)
    return figure


def ramps(results: Mapping[float, Columns]) -> Figure:
    """Fig. 13: requested current over motor angle."""
    figure, (axes,) = sheet(height=4.2)
    for rate, o in results.items():
        axes.plot(o["motor_angle"] * DEGREES, o["request"], lw=0.9, label=f"{rate:g} A/s")
    axes.set(xlabel="α_m1 [°]", ylabel="i_aR [A]", xlim=(0.0, 1600.0), ylim=(0.0, 20.0))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.4)
    return figure


def loop(o: Columns, widest: float, highest: float) -> Figure:
    """Figs. 9 and 10: motor torque over motor angle."""
    figure, (axes,) = sheet(height=4.2)
    axes.plot(o["motor_angle"] * DEGREES, o["motor_torque"], lw=0.9)
    axes.set(xlabel="α_m1 [°]", ylabel="T_m1 [Nm]", xlim=(0.0, widest), ylim=(0.0, highest))
    axes.grid(alpha=0.4)
    return figure


def spring(results: tuple[Floats, Floats, float]) -> Figure:
    """Fig. 5b: the reset spring, and where it rests."""
    displacement, force, preload = results
    figure, (axes,) = sheet(height=4.2)
    axes.plot(1e3 * displacement, force)
    axes.plot(1e3 * preload, np.interp(preload, displacement, force), "o", label="at rest")
    axes.set(xlabel="s [mm]", ylabel="F [N]", xlim=(0.0, 3.0), ylim=(0.0, 2500.0))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.4)
    return figure


def explained(results: Sequence[Explained]) -> Figure:
    """A9: the deviating rig, the model as it stands, and with its extension."""
    figure, sheets = sheet(len(results), 2.6 * len(results))
    for axes, e in zip(sheets, results, strict=True):
        off, end = PLOTS[e.deviation.amps][:2]
        start, stop = e.deviation.window or (off, end)
        name = e.deviation.quantity
        for columns, label, style in (
            (e.measured, "rig", "k"),
            (e.base, "model", "C1"),
            (e.extended, f"with {e.deviation.extension.name}", "C0--"),
        ):
            axes.plot(columns["time"], columns[name], style, lw=1.0, label=label)
        axes.set(xlim=(start, stop), ylabel="T_c [Nm]" if "torque" in name else "α_m1 [rad]")
        axes.set_title(
            f"{e.deviation.words}: {100 * e.removed:.0f} % of the RMS error removed", fontsize=8
        )
        axes.legend(fontsize=7)
        axes.grid(alpha=0.4)
    return figure
