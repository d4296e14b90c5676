"""I8: σ_0.c from the slope of T_m2 over α_m2 while the clutch is locked, times K_g2²."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, solve_banded

from clutchest.models.alsd.driveline import REVERSAL
from clutchest.models.alsd.experiments.motion import local_polynomial, polynomial_weights
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
WINDOW, ORDER = 5, 4  # samples that give speed and acceleration, by the polynomial through all
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
    noise = _noise(record, angle.time, np.flatnonzero(keep))

    def elastic(p: Parameters, own: Floats, a: Floats, side: Floats) -> Floats:
        ratio = p["final_drive_ratio"]
        z = a / ratio - own[0] - side * p["differential_backlash"]
        return np.asarray(p["torsional_stiffness"] * z / ratio)

    def errors(p: Parameters, own: Floats) -> Floats:
        rest = t2 - p["driveline_friction"] * way - p["structure_inertia"] * dw
        return noise.whitened(rest - elastic(p, own, a, side), p)

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
    return EquationErrors(errors, own, lambda p: (words,), (picture,))


@dataclass(frozen=True, slots=True)
class EquationNoise:
    """Noise of the equations at the samples ``rows`` (n), ascending: variance ``of_torque``, Nm²,
    of the torque sensor and ``of_angle``, rad², which an equation takes with the ``weights``
    (n, 2, WINDOW) of value and second derivative about its sample.

    Neighbours share readings of the angle: taken for independent, their accelerations would seem to
    say less of what changes slowly.  And the variance is that of the parameters themselves: by a
    fixed one, noise of the acceleration would make the inertia the smaller.
    """

    rows: NDArray[np.intp]
    of_torque: float
    of_angle: float
    weights: Floats

    def whitened(self, errors: Floats, p: Parameters) -> Floats:
        """``errors`` (n), Nm, independent of each other and of variance 1."""
        ratio = p["final_drive_ratio"]
        takes = np.array([p["torsional_stiffness"] / ratio**2, p["structure_inertia"]])
        per_angle = np.einsum("j,njk->nk", takes, self.weights)
        bands = np.zeros((WINDOW, len(errors)))
        bands[0] = self.of_torque
        for later in range(min(WINDOW, len(errors))):
            off = self.rows[later:] - self.rows[: len(self.rows) - later]
            for shift in range(later, WINDOW):
                both = per_angle[: len(off), shift:] * per_angle[later:, : WINDOW - shift]
                bands[later, : len(off)] += self.of_angle * (off == shift) * both.sum(axis=1)
        root = cholesky_banded(bands, lower=True)
        return np.asarray(solve_banded((WINDOW - 1, 0), root, errors))


def _noise(record: BenchRecord, time: Floats, rows: NDArray[np.intp]) -> EquationNoise:
    torque, angle = (record.noise[name] for name in SIGNALS)
    weights = polynomial_weights(time, WINDOW, ORDER)[rows][:, [0, 2]]
    return EquationNoise(rows, torque**2, angle**2, weights)


I8 = BenchExperiment(
    "I8",
    "σ_0.c, the differential's play and T_f2, from a sinusoidal servo torque on a locked clutch",
    ("torsional_stiffness", "differential_backlash", "driveline_friction"),
    ("rig",),
    SIGNALS,
    reduce,
)
