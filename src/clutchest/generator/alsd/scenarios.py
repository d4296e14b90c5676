"""What the rig or the road does: each scenario is a profile of requests, drawn by the seed.

Requests are ramped over 15 ms: a step, sampled at 200 Hz, would leave any model with a misfit of
the sampling.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from math import pi
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.generator.alsd.plant import (
    ANGLE,
    COMPLETE,
    FAST,
    MOTOR_ALONE,
    NO_PACK,
    OUTPUT_FIXED,
    PROFILE,
    ROTOR_HELD,
    SAMPLED,
    STEP,
    TORQUE,
    VOLTAGE,
    WHEELS,
)
from clutchest.signals import Floats

RAMP = 0.015  # s
RPM = pi / 30
Random = np.random.Generator
Points = list[tuple[float, float]]  # (time s, value), straight in between


@dataclass(frozen=True)
class ActuatorScenario:
    """``name``, ``what`` it shows, its default ``duration`` s, and what makes its profile; ``fast``
    steps of the plant between two rows, a multiple of SAMPLED."""

    name: str
    what: str
    duration: float
    make: Callable[[Random, Floats, NDArray], None]  # (rng, time, profile to fill)
    fast: int = FAST

    @property
    def row(self) -> float:
        """s between rows."""
        return self.fast * STEP

    def profile(self, rng: Random, duration: float) -> NDArray:
        """The profile (K) over ``duration`` s, one row every ``row`` s."""
        time = np.arange(round(duration / self.row) + 1, dtype=np.float64) * self.row
        profile = np.zeros(len(time), PROFILE)
        profile["oil"] = rng.uniform(25.0, 60.0)
        self.make(rng, time, profile)
        return profile


def _pulses(pulses: list[tuple[float, float, float]]) -> Points:
    """Points of requests (start s, end s, height), ramped at both ends."""
    points: Points = [(0.0, 0.0)]
    for start, end, height in pulses:
        points += [(start, 0.0), (start + RAMP, height), (end, height), (end + RAMP, 0.0)]
    return points


def _along(time: Floats, points: Points) -> Floats:
    t, value = zip(*points, strict=True)
    return np.interp(time, t, value)


def _rig_steps(rng: Random, time: Floats, c: NDArray) -> None:
    """A1 over and over: 12, 7 and 2.5 A, and heights in between, at 25 rpm."""
    c["driven"] = 25 * RPM
    pulses, t, k = [], 0.6, 0
    while t < time[-1]:
        height = (12.0, 7.0, 2.5)[k] if k < 3 else rng.uniform(2.5, 13.0)
        lasts = rng.uniform(0.7, 1.2)
        pulses.append((t, t + lasts, height))
        t, k = t + lasts + rng.uniform(0.9, 1.4), k + 1
    c["asked"] = _along(time, _pulses(pulses))


def _rig_slow(rng: Random, time: Floats, c: NDArray) -> None:
    """A4 over and over: 12 A at 0.5 rpm."""
    c["driven"] = 0.5 * RPM
    starts = np.arange(0.5, max(time[-1], 1.0), 4.4)
    c["asked"] = _along(time, _pulses([(t, t + 2.6, 12.0) for t in starts]))


def _rig_ramps(rng: Random, time: Floats, c: NDArray) -> None:
    """A5: up to 20 A and back at 1, 5, 10, 15 and 20 A/s, the clutch turning slowly."""
    c["driven"] = 2 * RPM
    points: Points = [(0.0, 0.0)]
    t, k = 1.0, 0
    while t < time[-1]:
        lasts = 20.0 / (20.0, 15.0, 10.0, 5.0, 1.0)[k % 5]
        points += [(t, 0.0), (t + lasts, 20.0), (t + 2 * lasts, 0.0)]
        t, k = t + 2 * lasts + 1.5, k + 1
    c["asked"] = _along(time, points)


def _slip_oil_sweep(rng: Random, time: Floats, c: NDArray) -> None:
    """Slip from 0.5 to 120 rpm and back, while the oil goes from −20 to 120 °C and back, more
    slowly; the clutch pressed over and over."""
    sweep, warming = 2 * time / 20.0 % 2.0, 2 * time / max(time[-1], 1.0)
    c["driven"] = 0.5 * RPM * 240.0 ** (1.0 - np.abs(1.0 - sweep))
    c["oil"] = np.interp(1.0 - np.abs(1.0 - warming), (0.0, 1.0), (-20.0, 120.0))
    starts = np.arange(0.5, max(time[-1], 1.0), 2.2)
    c["asked"] = _along(time, _pulses([(t, t + 1.2, rng.uniform(2.5, 9.0)) for t in starts]))


def _coast(rng: Random, time: Floats, c: NDArray) -> None:
    """Drag: the clutch is open while the slip goes from 0 to 120 rpm and back, both ways round, and
    the oil warms up; it is pressed once every 20 s."""
    phase = 2 * time / 15.0
    sign = np.where(phase // 2.0 % 2.0 < 1.0, 1.0, -1.0)
    c["driven"] = sign * RPM * (120.0 * (1.0 - np.abs(1.0 - phase % 2.0)))
    c["oil"] = np.interp(time, (0.0, max(time[-1], 1.0)), (10.0, 90.0))
    starts = np.arange(3.0, max(time[-1], 3.1), 20.0)
    c["asked"] = _along(time, _pulses([(t, t + 1.0, rng.uniform(2.5, 9.0)) for t in starts]))


def _car(rng: Random, time: Floats, c: NDArray) -> None:
    """Corners and split friction: wheel speeds differ, the clutch is asked to lock them."""
    c["drive"], c["oil"] = WHEELS, 60.0 + 15.0 * (1 - np.exp(-time / 900.0))
    pulses: list[tuple[float, float, float]] = []
    slips, speeds = [(0.0, 0.0)], [(0.0, 0.0), (3.0, 25.0)]
    t = 3.0
    while t < time[-1]:
        lasts = rng.uniform(1.2, 4.0)
        slip = rng.choice((-1.0, 1.0)) * rng.uniform(0.5, 6.0)
        slips += [
            (t, 0.0),
            (t + 0.5, slip),
            (t + lasts, slip * rng.uniform(0.3, 1.0)),
            (t + lasts + 0.4, 0.0),
        ]
        speeds.append((t + lasts, rng.uniform(15.0, 90.0)))
        begins = t + rng.uniform(0.1, 0.6)
        pulses.append((begins, max(t + lasts - 0.1, begins + 0.5), rng.uniform(2.0, 11.0)))
        t += lasts + rng.uniform(1.5, 4.0)
    c["asked"] = _along(time, _pulses(pulses))
    c["driven"], c["mean_wheel"] = _along(time, slips), _along(time, speeds)


def _resistance(rng: Random, time: Floats, c: NDArray) -> None:
    """I1: constant voltages at standstill, while the whole rig warms up."""
    c["bench"], c["actuator"] = ROTOR_HELD, VOLTAGE
    c["oil"] = np.interp(time, (20.0, time[-1] - 20.0), (5.0, 115.0))
    level = np.array([0.8, -0.8, 1.6, -1.6, 2.4, -2.4])
    c["asked"] = level[(time // 2.0).astype(int) % len(level)]


def _inductance(rng: Random, time: Floats, c: NDArray) -> None:
    """I2: voltage steps at standstill."""
    c["bench"], c["actuator"] = ROTOR_HELD, VOLTAGE
    c["asked"] = np.where(time % 0.5 < 0.25, 0.0, 2.0 + 2.0 * (time // 0.5 % 3))


def _voltage_constant(rng: Random, time: Floats, c: NDArray) -> None:
    """I3: constant voltages, the motor alone."""
    c["bench"], c["actuator"] = MOTOR_ALONE, VOLTAGE
    level = np.array([3.0, 6.0, 9.0, 12.0, -3.0, -6.0, -9.0, -12.0])
    c["asked"] = level[(time // 2.0).astype(int) % len(level)]


def _torque_constant(rng: Random, time: Floats, c: NDArray) -> None:
    """I4: currents at standstill with a torque sensor at the motor, while the rig warms up."""
    c["bench"], c["oil"] = ROTOR_HELD, np.interp(time, (20.0, time[-1] - 20.0), (5.0, 115.0))
    level = np.array([2.0, -2.0, 5.0, -5.0, 8.0, -8.0])
    c["asked"] = level[(time // 2.0).astype(int) % len(level)]


def _inertia(rng: Random, time: Floats, c: NDArray) -> None:
    """I5: starting and stopping runs of the motor alone, then break-away under a slow ramp."""
    c["bench"] = MOTOR_ALONE
    runs = []
    for k, start in enumerate(np.arange(1.0, max(0.7 * time[-1], 2.0), 2.0)):
        runs.append((start, start + 0.25 + 0.1 * (k % 3), 1.0 + 0.5 * (k % 3)))
    asked = _along(time, _pulses(runs))
    late = time > 0.75 * time[-1]
    slow = np.abs((time - 0.75 * time[-1]) % 4.0 - 2.0)  # down from 2 s to 0 and up again
    c["asked"] = np.where(late, 0.3 * (2.0 - slow), asked)


def _ball_ramp(rng: Random, time: Floats, c: NDArray) -> None:
    """I6: pack removed, the motor's position ramped up and down."""
    c["bench"], c["actuator"] = NO_PACK, ANGLE
    speed, reach = 4.0, 30.0  # rad/s and rad
    phase = np.maximum(time - 1.0, 0.0) % (2 * reach / speed + 2.0)
    up, down = np.minimum(speed * phase, reach), reach - speed * (phase - reach / speed - 1.0)
    c["asked"] = np.maximum(np.minimum(up, down), 0.0)


