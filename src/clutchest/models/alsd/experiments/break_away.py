"""The pre-sliding curve of the motor's friction, from a current that rises slowly at rest.

The angle follows from (3) to (6) under a torque that rises evenly from zero, the motor at rest and
its bristles straight: slowly, it is near −T_S/σ_0 ln(1 − T/T_S).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

import numpy as np

from clutchest.models.alsd.experiments.motion import mean_about, window_means
from clutchest.models.alsd.experiments.torque_constant import torque_constant
from clutchest.models.experiments import BenchRecord, ExperimentCurve, Parameters
from clutchest.native import compiled
from clutchest.signals import Floats, Signal

MOTOR = (  # what its numbers are called
    "motor_inertia",
    "motor_coulomb_torque",
    "motor_static_torque",
    "motor_stribeck_speed",
    "motor_stribeck_exponent",
    "motor_bristle_stiffness",
    "motor_bristle_damping",
    "motor_viscous",
)
_NUMBERS = np.dtype([(key, np.float64) for key in MOTOR])

LONGEST, SHORTEST = 2.5, 0.4  # s that a rise lasts
SLOW = 0.8  # of a rise, from its begin until the motor slides: bends further are no longer slow
GRID, SMOOTHED = 0.02, 0.04  # s
CREEPS = 2.0  # rad/s: slower, the motor counts as at rest
UNEVEN = 1.3  # times the noise that a straight rise of the current may miss
STARTS = 0.35  # of the current at break-away, from which the rise is followed at most
ZERO, CLEAR = 3.0, 6.0  # standard deviations of a mean that may be zero, and of one that is not
FEWEST = 20  # readings of a rise
STEP = 1e-3  # s of the integration: a bristle that rings turns by a tenth of a radian
FOLLOWED = 5.0  # s at most


@compiled
def _rates(z, w, torque, p):  # type: ignore[no-untyped-def]
    """Rates of the bristle, rad/s, and of the speed, rad/s², (3) to (6)."""
    over = p.motor_static_torque - p.motor_coulomb_torque
    slow = exp(-(abs(w / p.motor_stribeck_speed) ** p.motor_stribeck_exponent))
    level = p.motor_coulomb_torque + over * slow
    bends = w - p.motor_bristle_stiffness * abs(w) * z / level
    friction = p.motor_bristle_stiffness * z + p.motor_bristle_damping * bends
    return bends, (torque - friction - p.motor_viscous * w) / p.motor_inertia


@compiled
def _risen(rate, step, p, creeps, angle):  # type: ignore[no-untyped-def]
    """The angle, rad, into ``angle`` (n), ``step`` s apart, under a torque that rises by ``rate``
    Nm/s from zero, by Runge and Kutta; a motor faster than it ``creeps``, rad/s, stays as fast."""
    z, w, x, half = 0.0, 0.0, 0.0, step / 2.0
    for i in range(len(angle)):
        angle[i] = x
        if w > creeps:
            x += step * creeps
            continue
        torque, between = rate * step * i, rate * step * (i + 0.5)
        z1, w1 = _rates(z, w, torque, p)
        z2, w2 = _rates(z + half * z1, w + half * w1, between, p)
        z3, w3 = _rates(z + half * z2, w + half * w2, between, p)
        z4, w4 = _rates(z + step * z3, w + step * w3, torque + rate * step, p)
        x += step * (w + step / 6.0 * (w1 + w2 + w3))
        z += step / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
        w += step / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4)


@dataclass(frozen=True, slots=True)
class BreakAway:
    """Angles and currents of one rise, each at its times; standard deviations of both, and the
    temperature.

    Own numbers: the angle at rest, and the current's value at the end and slope.
    """

    angle_time: Floats
    angle: Floats
    current_time: Floats
    current: Floats
    noise: tuple[float, float]
    temp: float
    own: Floats

    def bend(self, p: Parameters, torque: Floats, rate: float) -> Floats:
        """The angle, rad, that a torque (Nm) which rises at a ``rate`` (Nm/s) bends the bristles
        by."""
        lasts = min(float(np.abs(torque).max()) / abs(rate), FOLLOWED)
        time = np.linspace(0.0, lasts, int(np.ceil(lasts / STEP)) + 1)
        angle = np.empty(len(time))
        numbers = np.array([tuple(p[key] for key in MOTOR)], _NUMBERS)
        _risen(abs(rate), lasts / (len(time) - 1), numbers[0], CREEPS, angle)
        return np.asarray(np.sign(torque) * np.interp(np.abs(torque / rate), time, angle))

    def torque(self, p: Parameters, own: Floats, time: Floats) -> Floats:
        """K_t i_a, Nm, of a current that rises evenly."""
        amps = own[1] + own[2] * (time - self.current_time[-1])
        return np.asarray(torque_constant(p, np.array(self.temp)) * amps)

    def errors(self, p: Parameters, own: Floats) -> Floats:
        """Of angles and of currents."""
        per_amp = float(torque_constant(p, np.array(self.temp)))
        bend = self.bend(p, self.torque(p, own, self.angle_time), per_amp * float(own[2]))
        amps = own[1] + own[2] * (self.current_time - self.current_time[-1])
        of_angle = (self.angle - own[0] - bend) / self.noise[0]
        return np.concatenate([of_angle, (self.current - amps) / self.noise[1]])

    @property
    def curve(self) -> ExperimentCurve:
        """Torque over angle, measured by the even rise of the current."""

        def points(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
            return self.angle - own[0], self.torque(p, own, self.angle_time)

        def model(p: Parameters, own: Floats) -> tuple[Floats, Floats]:
            torque = self.torque(p, own, self.angle_time)
            rate = float(torque_constant(p, np.array(self.temp))) * float(own[2])
            return self.bend(p, torque, rate), torque

        return ExperimentCurve("break_away.png", ("α_m1, rad", "T_m1, Nm"), points, model)


def break_aways(record: BenchRecord) -> list[BreakAway]:
    """Every slow, even rise of the current from zero at rest that ends in sliding."""
    angle = record.signals["motor_angle"]
    edges = np.arange(angle.time[0], angle.time[-1], GRID)
    alpha, _ = window_means(angle, edges)
    moving = np.abs(np.diff(alpha, prepend=alpha[0])) > CREEPS * GRID
    begins = np.flatnonzero(np.diff(moving.astype(int)) == 1) + 1
    ends = np.flatnonzero(np.diff(moving.astype(int)) == -1) + 1
    found = []
    for k in begins:
        rest = max([0, *(int(e) for e in ends if e < k)])
        since = max(edges[rest], edges[k] - LONGEST)
        if edges[k] - since >= SHORTEST:
            found.append(_rise(record, since, edges[k] + GRID))
    return [rise for rise in found if rise is not None]


def _rise(record: BenchRecord, since: float, sliding: float) -> BreakAway | None:
    """The rise of the current before ``sliding`` s, at rest ``since`` then; None where it does not
    rise evenly."""
    angle, current = record.signals["motor_angle"], record.signals["armature_current"]
    noise = record.std_of_mean
    edges = np.arange(since, sliding, SMOOTHED)
    amps, _ = window_means(current, edges)
    if len(amps) < 4 or not np.isfinite(amps).all():
        return None
    still = noise("armature_current", int(SMOOTHED / GRID) + 1)
    zero = np.abs(amps) < ZERO * still
    if not zero.any():
        return None
    begin = edges[int(np.flatnonzero(zero)[-1])] + SMOOTHED
    # an end that the angle itself decided would leave out readings by their noise
    end = begin + SLOW * (sliding - begin)
    # noise kept the first windows from looking like zero, so that they are too large on average:
    # by those the rise would be too flat, and the bristles too soft
    clear = _passes(current, begin, end, CLEAR * still)
    since = _passes(current, clear, end, ZERO * still)
    of_angle, of_current = (slice(*np.searchsorted(s.time, (since, end))) for s in (angle, current))
    if of_angle.stop - of_angle.start < FEWEST:
        return None
    at_rest = np.median(angle.value[of_angle][:10])
    time, value = current.time[of_current], current.value[of_current]
    if len(time) < FEWEST or time[-1] - time[0] < SHORTEST:
        return None
    (slope, level), left, *_ = np.polyfit(time - time[-1], value, 1, full=True)
    uneven = np.sqrt(left[0] / len(time)) > UNEVEN * record.noise["armature_current"]
    if uneven or abs(level - slope * (time[-1] - begin)) > STARTS * abs(level):
        return None
    temp = mean_about(record.signals["armature_temp"], float(time[-1]))
    spread = 10 * record.noise["armature_current"]
    return BreakAway(
        angle.time[of_angle],
        angle.value[of_angle],
        time,
        value,
        (noise("motor_angle", 1), noise("armature_current", 1)),
        temp,
        np.array([[at_rest, 0.05], [level, spread], [slope, spread]]),
    )


def _passes(current: Signal, start: float, end: float, amps: float) -> float:
    """When, s, the line through the readings in ``start`` … ``end`` passes that many A, either way
    from zero; at most SHORTEST before them."""
    rows = slice(*np.searchsorted(current.time, (start, end)))
    if rows.stop - rows.start < FEWEST:
        return start
    slope, level = np.polyfit(current.time[rows] - start, current.value[rows], 1)
    wait = (amps - level * np.sign(slope)) / max(abs(slope), amps / LONGEST)
    return start + float(np.clip(wait, -SHORTEST, end - start))
