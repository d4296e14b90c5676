"""I1: R_a(ϑ_a) = u_a/i_a, from constant voltages at standstill."""

from __future__ import annotations

import numpy as np

from clutchest.models.alsd.experiments.plateaus import means, plateaus
from clutchest.models.experiments import (
    NO_OWN,
    BenchExperiment,
    BenchRecord,
    EquationErrors,
    ExperimentCurve,
    Parameters,
)
from clutchest.signals import Floats

SETTLE, LEAST = 0.05, 0.2  # s
SMALLEST = 0.5  # A: a quotient by less is noise
SIGNALS = ("armature_voltage", "armature_current", "armature_temp")


def resistance(p: Parameters, temperature: Floats) -> Floats:
    """R_a(ϑ_a), Ω."""
    warmer = temperature - p["armature_reference_temp"]
    return p["armature_resistance"] * (1 + p["resistance_temp_coefficient"] * warmer)


def resistance_slope(p: Parameters) -> float:
    """dR_a/dϑ_a, Ω/K."""
    return p["armature_resistance"] * p["resistance_temp_coefficient"]


def reduce(record: BenchRecord) -> EquationErrors | str:
    """u_a − R_a(ϑ_a) i_a of every plateau."""
    spans = plateaus(record, SIGNALS[:2], SETTLE, LEAST)
    (u, du), (i, di), (temp, dt) = means(record, SIGNALS, spans)
    keep = np.abs(i) > SMALLEST
    if not keep.any():
        return "it has no constant voltage that lasts 0.2 s and makes more than 0.5 A"
    u, i, temp = u[keep], i[keep], temp[keep]
    p = record.parameters
    known = resistance(p, temp)
    std = np.hypot(du[keep], np.hypot(known * di[keep], resistance_slope(p) * i * dt[keep]))

    def errors(p: Parameters, own: Floats) -> Floats:
        return np.asarray((u - resistance(p, temp) * i) / std)

    def curve(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        line = np.linspace(temp.min(), temp.max(), 50)
        return line, resistance(p, line)

    quotient = u / i
    words = (
        f"R_a = u_a/i_a at {len(u)} plateaus, {quotient.min():.4f} … {quotient.max():.4f} Ω "
        f"at {temp.min():.0f} … {temp.max():.0f} °C"
    )
    picture = ExperimentCurve(
        "resistance.png", ("ϑ_a, °C", "R_a, Ω"), lambda p, own: (temp, quotient), curve
    )
    return EquationErrors(errors, NO_OWN, lambda p: (words,), (picture,))


I1 = BenchExperiment(
    "I1",
    "R_a and its temperature coefficient, from constant voltages at standstill",
    ("armature_resistance", "resistance_temp_coefficient"),
    ("rotor-held",),
    SIGNALS,
    reduce,
)
