"""Motor torque along a measured path of the motor's angle: (3) to (10) solved for T_m1.

Motion is given, so that neither stick-slip nor a current that runs away matters: bristles are
followed along the path, and the plate is where its forces balance.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, pi

import numpy as np

from clutchest.models.alsd.experiments.armature_heat import ArmatureHeat
from clutchest.models.alsd.experiments.break_away import MOTOR
from clutchest.models.alsd.experiments.motion import (
    local_polynomial,
    second_derivative_std,
    window_means,
)
from clutchest.models.alsd.experiments.torque_constant import torque_constant
from clutchest.models.experiments import BenchRecord, Parameters
from clutchest.native import compiled
from clutchest.signals import Floats

KEYS = (
    *MOTOR,
    "gear_ratio",
    "gear_backlash",
    "ball_ramp_ratio",
    "ball_ramp_stiffness",
    "ball_ramp_friction",
    "ball_ramp_bore",
    "ball_ramp_bristle_stiffness",
    "limiter_stiffness",
    "spring_young",
    "spring_poisson",
    "spring_outer_diameter",
    "spring_inner_diameter",
    "spring_thickness",
    "spring_cone_height",
    "spring_preload",
    "free_play",
    "pack_stiffness",
    "axial_damping",
)
_NUMBERS = np.dtype([(key, np.float64) for key in KEYS])
RIG, NO_PACK, OUTPUT_FIXED = range(3)
BENCH_NUMBERS = {"rig": RIG, "no-pack": NO_PACK, "output-fixed": OUTPUT_FIXED}
FLOOR = 1e-5  # Nm
NEWTON, NARROW = 20, 1e-12  # steps, m
SUBSTEPS = 2

GRID = 0.01  # s, over which readings are averaged
WINDOW = 5  # means that give speed and acceleration
SLOWEST = 1.5  # Stribeck speeds: slower, the motor sticks and slips
QUIET = 30.0  # rad/s²: faster changes of the speed are not resolved
HELD = 1e-7  # m, within which a bench holds the output where the plate rests
TRAVELLED = 0.3  # rad since the motor turned back, to have its bristles bent the other way


@compiled
def spring(s, p):  # type: ignore[no-untyped-def]
    """Reset spring (10): force, N, and stiffness, N/m, at a displacement of ``s`` m."""
    ratio = p.spring_outer_diameter / p.spring_inner_diameter
    shape = ((ratio - 1.0) / ratio) ** 2 / ((ratio + 1.0) / (ratio - 1.0) - 2.0 / log(ratio)) / pi
    h, t = p.spring_cone_height, p.spring_thickness
    scale = 4.0 * p.spring_young / (1.0 - p.spring_poisson**2)
    scale *= t**3 / (shape * p.spring_outer_diameter**2)
    force = scale * s * ((h - s) * (h - s / 2.0) / t**2 + 1.0)
    return force, scale * ((h * h - 3.0 * h * s + 1.5 * s * s) / t**2 + 1.0)


@compiled
def _plate(d, angle, step, bench, p):  # type: ignore[no-untyped-def]
    """Where the plate's forces balance, m, ``step`` s after it was at ``d``: by Newton."""
    held, _ = spring(p.spring_preload, p)
    film = p.axial_damping / step if bench == RIG else 0.0
    before = d
    for _ in range(NEWTON):
        push, slope = spring(p.spring_preload + d, p)
        force, stiffness = -push - film * (d - before), slope + film
        twist = angle - p.ball_ramp_ratio * d - p.gear_backlash
        if twist > 0.0:
            force += p.ball_ramp_ratio * p.ball_ramp_stiffness * twist
            stiffness += p.ball_ramp_ratio**2 * p.ball_ramp_stiffness
        if held > p.limiter_stiffness * d:
            force += held - p.limiter_stiffness * d
            stiffness += p.limiter_stiffness
        if bench == RIG and d > p.free_play:
            force -= p.pack_stiffness * (d - p.free_play)
            stiffness += p.pack_stiffness
        change = force / stiffness
        d += change
        if abs(change) < NARROW:
            break
    return d


