"""I5: J_1 and T_f1(ω_m1) from starting and stopping runs, σ_0 and T_S from a break-away.

K_t i_a − T_f1 = J_1 dω_I/dt while it starts, −T_f1 = J_1 dω_II/dt while it stops; speeds are
polynomials of fourth order in time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import chdtri

from clutchest.models.alsd.experiments.break_away import break_aways
from clutchest.models.alsd.experiments.motion import Polynomial, mean_about
from clutchest.models.alsd.experiments.plateaus import plateaus
from clutchest.models.alsd.experiments.torque_constant import torque_constant
from clutchest.models.experiments import (
    BenchExperiment,
    BenchRecord,
    EquationErrors,
    ExperimentCurve,
    Parameters,
)
from clutchest.signals import Floats

SIGNALS = ("motor_angle", "armature_current", "armature_temp")
# s; sooner after a step of the current, bristles still bend and no polynomial follows the speed
SETTLE, LEAST, LONGEST = 0.04, 0.08, 0.25
ORDER = 5  # of the angle's polynomial, 4 of the speed's
NODES = np.cos(np.pi * (np.arange(4) + 0.5) / 4)  # as many as the acceleration has coefficients
FAST = 5.0  # Stribeck speeds: beyond, friction is Coulomb's and viscous
BY_CHANCE = 1e-4  # of runs whose current is as even as a parabola that seem not to be
LIMITED = 5.0  # standard deviations below the supply voltage


@dataclass(frozen=True, slots=True)
class FrictionRun:
    """Speed and acceleration at the nodes (4,) of a run, current there and temperature; the
    accelerations' covariance and the variance of the currents."""

    speed: Floats
    acceleration: Floats
    current: Floats
    temp: float
    covariance: Floats
    of_current: Floats

    def white_errors(self, p: Parameters) -> Floats:
        """The errors, independent and of variance 1 at these parameters: by the variance at fixed
        ones, noise of the accelerations would make the inertia the smaller."""
        inertia = p["motor_inertia"] / torque_constant(p, np.array(self.temp))
        root = np.linalg.cholesky(inertia**2 * self.covariance + self.of_current)
        return np.asarray(np.linalg.solve(root, self.errors(p)))

    def friction(self, p: Parameters) -> Floats:
        """K_t i_a − J_1 dω_m1/dt, Nm, which T_f1 must be."""
        torque = torque_constant(p, np.array(self.temp)) * self.current
        return np.asarray(torque - p["motor_inertia"] * self.acceleration)

    def errors(self, p: Parameters) -> Floats:
        """i_a − (T_f1(ω_m1) + J_1 dω_m1/dt)/K_t, A: torques would be the smaller, the smaller all
        parameters are."""
        off = self.friction(p) - friction(p, self.speed)
        return np.asarray(off / torque_constant(p, np.array(self.temp)))


def friction(p: Parameters, speed: Floats) -> Floats:
    """T_f1(ω_m1) of bristles that are bent all the way, (5) and (6)."""
    over = p["motor_static_torque"] - p["motor_coulomb_torque"]
    ratio = np.abs(speed / p["motor_stribeck_speed"]) ** p["motor_stribeck_exponent"]
    level = p["motor_coulomb_torque"] + over * np.exp(-ratio)
    return np.asarray(np.sign(speed) * level + p["motor_viscous"] * speed)


def reduce(record: BenchRecord) -> EquationErrors | str:
    """Torque errors of all runs, and of the pre-sliding curves of all break-aways."""
    found, slips = list(runs(record)), break_aways(record)
    if not found and not slips:
        nothing = "no run at constant current that lasts 0.08 s, and no slow break-away"
        return "; ".join((nothing, *_left_out(record)))
    own = np.concatenate([np.zeros((0, 2)), *(slip.own for slip in slips)])
    cuts = np.cumsum([len(slip.own) for slip in slips])[:-1]

    def errors(p: Parameters, own: Floats) -> Floats:
        parts = [run.white_errors(p) for run in found]
        parts += [s.errors(p, o) for s, o in zip(slips, np.split(own, cuts), strict=False)]
        return np.concatenate(parts)

    curves = [*_torque_speed(found), *(s.curve for s in slips[:1])]
    starting = sum(bool(np.mean(run.speed * run.acceleration) > 0) for run in found)
    words = f"{starting} starting and {len(found) - starting} other runs, {len(slips)} break-aways"
    said = (words, *_left_out(record))
    return EquationErrors(errors, own, lambda p: said, tuple(curves))


