"""What the truck meets: slow random walks, coolant, ambient; and a random stream per purpose."""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from clutchest.generator.recursion import recur
from clutchest.signals import Floats

GEARBOX_TEMP = 80.0  # °C
GRID = 0.1  # s between points of the slow quantities, linear in between


@dataclass(frozen=True)
class Disturbances:
    """What wanders: ``torque_bias_walk`` Nm/√s from a start of ``torque_bias_std`` Nm;
    ``friction_walk`` 1/√s from a start of 1 ± ``friction_std``; standard deviations."""

    torque_bias_walk: float = 0.0
    torque_bias_std: float = 0.0
    friction_walk: float = 0.0
    friction_std: float = 0.0


@dataclass(frozen=True)
class Surroundings:
    """Columns on a grid of GRID s: friction multiplier, torque bias Nm, coolant and ambient °C."""

    time: Floats
    friction: Floats
    torque_bias: Floats
    coolant: Floats
    ambient: Floats


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Random numbers for one purpose only: more of another purpose never shifts them."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(crc32(purpose.encode()),)))


def surroundings(seed: int, duration: float, disturbances: Disturbances,
                 friction_change: float = 0.0, bias: float = 0.0) -> Surroundings:  # fmt: skip
    """Draw what the truck meets in ``duration`` s; the two effects move the walks' level."""
    n = int(np.ceil(duration / GRID)) + 2
    friction = 1 + _walk(seed, "friction", n, disturbances.friction_std, disturbances.friction_walk)
    walk = _walk(seed, "torque bias", n, disturbances.torque_bias_std,
                 disturbances.torque_bias_walk)  # fmt: skip
    weather = stream(seed, "weather")
    coolant = weather.uniform(81.0, 88.0) + _wander(weather, n, std=1.5, time_constant=200.0)
    ambient = weather.uniform(2.0, 26.0) + _wander(weather, n, std=0.7, time_constant=900.0)
    time = np.arange(n, dtype=np.float64) * GRID
    level = np.clip(friction, 0.2, 3.0) * (1 + friction_change)
    return Surroundings(time, level, walk + bias, coolant, ambient)


def _walk(seed: int, purpose: str, n: int, start: float, walk: float) -> Floats:
    draws = stream(seed, purpose).standard_normal(n)
    return np.cumsum(draws * np.r_[start, np.full(n - 1, walk * np.sqrt(GRID))])


def _wander(rng: np.random.Generator, n: int, std: float, time_constant: float) -> Floats:
    """A stationary second-order wander: smooth, as a thermostat's temperature is."""
    keep = np.exp(-GRID / time_constant)
    settle = int(5 * time_constant / GRID)
    noise = rng.standard_normal(settle + n)
    smooth = recur(recur(noise, keep), keep)[settle:]
    variance = (1 + keep**2) / (1 - keep**2) ** 3  # of white noise through both
    return smooth * (std / np.sqrt(variance))
