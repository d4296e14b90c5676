"""I4: K_t(ϑ_a) = T_m1/i_a, from currents at standstill with a torque sensor."""

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
SMALLEST = 0.5  # A
SIGNALS = ("armature_current", "motor_torque", "armature_temp")


def torque_constant(p: Parameters, temperature: Floats) -> Floats:
    """K_t(ϑ_a), Nm/A."""
    warmer = temperature - p["armature_reference_temp"]
    return p["torque_constant"] * (1 + p["torque_constant_temp_coefficient"] * warmer)


def reduce(record: BenchRecord) -> EquationErrors | str:
    """T_m1 − K_t(ϑ_a) i_a of every plateau."""
    spans = plateaus(record, SIGNALS[:2], SETTLE, LEAST)
    (i, di), (torque, d_torque), (temp, dt) = means(record, SIGNALS, spans)
    keep = np.abs(i) > SMALLEST
    if not keep.any():
        return "it has no constant current above 0.5 A that lasts 0.2 s"
    i, torque, temp, p = i[keep], torque[keep], temp[keep], record.parameters
    slope = p["torque_constant"] * p["torque_constant_temp_coefficient"]
    of_current = torque_constant(p, temp) * di[keep]
    std = np.hypot(d_torque[keep], np.hypot(of_current, slope * i * dt[keep]))

    def errors(p: Parameters, own: Floats) -> Floats:
        return np.asarray((torque - torque_constant(p, temp) * i) / std)

    def curve(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        line = np.linspace(temp.min(), temp.max(), 50)
        return line, torque_constant(p, line)

    quotient = torque / i
    picture = ExperimentCurve(
        "torque_constant.png", ("ϑ_a, °C", "K_t, Nm/A"), lambda p, own: (temp, quotient), curve
    )
    words = (
        f"K_t = T_m1/i_a at {len(i)} plateaus, {quotient.min():.5f} … {quotient.max():.5f} Nm/A "
        f"at {temp.min():.0f} … {temp.max():.0f} °C"
    )
    return EquationErrors(errors, NO_OWN, lambda p: (words,), (picture,))


I4 = BenchExperiment(
    "I4",
    "K_t and its temperature coefficient, from currents at standstill with a torque sensor",
    ("torque_constant", "torque_constant_temp_coefficient"),
    ("rotor-held",),
    SIGNALS,
    reduce,
)