def runs(record: BenchRecord) -> Iterator[FrictionRun]:
    """Every stretch of constant current in which the motor turns one way, fast."""
    angle, current, temp = (record.signals[name] for name in SIGNALS)
    slowest = FAST * record.parameters["motor_stribeck_speed"]
    for start, end in plateaus(record, SIGNALS[1:2], SETTLE, LEAST):
        if not _even(record, start, end):
            continue
        pieces = int(np.ceil((end - start) / LONGEST))
        edges = np.linspace(start, end, pieces + 1)
        for a, b in pairwise(edges):
            few = np.ptp(np.searchsorted(angle.time, (a, b))) < 2 * ORDER
            if few or _at_the_limit(record, a, b):
                continue
            fit = Polynomial.through(angle, a, b, ORDER)
            nodes = fit.middle + fit.reach * NODES
            speed, _ = fit.derivative(nodes, 1)
            ends, _ = fit.derivative(np.array([a, b]), 1)
            if min(np.abs(speed).min(), np.abs(ends).min()) < slowest or np.ptp(np.sign(speed)):
                continue
            acceleration, covariance = fit.derivative(nodes, 2)
            amps, of_current = Polynomial.through(current, a, b, 2).derivative(nodes, 0)
            yield FrictionRun(
                speed,
                acceleration,
                amps,
                mean_about(temp, fit.middle),
                record.noise[SIGNALS[0]] ** 2 * covariance,
                record.noise[SIGNALS[1]] ** 2 * of_current,
            )


def _even(record: BenchRecord, start: float, end: float) -> bool:
    """Whether the current changes no more than a parabola does: what goes up and down again, or
    falls from where the voltage is at its limit, gives an acceleration that no polynomial follows.
    """
    current = record.signals[SIGNALS[1]]
    rows = slice(*np.searchsorted(current.time, (start, end)))
    time, value = current.time[rows] - start, current.value[rows]
    freedom = len(time) - 3
    if freedom < 1:
        return False
    left = np.sum((value - np.polyval(np.polyfit(time, value, 2), time)) ** 2)
    return bool(left < chdtri(freedom, BY_CHANCE) * record.noise[SIGNALS[1]] ** 2)


def _left_out(record: BenchRecord) -> Iterator[str]:
    """In words, how many stretches are no runs since their current is not even."""
    stretches = list(plateaus(record, SIGNALS[1:2], SETTLE, LEAST))
    uneven = sum(not _even(record, start, end) for start, end in stretches)
    if uneven:
        yield (
            f"{uneven} of {len(stretches)} stretches between steps of the current are left out: it "
            f"changes by more than a parabola and its noise of {record.noise[SIGNALS[1]]:.3g} A "
            "make; `identify noise` measures that"
        )


def _at_the_limit(record: BenchRecord, start: float, end: float) -> bool:
    """Whether the voltage, where it is measured, is what the supply has, so that it no longer
    holds the current."""
    if record.lacks(("armature_voltage",)):
        return False
    within = record.between(start, end).signals["armature_voltage"].value
    most = record.parameters["supply_voltage"] - LIMITED * record.noise["armature_voltage"]
    return bool(np.any(np.abs(within) > most))


def _torque_speed(found: list[FrictionRun]) -> Iterator[ExperimentCurve]:
    """Torque over speed."""
    if not found:
        return
    speed = np.concatenate([run.speed for run in found])
    line = np.linspace(min(speed.min(), 0.0), max(speed.max(), 0.0), 400)
    yield ExperimentCurve(
        "friction.png",
        ("ω_m1, rad/s", "T_f1, Nm"),
        lambda p, own: (speed, np.concatenate([run.friction(p) for run in found])),
        lambda p, own: (line, friction(p, line)),
    )


I5 = BenchExperiment(
    "I5",
    "J_1, T_C, σ_2, σ_0, T_S and ω_str, from starting and stopping runs of the motor alone and "
    "its break-away",
    (
        "motor_inertia",
        "motor_coulomb_torque",
        "motor_viscous",
        "motor_bristle_stiffness",
        "motor_static_torque",
        "motor_stribeck_speed",
    ),
    ("motor-alone",),
    SIGNALS,
    reduce,
)