def _stiffness(rng: Random, time: Floats, c: NDArray) -> None:
    """I7: current ramps with the pack; in the second half the ball-ramp output is held fixed.

    Of 15 A/s: at a quarter of it, the motor turns so slowly that it sticks and slips.
    """
    half = time > time[-1] / 2
    c["bench"] = np.where(half, OUTPUT_FIXED, COMPLETE)
    phase = (time % (time[-1] / 2) - 1.0) % 3.3
    ramps = np.maximum(15.0 * np.minimum(phase, 2.4 - phase), 0.0)
    since = time % (time[-1] / 2) - 1.0
    c["asked"] = np.where((since > 0.0) & (since < 9.9), ramps, 0.0)


def _torsion(rng: Random, time: Floats, c: NDArray) -> None:
    """I8: the clutch locked by 15 A, the servo torque a slow sine."""
    c["drive"] = TORQUE
    c["asked"] = np.interp(time, (0.2, 0.5), (0.0, 15.0))
    c["driven"] = 250.0 * np.sin(2 * pi * 0.5 * np.maximum(time - 1.0, 0.0))


SCENARIOS: Mapping[str, ActuatorScenario] = MappingProxyType(
    {
        s.name: s
        for s in (
            ActuatorScenario("rig-steps", "current steps at 25 rpm (A1)", 60.0, _rig_steps),
            ActuatorScenario("rig-slow", "12 A at 0.5 rpm (A4)", 18.0, _rig_slow),
            ActuatorScenario("rig-ramps", "current ramps (A5)", 62.0, _rig_ramps),
            ActuatorScenario(
                "slip-oil-sweep", "slip 0.5 to 120 rpm, oil −20 to 120 °C", 120.0, _slip_oil_sweep
            ),
            ActuatorScenario("coast", "drag with the clutch open", 60.0, _coast),
            ActuatorScenario("car", "corners and split friction on the road", 120.0, _car),
            ActuatorScenario("I1", "resistance over temperature", 600.0, _resistance),
            ActuatorScenario("I2", "inductance", 6.0, _inductance, SAMPLED),
            ActuatorScenario("I3", "voltage constant", 32.0, _voltage_constant),
            ActuatorScenario("I4", "torque constant over temperature", 600.0, _torque_constant),
            ActuatorScenario("I5", "inertia and friction of the motor", 32.0, _inertia),
            ActuatorScenario("I6", "ball-ramp friction, preload", 36.0, _ball_ramp),
            ActuatorScenario("I7", "stiffness, free play, backlash", 22.0, _stiffness),
            ActuatorScenario("I8", "torsional stiffness", 9.0, _torsion),
        )
    }
)
ON_THE_ROAD = frozenset({"car"})  # all others are for the rig


def scenarios_with(signals: Container[str]) -> dict[str, ActuatorScenario]:
    """Those of the place, car or rig, where a vehicle has these signals."""
    wheels = "wheel_speed_left" in signals
    return {name: plan for name, plan in SCENARIOS.items() if wheels == (name in ON_THE_ROAD)}
