"""A third clutch, in the tests alone: what one takes to stand in the shared battery.

``plate.py`` is the machine as a user would write it, ``vehicle.toml`` names it and has its numbers;
here are the drive and the plausible ranges.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benches import Plausible, Setup
from clutchest.signals import Signal, Signals
from clutchest.vehicle import Vehicle

_HERE = Path(__file__).parent


def drive(vehicle: Vehicle, duration: float, noise: float) -> Signals:
    """A shaft that is driven now one way and now the other."""
    p = {key: value.value for key, value in vehicle.parameters.items()}
    t = np.arange(0.0, duration, 0.01)
    slip = 30.0 * np.sin(0.6 * t)
    torque = p["friction_torque"] * np.tanh(slip / p["sticking_speed"])
    torque = torque + p["inertia"] * np.gradient(slip, t)
    slip = slip + noise * vehicle.signals["slip_speed"].noise * np.random.default_rng(7).normal(
        size=len(t)
    )
    return Signals(
        {
            "slip_speed": Signal.of("slip_speed", "rad/s", t + 0.002, slip),
            "drive_torque": Signal.of("drive_torque", "Nm", t, torque),
            "air_temp": Signal.of("air_temp", "°C", t[::100], np.full(len(t[::100]), 20.0)),
        },
        end=duration,
    )


THIRD = Setup(
    _HERE / "vehicle.toml",
    drive,
    12.0,
    ("open",),
    Plausible(
        states={"slip_speed": (-100.0, 100.0), "temp": (-40.0, 300.0)},
        inputs={"drive_torque": (-100.0, 100.0), "air_temp": (-40.0, 50.0)},
        temperatures=("temp",),
        surroundings=("air_temp",),
        resting={"slip_speed": 0.0},
        warm={"temp": 90.0},
    ),
    {"fade": "slope 1/(100 K)"},
)
