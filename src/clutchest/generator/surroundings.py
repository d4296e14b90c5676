"""What the truck meets: slow random walks, coolant, ambient; and a random stream per purpose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from zlib import crc32

import numpy as np

from clutchest.checked import check
from clutchest.errors import ClutchestError, nearest
from clutchest.recursion import recur
from clutchest.signals import Floats

GEARBOX_TEMP = 80.0  # °C
GRID = 0.1  # s between points of the slow quantities, linear in between
WARM_UP = 300.0  # s, time constant at which the coolant of a cold engine reaches its thermostat's


@dataclass(frozen=True)
class Disturbances:
    """What varies at random: ``torque_bias_walk`` Nm/√s from a start of ``torque_bias_std`` Nm;
    ``friction_walk`` 1/√s from a start of 1 ± ``friction_std``; standard deviations."""

    torque_bias_walk: float = 0.0
    torque_bias_std: float = 0.0
    friction_walk: float = 0.0
    friction_std: float = 0.0

    @classmethod
    def of(cls, given: Mapping[str, float]) -> Disturbances:
        """From name → value.  Raises ClutchestError for an unknown name or a size that cannot
        be."""
        for name, value in given.items():
            if name not in LARGEST:
                raise ClutchestError(f"unknown disturbance '{name}'" + nearest(name, LARGEST))
            check(f"disturbance '{name}'", value, float)
            if not 0 <= value <= LARGEST[name]:
                raise ClutchestError(
                    f"disturbance '{name}' = {value:g}: expected 0 to {LARGEST[name]:g}"
                )
        return cls(**given)

    def sizes(self) -> dict[str, float]:
        """Name → value."""
        return asdict(self)


# Beyond these the friction runs into its clip, or the bias exceeds what an engine reports.
LARGEST: Mapping[str, float] = MappingProxyType(
    {
        "torque_bias_walk": 50.0,
        "torque_bias_std": 500.0,
        "friction_walk": 0.02,
        "friction_std": 0.2,
    }
)


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


def surroundings(
    seed: int,
    duration: float,
    disturbances: Disturbances,
    friction_change: float = 0.0,
    bias: float = 0.0,
    cold: bool = False,
) -> Surroundings:
    """Draw what the truck meets in ``duration`` s; the two effects move the walks' level.  The
    coolant of a ``cold`` engine starts at the air's temperature."""
    n = int(np.ceil(duration / GRID)) + 2
    friction = 1 + _walk(seed, "friction", n, disturbances.friction_std, disturbances.friction_walk)
    walk = _walk(
        seed, "torque bias", n, disturbances.torque_bias_std, disturbances.torque_bias_walk
    )
    weather = stream(seed, "weather")
    coolant = weather.uniform(81.0, 88.0) + _wander(weather, n, std=1.5, time_constant=200.0)
    ambient = weather.uniform(2.0, 26.0) + _wander(weather, n, std=0.7, time_constant=900.0)
    time = np.arange(n, dtype=np.float64) * GRID
    if cold:
        coolant = coolant + (ambient[0] - coolant) * np.exp(-time / WARM_UP)
    level = np.clip(friction, 0.2, 3.0) * (1 + friction_change)
    return Surroundings(time, level, walk + bias, coolant, ambient)


def _walk(seed: int, purpose: str, n: int, start: float, walk: float) -> Floats:
    draws = stream(seed, purpose).standard_normal(n)
    return np.cumsum(draws * np.r_[start, np.full(n - 1, walk * np.sqrt(GRID))])


def _wander(rng: np.random.Generator, n: int, std: float, time_constant: float) -> Floats:
    """A stationary second-order random process: smooth, as a thermostat's temperature is."""
    keep = np.exp(-GRID / time_constant)
    settle = int(5 * time_constant / GRID)
    noise = rng.standard_normal(settle + n)
    smooth = recur(recur(noise, keep), keep)[settle:]
    variance = (1 + keep**2) / (1 - keep**2) ** 3  # of white noise through both
    return smooth * (std / np.sqrt(variance))
