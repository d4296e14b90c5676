"""A drive's signals replayed open loop by a truck of other numbers.

In a generated drive the driver and the control unit react to what the clutch does.  Whoever reads
the log sees what they did, and asks what a clutch of given numbers would have done under the same
signals.  So the plant is driven by the recorded ones: speeds, position, engine torque and
temperatures of the surroundings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from clutchest.generator.effects import Values, complete, numbers
from clutchest.generator.generate import SPACING, drive
from clutchest.generator.request import DriveRequest
from clutchest.signals import Floats

_EXACT = ("engine_speed", "input_shaft_speed", "vehicle_speed", "coolant_temp", "ambient_temp")
NONE: Values = MappingProxyType({})
STEADY: Mapping[str, Floats] = MappingProxyType({})
ABOUT = 0.35  # s before and after a time that is not locked; longer than signals may be late by
REST = 0.1  # s between rows amid a locked time
TEMPERATURES = ("temp_body", "temp_housing", "temp_disc")


@dataclass(frozen=True)
class Own:
    """What is a truck's own: ``parameters`` as the generator draws them, and at the ``start`` of a
    drive its temperatures in °C, ``zero_position`` in mm, ``friction`` and ``torque_bias`` in
    Nm."""

    parameters: Values
    start: Values

    def moved(self, by: Values) -> Own:
        """The same with numbers of either kind higher ``by`` so much."""
        parameters = {key: v + by.get(key, 0.0) for key, v in self.parameters.items()}
        return Own(parameters, {key: v + by.get(key, 0.0) for key, v in self.start.items()})


@dataclass(frozen=True)
class Recorded:
    """What exact sensors show at ``time`` (n,) s, every SPACING s while the clutch is not locked
    and about then, more seldom else: ``signals`` name → (n,); ``locked`` (n,): the
    clutch is; ``retracted`` (n,): the actuator is, and has been for so long that every reading of
    the piston shows it."""

    time: Floats
    signals: Mapping[str, Floats]
    locked: NDArray[np.bool_]
    retracted: NDArray[np.bool_]

    def resting(self) -> Recorded:
        """The same coolant and air around a clutch that is left alone."""
        still, n = np.ones(len(self.locked), np.bool_), len(self.locked)
        moving = {"engine_speed", "input_shaft_speed", "vehicle_speed", "engine_torque"}
        quiet = {k: np.zeros(n) if k in moving else v for k, v in self.signals.items()}
        return replace(self, signals=quiet, locked=still, retracted=still)


@dataclass(frozen=True)
class Replayed:
    """What would have been, (n,) each: the change of the engine's ``speed`` in rad/s since the
    drive's start, locked times left out, the ``zero_position`` in mm that the sensor shows while
    the actuator is empty, and the clutch's ``torque`` in Nm."""

    speed: Floats
    zero_position: Floats
    torque: Floats


def record(request: DriveRequest) -> tuple[Recorded, Own]:
    """A generated drive as exact sensors show it, and the truck's own numbers in it; those of a
    truck without effects are the truck's own."""
    driven = drive(request)
    rows = _telling(driven.locked)
    time: Floats = SPACING * rows.astype(np.float64)
    locked = driven.locked[rows]
    signals = {name: shows(time) for name, shows in driven.shows.items()}
    columns = driven.truth.columns
    names = (*TEMPERATURES, "zero_position", "friction", "torque_bias")
    own = Own(driven.parameters, {name: float(columns[name][0]) for name in names})
    empty = locked & (signals["motor_position"] == 0.0)
    since = time - np.maximum.accumulate(np.where(empty, 0.0, time))
    return Recorded(time, signals, locked, empty & (since > ABOUT)), own


def _telling(locked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows that tell: all but those amid a locked time, in which only heat flows."""
    near = maximum_filter1d(~locked, 2 * round(ABOUT / SPACING) + 1)
    return np.flatnonzero(near | (np.arange(len(locked)) % round(REST / SPACING) == 0))


def replay(
    recorded: Recorded,
    own: Own,
    effects: Mapping[str, Values] | None = None,
    late: Values = NONE,
    walks: Mapping[str, Floats] = STEADY,
) -> Replayed:
    """What a truck with ``own`` numbers and ``effects`` would have done under the recorded signals,
    what its sensors get wrong taken back; ``late``: seconds that further signals are late by,
    ``walks`` (n,): how far the ``friction`` and the ``torque_bias`` wander.

    Raises ClutchestError for an unknown effect.
    """
    active = complete(effects or {})
    bias = own.start["torque_bias"] + walks.get("torque_bias", 0.0)
    offset = active["position_offset"]["offset"]
    behind = active["position_delay"]["delay"] + late.get("slave_position", 0.0)
    torque = _earlier(recorded, "engine_torque", active["torque_delay"]["delay"], late)
    torque = (torque - bias - active["torque_bias"]["bias"]) / (
        1.0 + active["torque_gain"]["change"]
    )
    walk = walks.get("friction", np.zeros(len(recorded.time)))
    out, inertia = _follow(recorded, own, active, late, np.empty((len(walk), 2)), walk)
    free = ~(recorded.locked[1:] | recorded.locked[:-1])
    driving = (torque - out[:, 0]) / inertia
    gained = np.where(free, 0.5 * np.diff(recorded.time) * (driving[1:] + driving[:-1]), 0.0)
    rest = np.interp(recorded.time - behind, recorded.time, out[:, 1]) if behind else out[:, 1]
    return Replayed(np.r_[0.0, np.cumsum(gained)], rest + offset, out[:, 0])


def slope(recorded: Recorded, own: Own) -> Floats:
    """The slope of the clutch torque over the position under the recorded signals, (n,) Nm/mm."""
    steady = np.zeros(len(recorded.time))
    return _follow(recorded, own, complete({}), NONE, np.empty((len(steady), 3)), steady)[0][:, 2]


def _follow(
    recorded: Recorded,
    own: Own,
    active: Mapping[str, Values],
    late: Values,
    out: Floats,
    walk: Floats,
) -> tuple[Floats, float]:
    """``out`` as ``plant.follow`` fills it, and the engine's inertia; the friction has a ``walk``
    (n,)."""
    from clutchest.generator import plant

    p = numbers(own.parameters, own.parameters, active, own.start["zero_position"], 1.0)
    place = _earlier(recorded, "slave_position", active["position_delay"]["delay"], late)
    place = place - p[0]["position_origin"] - active["position_offset"]["offset"]
    engine, shaft, speed, coolant, ambient = (recorded.signals[name] for name in _EXACT)
    level = 1.0 + active["friction_level"]["change"]
    friction = level * (own.start["friction"] + walk)
    locked = recorded.locked
    shown = np.column_stack((engine, shaft, speed, place, coolant, ambient, locked, friction))
    state, situation = np.zeros(plant.STATES), np.zeros(1, plant.SITUATION)
    state[[plant.BODY, plant.HOUSING, plant.DISC]] = [own.start[name] for name in TEMPERATURES]
    plant.follow(recorded.time, shown, state, situation[0], p[0], out)
    return out, float(p[0]["engine_inertia"])


def _earlier(recorded: Recorded, name: str, delay: float, late: Values) -> Floats:
    """A signal as it would be shown without its delays."""
    total = delay + late.get(name, 0.0)
    if not total:
        return recorded.signals[name]
    return np.interp(recorded.time + total, recorded.time, recorded.signals[name])
