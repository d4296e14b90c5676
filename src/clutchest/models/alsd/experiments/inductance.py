"""I2: L_a = T_a R_a, from the first-order lag of the current behind steps of the voltage."""

from __future__ import annotations

import numpy as np

from clutchest.models.alsd.experiments.plateaus import plateaus
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

SIGNALS = ("armature_voltage", "armature_current", "armature_temp")
LASTS = 20.0  # time constants: what is used of a step response
STEADY = 4.0  # standard deviations within which the voltage has arrived
SMALLEST = 10.0  # standard deviations of the current that must be left to decay


def reduce(record: BenchRecord) -> EquationErrors | str:
    """i_a − (i_∞ + A exp(−t R_a/L_a)) after every step, i_∞ and A by linear least squares."""
    p, spans = record.parameters, plateaus(record, SIGNALS[:1], 0.0, 0.01)
    lag = p["armature_inductance"] / p["armature_resistance"]
    steps = [step for span in spans if (step := _after(record, *span, LASTS * lag)) is not None]
    if not steps:
        apart = float(np.median(np.diff(record.signals["armature_current"].time)))
        return (
            "no step of the voltage leaves three samples of a decaying current: they lie "
            f"{1e3 * apart:.2g} ms apart, and it decays within some {1e3 * lag:.2g} ms; log it at "
            "10 kHz"
        )
    noise = record.noise["armature_current"]

    def errors(p: Parameters, own: Floats) -> Floats:
        return np.concatenate([_left(t, i, _lag(p, temp)) / noise for t, i, temp in steps])

    t, i, temp = max(steps, key=lambda step: float(np.ptp(step[1])))

    def curve(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        return 1e3 * t, i - _left(t, i, _lag(p, temp))

    picture = ExperimentCurve(
        "current_step.png", ("time, ms", "i_a, A"), lambda p, own: (1e3 * t, i), curve
    )
    words = f"{len(steps)} steps, {len(t)} samples within {1e3 * LASTS * lag:.2g} ms of one"
    return EquationErrors(errors, NO_OWN, lambda p: (words,), (picture,))


def _lag(p: Parameters, temperature: float) -> float:
    """T_a = L_a/R_a, s."""
    warmer = temperature - p["armature_reference_temp"]
    inductance = p["armature_inductance"] * (1 + p["inductance_temp_coefficient"] * warmer)
    return float(inductance / resistance(p, np.array(temperature)))


def _after(
    record: BenchRecord, start: float, end: float, lasts: float
) -> tuple[Floats, Floats, float] | None:
    """Times (k,), s, since the voltage has arrived, currents (k,) and the temperature, °C."""
    voltage, current, temp = (record.signals[name] for name in SIGNALS)
    rows = slice(*np.searchsorted(voltage.time, (start, end)))
    if rows.stop - rows.start < 3:
        return None
    level = np.median(voltage.value[rows])
    off = np.abs(voltage.value[rows] - level) > STEADY * record.noise[SIGNALS[0]]
    early = voltage.time[rows] < start + lasts
    arrived = voltage.time[rows][
        min(int(np.max(np.flatnonzero(off & early), initial=-1)) + 1, rows.stop - rows.start - 1)
    ]
    of = slice(*np.searchsorted(current.time, (arrived, min(arrived + lasts, end)), "right"))
    t, i = current.time[of] - arrived, current.value[of]
    if len(t) < 3 or abs(i[0] - i[-1]) < SMALLEST * record.noise[SIGNALS[1]]:
        return None
    return t, i, float(temp.at(np.array([arrived]))[0])


def _left(t: Floats, i: Floats, lag: float) -> Floats:
    """What a constant and an exponential leave of the current."""
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(t)), np.exp(-t / lag)]))
    return np.asarray(i - basis @ (basis.T @ i))


I2 = BenchExperiment(
    "I2",
    "L_a, from steps of the voltage at standstill",
    ("armature_inductance",),
    ("rotor-held",),
    SIGNALS,
    reduce,
)
