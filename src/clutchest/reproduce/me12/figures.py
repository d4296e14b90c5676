"""The counterparts of Figs. 2–5 and 7–11, on axes like the paper's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from clutchest.reproduce.me12.curve import STROKE, STROKES, Ramps
from clutchest.reproduce.me12.expansion import ZeroPosition
from clutchest.reproduce.me12.launch import Launches
from clutchest.reproduce.me12.model import NO_DISC, RATE, STATIC
from clutchest.reproduce.me12.pulses import SHOWN, Pulses
from clutchest.reproduce.me12.slip import Steps
from clutchest.reproduce.sheet import save, sheet
from clutchest.signals import Floats

RAD_S_TO_RPM = 60.0 / (2.0 * np.pi)


def draw(data: Mapping[str, Any], folder: Path) -> None:
    """``fig2.png`` … ``fig11.png`` from what the rows D1 … D8 were judged on."""
    steps, heating, pulses, launches = data["D3"], data["D4"], data["D7"], data["D8"]
    figures = {
        "fig2": ramped(data["D1"], "Piston Pos. [mm]", **STATIC),
        "fig3": slip_steps(steps),
        "fig4": torque_over_slip(steps),
        "fig5": zero_position(heating),
        "fig7": ramped(data["D2"], "Swell Corrected Pos. [mm]", **NO_DISC),
        "fig8": ramped(data["D2"], "Double Swell Corrected Pos. [mm]"),
        "fig9": residuals(pulses),
        "fig10": torque_pulses(pulses),
        "fig11": one_launch(launches),
    }
    save(figures, folder)


def ramped(ramps: Ramps, label: str, **parameters: float) -> Figure:
    """Figs. 2, 7, 8: torque over position as corrected with these parameters, coloured by time;
    uncorrected, (5) fitted to the first and to the last ramp."""
    figure, (axes,) = sheet()
    position, reference = ramps.corrected(**parameters)
    dots = axes.scatter(position, ramps.measured, c=ramps.time, s=3, cmap="jet", vmin=0, vmax=75)
    if parameters == STATIC:
        for stroke in (0, STROKES - 1):
            rows = np.abs(ramps.time - (stroke + 0.5) * STROKE) < 0.49 * STROKE
            axes.plot(*_curve(position[rows], ramps.measured[rows]), "k", lw=1.2)
    else:
        order = np.argsort(position)
        axes.plot(position[order], reference[order], "k", lw=1.2)
    figure.colorbar(dots, label="Time [s]")
    left = 4 if parameters == STATIC else 2.5  # what is corrected is more closed
    axes.set(xlim=(left, 12), ylim=(-50, 1500), xlabel=label, ylabel="Clutch Torque [Nm]")
    return figure


def _curve(position: Floats, torque: Floats) -> tuple[Floats, Floats]:
    """(5) fitted to measurements, as (x, M_ref)."""
    kisses = np.linspace(5.5, 9.5, 161)
    best, law = np.inf, np.zeros(3)
    for kiss in kisses:
        depth = np.minimum(position - kiss, 0.0)
        terms = np.column_stack([depth**3, depth**2])
        numbers, *_ = np.linalg.lstsq(terms, torque, rcond=None)
        error = float(np.sum((terms @ numbers - torque) ** 2))
        if error < best:
            best, law = error, np.array([*numbers, kiss])
    x = np.linspace(4.0, 12.0, 200)
    depth = np.minimum(x - law[2], 0.0)
    return x, law[0] * depth**3 + law[1] * depth**2


def slip_steps(steps: Steps) -> Figure:
    """Fig. 3: a series of slip steps."""
    run = steps.compared.run
    shown = (run.time > 5.0) & (run.time < 30.0)
    time = run.time[shown]
    engine, shaft, torque, slip = run.quantity(
        "engine_speed", "input_shaft_speed", "engine_torque", "slip_speed"
    )[:, shown]
    figure, (speed, torques, slips, acceleration) = sheet(4, 8.0)
    speed.plot(time, engine * RAD_S_TO_RPM)
    speed.set(ylabel="Engine Speed [RPM]", ylim=(400, 1500))
    torques.plot(time, torque, "C1", lw=0.8, label="ICE")
    torques.plot(time, steps.compared.measured[shown], "C0", label="Clutch")
    torques.set(ylabel="Torque [Nm]", ylim=(-100, 300))
    torques.legend(loc="lower right")
    slips.plot(time, slip * RAD_S_TO_RPM)
    slips.set(ylabel="Slip [RPM]", ylim=(0, 1500))
    acceleration.plot(time, np.gradient(shaft, time) * RAD_S_TO_RPM)
    acceleration.set(ylabel="Input Shaft\nAcceleration [RPM/s]", xlabel="Time [s]", ylim=(-20, 20))
    for axes in (speed, torques, slips, acceleration):
        axes.set_xlim(5, 30)
    return figure


def torque_over_slip(steps: Steps) -> Figure:
    """Fig. 4: every step's torque, as measured and at one curve and temperature."""
    figure, (axes,) = sheet()
    slip = steps.slip * RAD_S_TO_RPM
    axes.plot(slip, steps.torque, ".", color="C7", ms=4, label="as measured")
    level = float(np.mean(steps.torque))
    axes.plot(slip, steps.torque / steps.level * level, "o", ms=4, label="corrected for heat")
    axes.set(xlim=(600, 1350), ylim=(50, 250), xlabel="Slip [rpm]", ylabel="Clutch Torque [Nm]")
    axes.legend()
    return figure