@compiled
def along(time, motion, bench, p, held, torque):  # type: ignore[no-untyped-def]
    """T_m1, Nm, into ``torque`` (n) at ``time`` (n) of the angle, speed and acceleration ``motion``
    (n, 3), from rest; in SUBSTEPS between them, straight.  An output that is fixed is ``held`` m
    from where the plate rests."""
    bristle, ramp, plate, before = 0.0, 0.0, 0.0, FLOOR
    for k in range(len(time)):
        last, friction, load = max(k - 1, 0), 0.0, 0.0
        way = (motion[k, 0] - motion[last, 0]) / SUBSTEPS
        step = max(time[k] - time[last], 1e-6) / SUBSTEPS
        sign = 1.0 if way > 0.0 else -1.0
        for i in range(SUBSTEPS):
            share = (i + 1.0) / SUBSTEPS
            w = motion[last, 1] + share * (motion[k, 1] - motion[last, 1])
            angle = motion[last, 0] + share * (motion[k, 0] - motion[last, 0])
            bristle, friction = _motor_friction(bristle, way, w, p)

            angle /= p.gear_ratio
            plate = held if bench == OUTPUT_FIXED else _plate(plate, angle, step, bench, p)
            twist = angle - p.ball_ramp_ratio * plate - p.gear_backlash
            load = p.ball_ramp_stiffness * max(twist, 0.0)
            most = p.ball_ramp_friction * p.ball_ramp_bore / 2.0 * p.ball_ramp_ratio * load
            most = max(most, FLOOR)
            if twist > 0.0:  # by the mean level on the way, which changes as the load does
                mean = sign * (most + before) / 2.0 / p.ball_ramp_bristle_stiffness
                ramp = mean + (ramp - mean) * exp(-way / p.gear_ratio / mean)
            before = most
            limit = most / p.ball_ramp_bristle_stiffness
            ramp = min(max(ramp, -limit), limit)
            if twist > 0.0:
                load += p.ball_ramp_bristle_stiffness * ramp
            load += p.ball_ramp_stiffness * min(angle + p.gear_backlash, 0.0)
        torque[k] = p.motor_inertia * motion[k, 2] + friction + load / p.gear_ratio


@compiled
def _motor_friction(bristle, way, w, p):  # type: ignore[no-untyped-def]
    """Bristle, rad, after a ``way`` of rad at a speed of ``w`` rad/s, and friction torque, Nm."""
    over = p.motor_static_torque - p.motor_coulomb_torque
    level = p.motor_coulomb_torque + over * exp(
        -(abs(w / p.motor_stribeck_speed) ** p.motor_stribeck_exponent)
    )
    stiffness = p.motor_bristle_stiffness
    bent = (1.0 if way > 0.0 else -1.0) * level / stiffness
    bristle = bent + (bristle - bent) * exp(-stiffness * abs(way) / level)
    slack = 1.0 - stiffness * bristle / level * (1.0 if w > 0.0 else -1.0)
    return bristle, stiffness * bristle + p.motor_bristle_damping * w * slack + p.motor_viscous * w


