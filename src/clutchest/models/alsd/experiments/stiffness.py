"""I7: stiffness, free play and backlash from current ramps with the pack, and with the ball ramp's
output fixed.

The slopes of T_m1 over α_m1 are k(1 ± ρ) with ρ = K_br μ_b d/2 where bristles are bent all the way;
while it is loaded the ball ramp's bristle lags behind its growing level, so that the mean of both
slopes is not k.  So its Dahl friction is followed along the path.
"""

from __future__ import annotations

import numpy as np

from clutchest.models.alsd.experiments.ball_ramp_loop import loop_curve
from clutchest.models.alsd.experiments.path_torque import AnglePath
from clutchest.models.experiments import (
    BenchExperiment,
    BenchRecord,
    EquationErrors,
    Parameters,
)

SIGNALS = ("motor_angle", "armature_current", "armature_temp")
COMPRESSED = 0.4  # of the largest torque: the upper part of a branch, whose slope is taken
LEAST = 0.15  # Nm of motor torque
FEWEST = 5  # readings of a branch, of which more give a slope


def reduce(record: BenchRecord) -> EquationErrors | str:
    """T_m1 along the path of the motor, loading and unloading."""
    path = AnglePath.of(record)
    if path is None or not path.counts.any():
        return "the motor does not turn evenly"
    most = float(np.nanmax(np.abs(path.measured(record.parameters, path.own[:, 0])[1])))
    if most < LEAST:
        return f"the torque reaches {most:.2f} Nm, less than {LEAST:g} Nm"
    file = "compression.png" if record.bench == "rig" else "compression_fixed.png"
    return EquationErrors(
        path.errors,
        path.own,
        lambda p: (slopes(path, p, record.bench),),
        (loop_curve(path, file),),
    )


def slopes(path: AnglePath, p: Parameters, bench: str) -> str:
    """Slopes of both branches as the paper reads them, in words; where one has too few readings,
    without what both would tell."""
    angle, torque = path.measured(p, path.own[:, 0])
    speed = path.motion[path.counts, 1]
    found = {}
    for name, way in (("loading", 1), ("unloading", -1)):
        rows = (speed * way > 0) & (torque > COMPRESSED * torque.max())
        if rows.sum() > FEWEST:
            found[name] = float(np.polyfit(angle[rows], torque[rows], 1)[0])
    each = " and ".join(f"{1e3 * slope:.1f} mNm/rad {name}" for name, slope in found.items())
    if len(found) < 2:
        return f"{bench}: slope {each or 'of neither branch: too few readings'}"
    k, rho = np.mean([*found.values()]), np.ptp([*found.values()]) / sum(found.values())
    return f"{bench}: slopes {each}, k = {1e3 * k:.1f} mNm/rad with ρ = {rho:.2f}"


I7 = BenchExperiment(
    "I7",
    "c_1, c_cl.e, x_fp, α_b1 and μ_b, from current ramps with the pack and with the output fixed",
    (
        "ball_ramp_stiffness",
        "pack_stiffness",
        "free_play",
        "gear_backlash",
        "ball_ramp_friction",
    ),
    ("rig", "output-fixed"),
    SIGNALS,
    reduce,
)