def zero_position(heating: ZeroPosition) -> Figure:
    """Fig. 5: zero position while the clutch is heated several times and cools."""
    figure, (axes,) = sheet()
    for k, rest in enumerate(heating.rests()):
        names = ("Measured", "Modeled") if k == 0 else (None, None)
        axes.plot(heating.time[rest], heating.measured[rest], "C0.", ms=1, label=names[0])
        axes.plot(heating.time[rest], heating.modelled[rest], "C1", lw=1.5, label=names[1])
    axes.set(xlim=(0, 2500), ylim=(38.3, 39.3), xlabel="Time [s]", ylabel="Zero Position [mm]")
    axes.set_yticks([38.4, 38.6, 38.8, 39.0, 39.2])
    axes.legend(markerscale=6)
    return figure


def residuals(pulses: Pulses) -> Figure:
    """Fig. 9: what the model misses in Fig. 10."""
    figure, (axes,) = sheet()
    time = pulses.own.run.time[pulses.shown]
    axes.plot(time, pulses.residual(pulses.modelled.run.torque), "C2.", ms=2, label="P Modeled")
    axes.plot(time, pulses.residual(pulses.own.run.torque), "C1.", ms=2, label="P Measured")
    for level in (-200, -100, 100, 200):
        axes.axhline(level, color="0.8", lw=0.8, zorder=0)
    axes.set(xlim=SHOWN, ylim=(-300, 300), xlabel="Time [s]", ylabel="Residual [Nm]")
    axes.legend(markerscale=4)
    return figure


def torque_pulses(pulses: Pulses) -> Figure:
    """Fig. 10: torque pulses, and the temperatures behind them."""
    figure, (torques, temperatures) = sheet(2, 5.5)
    run = pulses.own.run
    slipping = np.where(pulses.own.slipping, 1.0, np.nan)  # beside slips a torque says nothing
    for torque, label, style in (
        (pulses.own.measured, "Measurement", "k"),
        (pulses.static, "Static Model", "C0"),
        (run.torque, "P Measured", "C1"),
        (pulses.modelled.run.torque, "P Modeled", "C2"),
    ):
        torques.plot(run.time, torque * slipping, style, lw=0.8, label=label)
    torques.set(ylim=(-20, 700), ylabel="Clutch Torque [Nm]")
    coolant = run.quantity("coolant_temp")[0]
    for value, label in (
        (run.state("temp_body"), "Body"),
        (run.state("temp_housing"), "Housing"),
        (run.state("temp_disc"), "Disc"),
        (coolant, "engine"),
    ):
        temperatures.plot(run.time, value, lw=0.9, label=label)
    temperatures.set(ylim=(50, 220), ylabel="Temperature [C]", xlabel="Time [s]")
    for axes in (torques, temperatures):
        axes.set_xlim(SHOWN)
        axes.legend(loc="upper right", fontsize=7, ncols=4)
    return figure


def one_launch(launches: Launches) -> Figure:
    """Fig. 11: the launch nearest to the paper's time."""
    figure, (torques, temperatures) = sheet(2, 5.5)
    compared = launches.compared
    run, rows = compared.run, launches.shown()
    begin, end = run.time[rows[0]] - 5.0 / RATE, run.time[rows[-1]]
    shown = np.flatnonzero((run.time >= begin) & (run.time <= end))
    for torque, label, style in (
        (compared.measured, "Measurement", "k"),
        (launches.static, "Static Model", "C0"),
        (run.torque, "Dynamic Model", "C1"),
    ):
        torques.plot(run.time[shown], torque[shown], style, label=label)
    torques.set(ylim=(-50, 1250), ylabel="Clutch Torque [Nm]")
    torques.legend(fontsize=7)
    for name in ("body", "housing", "disc"):
        temperatures.plot(run.time[shown], run.state(f"temp_{name}")[shown], label=name.title())
    temperatures.set(ylim=(20, 120), ylabel="Temperature [C]", xlabel="Time [s]")
    temperatures.legend(fontsize=7)
    return figure
