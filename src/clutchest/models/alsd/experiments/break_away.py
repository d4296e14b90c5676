"""The pre-sliding curve of the motor's friction, from a current that rises slowly at rest.

Slowly, bristles bend by (4) with g = T_S: the angle is −T_S/σ_0 ln(1 − T/T_S), where T is the
motor's torque less what damping, viscous friction and inertia take at that rate of bending.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchest.models.alsd.experiments.motion import mean_about, window_means
from clutchest.models.alsd.experiments.torque_constant import torque_constant
from clutchest.models.experiments import BenchRecord, ExperimentCurve, Parameters
from clutchest.signals import Floats

LONGEST, SHORTEST = 2.5, 0.4  # s that a rise lasts
SLOW = 0.8  # of a rise, from its begin until the motor slides: bends further are no longer slow
GRID, SMOOTHED = 0.02, 0.04  # s
CREEPS = 2.0  # rad/s: slower, the motor counts as at rest
UNEVEN = 1.3  # times the noise that a straight rise of the current may miss
STARTS = 0.35  # of the current at break-away, from which the rise is followed at most
ROUNDS = 3  # in which a rate of bending and what it takes of the torque agree
FEWEST = 20  # readings of a rise
NEAR = 0.95  # of T_S; beyond it the curve goes on straight


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
        most, stiffness = p["motor_static_torque"], p["motor_bristle_stiffness"]
        size = np.abs(torque)
        for _ in range(ROUNDS):
            speed = abs(rate) / (stiffness * (1 - np.minimum(size / most, NEAR)))
            lost = p["motor_bristle_damping"] * abs(rate) / stiffness + p["motor_viscous"] * speed
            lost += p["motor_inertia"] * speed**2 * stiffness / most
            size = np.maximum(np.abs(torque) - lost, 0.0)
        share = np.minimum(size / most, NEAR)
        beyond = np.maximum(size / most - NEAR, 0.0) / (1 - NEAR)
        bend = -np.log1p(-share) + beyond
        return np.asarray(np.sign(torque) * bend * most / stiffness)

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
    zero = np.abs(amps) < 3 * noise("armature_current", int(SMOOTHED / GRID) + 1)
    if not zero.any():
        return None
    begin = edges[int(np.flatnonzero(zero)[-1])] + SMOOTHED
    # an end that the angle itself decided would leave out readings by their noise
    end = begin + SLOW * (sliding - begin)
    of_angle, of_current = (slice(*np.searchsorted(s.time, (begin, end))) for s in (angle, current))
    if of_angle.stop - of_angle.start < FEWEST:
        return None
    at_rest = np.median(angle.value[of_angle][:10])
    time, value = current.time[of_current], current.value[of_current]
    if len(time) < FEWEST or time[-1] - time[0] < SHORTEST:
        return None
    (slope, level), left, *_ = np.polyfit(time - time[-1], value, 1, full=True)
    uneven = np.sqrt(left[0] / len(time)) > UNEVEN * record.noise["armature_current"]
    if uneven or abs(level - slope * (time[-1] - time[0])) > STARTS * abs(level):
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