@dataclass(frozen=True, slots=True)
class AnglePath:
    """A record averaged over GRID s: ``time`` (n), ``motion`` (n, 3), means of current and, where
    it is measured, torque (n,) with their standard deviations; the armature's ``heat``.

    ``counts`` (n): where the torque follows from the motion.  The little that the motor's
    ``inertia`` (kg m²) takes there is the file's: noise of the acceleration would pass for a
    smaller one.
    """

    bench: int
    time: Floats
    motion: Floats
    current: Floats
    torque: Floats | None
    std: tuple[float, float]
    heat: ArmatureHeat
    counts: np.ndarray
    inertia: float

    @classmethod
    def of(cls, record: BenchRecord) -> AnglePath | None:
        """None of a record that is too short."""
        angle, current = record.signals["motor_angle"], record.signals["armature_current"]
        begin, end = max(angle.time[0], current.time[0]), min(angle.time[-1], current.time[-1])
        edges = np.arange(begin, end, GRID)
        alpha, count = window_means(angle, edges)
        if len(alpha) < WINDOW:
            return None
        time, p = (edges[:-1] + edges[1:]) / 2, record.parameters
        alpha = np.where(count > 0, alpha, angle.at(time))
        motion = local_polynomial(time, alpha, WINDOW, 2)
        motion[:, 0] = alpha
        amps, of_current = window_means(current, edges)
        of_angle = p["motor_inertia"] * second_derivative_std(GRID, WINDOW, 2)
        of_angle *= record.std_of_mean("motor_angle", int(np.median(count)))
        in_amps = of_angle / p["torque_constant"]
        std = record.std_of_mean("armature_current", int(np.median(of_current)))
        measured, torque_std = None, 0.0
        if not record.lacks(("motor_torque",)):
            measured, of_torque = window_means(record.signals["motor_torque"], edges)
            torque_std = record.std_of_mean("motor_torque", int(np.median(of_torque)))
        follows = _follows(motion, SLOWEST * p["motor_stribeck_speed"])
        return cls(
            BENCH_NUMBERS[record.bench],
            time,
            motion,
            amps,
            measured,
            (float(np.hypot(std, in_amps)), float(np.hypot(torque_std, of_angle))),
            ArmatureHeat.of(record, time, amps),
            follows & np.isfinite(amps) & (count > 0),
            p["motor_inertia"],
        )

    @property
    def own(self) -> Floats:
        """The armature's temperature at the start, °C; where the output is held, m from rest."""
        held = np.array([[0.0, HELD]][: int(self.bench == OUTPUT_FIXED)]).reshape(-1, 2)
        return np.concatenate([self.heat.own, held])

    def expected(self, p: Parameters, own: Floats) -> Floats:
        """T_m1 (n), Nm, that the motion takes."""
        known = {**p, "motor_inertia": self.inertia}
        numbers = np.array([tuple(known[key] for key in KEYS)], _NUMBERS)
        torque = np.empty(len(self.time))
        held = float(own[1]) if self.bench == OUTPUT_FIXED else 0.0
        along(self.time, self.motion, self.bench, numbers[0], held, torque)
        return torque

    def errors(self, p: Parameters, own: Floats) -> Floats:
        """Of current, temperature and, where it is measured, torque; ``own`` as it has them."""
        rows, torque, temp = self.counts, self.expected(p, own), self.heat.temperature(p, own)
        amps = torque[rows] / torque_constant(p, temp[rows])
        errors = [(self.current[rows] - amps) / self.std[0], self.heat.errors(temp)]
        if self.torque is not None:
            rows = rows & np.isfinite(self.torque)
            errors.append((self.torque[rows] - torque[rows]) / self.std[1])
        return np.concatenate(errors)

    def measured(self, p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        """(angle, rad, T_m1 = K_t i_a, Nm) wherever the torque follows from the motion."""
        return self._at(self.counts, p, own)

    def left_out(self, p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        """The same everywhere else."""
        return self._at(~self.counts, p, own)

    def _at(self, rows: np.ndarray, p: Parameters, own: Floats) -> tuple[Floats, Floats]:
        temp = self.heat.temperature(p, own)
        torque = torque_constant(p, temp[rows]) * self.current[rows]
        return self.motion[rows, 0], torque


def spring_force(p: Parameters) -> float:
    """F_0, N: the reset spring's at rest."""
    numbers = np.array([tuple(p[key] for key in KEYS)], _NUMBERS)
    return float(spring(p["spring_preload"], numbers[0])[0])


def _follows(motion: Floats, slowest: float) -> np.ndarray:
    """Where (n) the motor turns evenly, faster than ``slowest`` rad/s, and has turned one way for
    long enough."""
    angle, speed, acceleration = motion.T
    way = np.sign(np.where(np.abs(speed) > slowest, speed, 0.0))
    turned = np.flatnonzero(np.diff(way, prepend=0.0) != 0.0)
    since = np.zeros(len(angle), int)
    since[turned] = turned
    since = np.maximum.accumulate(since)
    settled = np.abs(angle - angle[since]) > TRAVELLED
    quiet = np.abs(acceleration) < QUIET
    near = np.convolve(~quiet, np.ones(WINDOW), "same") == 0
    return (way != 0) & settled & near
