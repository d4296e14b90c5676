"""I3: K_v = (u_a − R_a i_a)/ω_m1, from constant voltages at steady speed."""

from __future__ import annotations

import numpy as np

from clutchest.models.alsd.experiments.plateaus import LEVEL, means, plateaus, speed
from clutchest.models.alsd.experiments.resistance import resistance
from clutchest.models.experiments import (
    NO_OWN,
    BenchExperiment,
    BenchRecord,
    EquationErrors,
    ExperimentCurve,
    Parameters,
)
from clutchest.signals import Floats

SETTLE, LEAST = 0.4, 0.4  # s
SLOWEST = 10.0  # rad/s
SIGNALS = ("armature_voltage", "armature_current", "armature_temp", "motor_angle")


def reduce(record: BenchRecord) -> EquationErrors | str:
    """u_a − R_a(ϑ_a) i_a − K_v ω_m1 of every plateau at steady speed."""
    spans = [s for s in plateaus(record, SIGNALS[:1], SETTLE, LEAST) if _steady(record, *s)]
    if not spans:
        return "it has no constant voltage at which the motor turns steadily for 0.4 s"
    (u, du), (i, di), (temp, _) = means(record, SIGNALS[:3], spans)
    slopes = np.array([speed(record.signals["motor_angle"], *span) for span in spans])
    w, dw = slopes[:, 0], record.noise["motor_angle"] * slopes[:, 1]
    p = record.parameters
    std = np.hypot(du, np.hypot(resistance(p, temp) * di, p["back_emf_constant"] * dw))

    def errors(p: Parameters, own: Floats) -> Floats:
        return np.asarray((u - resistance(p, temp) * i - p["back_emf_constant"] * w) / std)

    def curve(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        line = np.linspace(w.min(), w.max(), 50)
        return line, p["back_emf_constant"] * line

    picture = ExperimentCurve(
        "voltage_constant.png",
        ("ω_m1, rad/s", "u_a − R_a i_a, V"),
        lambda p, own: (w, u - resistance(p, temp) * i),
        curve,
    )

    def figures(p: Parameters) -> tuple[str]:
        each = (u - resistance(p, temp) * i) / w
        return (f"K_v at {len(w)} speeds, {each.min():.5f} … {each.max():.5f} V s",)

    return EquationErrors(errors, NO_OWN, figures, (picture,))


def _steady(record: BenchRecord, start: float, end: float) -> bool:
    """Whether the motor turns, both halves of the span as fast."""
    angle, middle = record.signals["motor_angle"], (start + end) / 2
    if np.ptp(np.searchsorted(angle.time, (start, end))) < 8:
        return False
    (one, d_one), (two, d_two) = (speed(angle, *half) for half in ((start, middle), (middle, end)))
    noise = record.noise["motor_angle"] * float(np.hypot(d_one, d_two))
    return abs(two) > SLOWEST and abs(two - one) < LEVEL * noise + 1e-3 * abs(two)


I3 = BenchExperiment(
    "I3",
    "K_v, from constant voltages with the motor alone, at steady speed",
    ("back_emf_constant",),
    ("motor-alone",),
    SIGNALS,
    reduce,
)
