"""I8: σ_0.c from the slope of T_m2 over α_m2 while the clutch is locked, times K_g2²."""

from __future__ import annotations

import numpy as np

from clutchest.models.alsd.driveline import REVERSAL
from clutchest.models.alsd.experiments.motion import local_polynomial, second_derivative_std
from clutchest.models.experiments import (
    BenchExperiment,
    BenchRecord,
    EquationErrors,
    ExperimentCurve,
    Parameters,
)
from clutchest.signals import Floats

SIGNALS = ("drive_torque", "drive_angle")
LEAST = 20.0  # Nm, the torque must reach
CONTACT = 0.4  # of the largest twist: beyond it the play is taken up
SLIDING = 3.0  # of the speed over which driveline friction turns its sign
LOCKED = 3.0  # times the expected twist: a clutch that turns further slips
WINDOW, ORDER = 7, 4  # samples that give speed and acceleration
ANYWHERE = 0.05  # rad of the clutch, in which the middle of the play lies


def reduce(record: BenchRecord) -> EquationErrors | str:
    """T_m2 − T_f2 − J_2 dω_m2/dt − σ_0.c dz(α_m2/K_g2 − offset, α_b2)/K_g2 in contact."""
    torque, angle = (record.signals[name] for name in SIGNALS)
    p, most = record.parameters, float(np.abs(torque.value).max())
    if most < LEAST or len(angle) < WINDOW:
        return f"the servo torque reaches {most:.0f} Nm, less than {LEAST:g} Nm"
    ratio = p["final_drive_ratio"]
    twist = (ratio * most / p["torsional_stiffness"] + p["differential_backlash"]) * ratio
    if np.ptp(angle.value) > 2 * LOCKED * twist:
        return "the clutch slips: the servo motor turns further than clutch and structure twist"
    a, w, dw = local_polynomial(angle.time, angle.value, WINDOW, ORDER).T
    t2 = torque.at(angle.time)
    middle = (angle.value.max() + angle.value.min()) / 2
    side = np.sign(angle.value - middle)
    far = np.abs(angle.value - middle) > CONTACT * np.ptp(angle.value) / 2
    # where a polynomial passes over a reversal or the play, its acceleration is none
    within = [np.convolve(sign, np.ones(WINDOW), "same") for sign in (np.sign(w), far * side)]
    smooth = np.all(np.abs(within) == WINDOW, axis=0)
    keep = smooth & (np.abs(w) > SLIDING * REVERSAL)
    if keep.sum() < WINDOW:
        return "no torque beyond the play at which the servo motor turns"
    t2, a, w, dw, side = t2[keep], angle.value[keep], w[keep], dw[keep], side[keep]
    way = np.tanh(w / REVERSAL)
    std = _std(record, angle.time)

    def elastic(p: Parameters, own: Floats, a: Floats, side: Floats) -> Floats:
        ratio = p["final_drive_ratio"]
        z = a / ratio - own[0] - side * p["differential_backlash"]
        return np.asarray(p["torsional_stiffness"] * z / ratio)

    def errors(p: Parameters, own: Floats) -> Floats:
        rest = t2 - p["driveline_friction"] * way - p["structure_inertia"] * dw
        return np.asarray((rest - elastic(p, own, a, side)) / std)

    def points(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        return a, t2 - p["driveline_friction"] * way - p["structure_inertia"] * dw

    def curve(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        order = np.argsort(a)
        return a[order], elastic(p, own, a, side)[order]

    slopes = [np.polyfit(a[side == s], t2[side == s], 1)[0] * ratio**2 for s in set(side)]
    words = "slope K_g2² dT_m2/dα_m2 " + " and ".join(f"{s:.0f}" for s in slopes) + " Nm/rad"
    labels = ("α_m2, rad", "T_m2 − T_f2 − J_2 dω_m2/dt, Nm")
    own = np.array([[float(middle) / ratio, ANYWHERE]])
    picture = ExperimentCurve("torsion.png", labels, points, curve)
    return EquationErrors(errors, own, (words,), (picture,))


def _std(record: BenchRecord, time: Floats) -> float:
    """Standard deviation of the equation errors, Nm: torque sensor, and acceleration by a
    polynomial."""
    per_angle = second_derivative_std(float(np.median(np.diff(time))), WINDOW, ORDER)
    of_angle = record.parameters["structure_inertia"] * per_angle * record.noise[SIGNALS[1]]
    return float(np.hypot(record.noise[SIGNALS[0]], of_angle))


I8 = BenchExperiment(
    "I8",
    "σ_0.c, the differential's play and T_f2, from a sinusoidal servo torque on a locked clutch",
    ("torsional_stiffness", "differential_backlash", "driveline_friction"),
    ("rig",),
    SIGNALS,
    reduce,
)
