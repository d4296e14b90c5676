"""I6: μ_b and the spring's pre-tension from the loop of T_m1 over α_m1 without the pack.

Half the loop's width, less T_f1 at each branch's own speed, is T_f.br/K_g1; the ball-ramp force is
the reset spring's, F_0 at its beginning.
"""

from __future__ import annotations

import numpy as np

from clutchest.models.alsd.experiments.motor_runs import friction
from clutchest.models.alsd.experiments.path_torque import AnglePath, spring_force
from clutchest.models.experiments import (
    BenchExperiment,
    BenchRecord,
    EquationErrors,
    ExperimentCurve,
    Parameters,
)
from clutchest.signals import Floats

SIGNALS = ("motor_angle", "armature_current", "armature_temp")
BIN = 2.0  # rad
LEAST = 5.0  # rad that both branches must share


def reduce(record: BenchRecord) -> EquationErrors | str:
    """T_m1 along the path of the motor, up and down."""
    path = AnglePath.of(record)
    if path is None or not path.counts.any():
        return "the motor does not turn evenly"
    up, down = (path.counts & (path.motion[:, 1] * way > 0) for way in (1, -1))
    shared = _overlap(path.motion[:, 0], up, down)
    if shared < LEAST:
        return f"ways up and down share {shared:.0f} rad of the angle, less than {LEAST:g}"
    return EquationErrors(
        path.errors,
        path.own,
        lambda p: (loop(path, p),),
        (loop_curve(path, "loop.png"),),
    )


def _overlap(angle: Floats, up: np.ndarray, down: np.ndarray) -> float:
    """rad of the angle that both branches pass."""
    if not (up.any() and down.any()):
        return 0.0
    ends = [(angle[rows].min(), angle[rows].max()) for rows in (up, down)]
    return float(min(b for _, b in ends) - max(a for a, _ in ends))


def loop(path: AnglePath, p: Parameters) -> str:
    """Half width and shift of the loop as the paper reads them, in words."""
    angle, speed = path.motion[:, 0], path.motion[:, 1]
    torque = np.full(len(angle), np.nan)
    torque[path.counts] = path.measured(p, path.own[:, 0])[1]
    torque -= friction(p, speed)
    widths, shifts = [], []
    for low in np.arange(angle.min(), angle.max(), BIN):
        rows = path.counts & (angle >= low) & (angle < low + BIN)
        branches = [torque[rows & (speed * way > 0)] for way in (1, -1)]
        if min(map(len, branches)) > 3:
            above, below = (float(np.mean(branch)) for branch in branches)
            widths.append((above - below) / 2)
            shifts.append((above + below) / 2)
    if not widths:
        return "no part of the loop has both branches"
    force = p["gear_ratio"] * p["ball_ramp_ratio"] * np.array(shifts)
    half = p["gear_ratio"] * np.array(widths)
    coefficient = np.mean(half / force) / (p["ball_ramp_bore"] / 2)
    return (
        f"less T_f1, half the loop's width is {1e3 * np.mean(widths):.2f} mNm, its shift "
        f"{1e3 * np.mean(shifts):.1f} mNm, so that F_rs = {force.min():.0f} … {force.max():.0f} N "
        f"(F_0 = {spring_force(p):.0f} N) and μ_b = {coefficient:.5f}"
    )


def loop_curve(path: AnglePath, file: str) -> ExperimentCurve:
    """T_m1 over α_m1, as Figs. 9 and 10."""
    rows = path.counts

    def model(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        torque = np.where(rows, path.expected(p, own), np.nan)
        return path.motion[:, 0], torque

    labels = ("α_m1, rad", "T_m1, Nm")
    return ExperimentCurve(file, labels, path.measured, model, path.left_out)


I6 = BenchExperiment(
    "I6",
    "μ_b and the reset spring's preload, from a slow loop of the motor's angle without the pack",
    ("ball_ramp_friction", "spring_preload"),
    ("no-pack",),
    SIGNALS,
    reduce,
)
