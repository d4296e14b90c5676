"""What may be wrong with a differential and stands in no library, with formulas of their own.

Nothing of the package is imported here, so that nothing of the model can leak into it.  Each class
says which ``equations`` it falsifies, by which signal it is driven (``drivers``, the first of which
is the cause, others being the same thing under another name), and the ``scenarios`` in which it
shows.  ``size`` is at least 0, in ``unit``; beyond ``largest`` no differential would do it.
``phase`` (0…1) is chance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, pi, sin
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Seen = Mapping[str, float]
Law = Callable[[Seen], Mapping[str, float]]
Readings = Mapping[str, Callable[[Floats], Floats]]

SLICE = 0.002  # s between two calls of a law


@dataclass(frozen=True)
class Outsider:
    """One cause of a given ``size``; sees and acts as the generator describes."""

    size: float
    phase: float = 0.5
    name: ClassVar[str]
    equations: ClassVar[tuple[str, ...]]
    drivers: ClassVar[tuple[str, ...]]
    scenarios: ClassVar[tuple[str, ...]]
    unit: ClassVar[str]
    largest: ClassVar[float]

    def law(self) -> Law | None:
        return None

    def readings(self, true: Readings) -> Readings:
        return true


class FluidFilm(Outsider):
    """Oil between plates that do not touch yet is sheared: the narrower the gap, the more."""

    name, equations, drivers = "fluid_film", ("torque",), ("slip_speed", "gap", "oil_temp")
    scenarios, unit, largest = ("coast", "slip-oil-sweep"), "Nm per 10 rad/s at 0.1 mm", 40.0

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            gap = max(seen["free_play"] - seen["plate"], 0.0)
            thick = 0.2 + gap / 1e-4
            return {"film": self.size * seen["slip_speed"] / 10.0 / thick * (gap > 0.0)}

        return act


class TwoZones(Outsider):
    """The oil leaves the pack slowly once the plates touch: there the plate is damped more."""

    name, equations = "two_zones", ("axial_force",)
    drivers = ("motor_speed", "pack_force", "motor_angle")  # a damping's error goes with speed
    scenarios, unit, largest = ("rig-steps", "rig-ramps", "car"), "1", 6.0

    def law(self) -> Law:
        return lambda seen: {"damping": self.size * (seen["plate"] > seen["free_play"])}


class Cogging(Outsider):
    """The armature's slots: a torque that goes with its angle, seven times a turn."""

    name, equations, drivers = "cogging", ("motor",), ("motor_angle", "motor_angle_in_turn")
    scenarios, unit, largest = ("rig-ramps", "rig-slow"), "Nm", 0.03

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            return {"load": self.size * sin(7.0 * seen["motor_angle"] + 2.0 * pi * self.phase)}

        return act


class CreepingHome(Outsider):
    """The stop on which the actuator rests settles: home lies further in from minute to minute."""

    name, equations = "creeping_home", ("sensor:motor_angle", "axial_force", "motor")
    drivers, scenarios = ("time", "motor_angle"), ("rig-steps", "coast")
    unit, largest = "rad at the ball ramp", 0.03

    def law(self) -> Law:
        return lambda seen: {"home": self.size * (1.0 - exp(-seen["time"] / 25.0))}


class FoldingBack(Outsider):
    """The power stage folds back: above a current it delivers less voltage than it reports."""

    name, equations, drivers = "folding_back", ("current",), ("current", "motor_torque")
    scenarios, unit, largest = ("rig-ramps", "rig-steps", "car"), "V per A", 0.5

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            over = max(abs(seen["current"]) - 6.0, 0.0)
            return {"voltage": self.size * over * (1.0 if seen["current"] > 0.0 else -1.0)}

        return act


class SharedSupply(Outsider):
    """Another consumer on the same cable takes a part of the voltage while it is switched on."""

    name, equations, drivers = "shared_supply", ("current",), ("time",)
    scenarios, unit, largest = ("rig-steps", "car", "rig-ramps"), "V", 1.0

    def law(self) -> Law:
        begin = 12.0 + 10.0 * self.phase

        def act(seen: Seen) -> dict[str, float]:
            on = begin < seen["time"] < begin + 18.0 and abs(seen["current"]) > 0.5
            return {"voltage": self.size * on * (1.0 if seen["current"] > 0.0 else -1.0)}

        return act


class LongRest(Outsider):
    """Surfaces that have rested hold more: friction is higher after a rest, and slips down."""

    name, equations, drivers = (
        "long_rest",
        ("torque",),
        ("time", "pressed_time", "energy", "pack_force"),
    )
    scenarios, unit, largest = ("rig-steps", "slip-oil-sweep"), "1", 0.4

    def law(self) -> Law:
        rested, slipped = 5.0, 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal rested, slipped
            if seen["pack_force"] > 0.0:
                slipped += SLICE
            elif slipped > 0.0:
                rested, slipped = 0.0, 0.0
            else:
                rested += SLICE
            return {"friction": self.size * (1.0 - exp(-rested)) * exp(-slipped / 0.3)}

        return act


class EccentricPack(Outsider):
    """One plate sits out of the middle: friction goes up and down once per turn of slip."""

    name, equations, drivers = "eccentric_pack", ("torque",), ("slip_speed", "time")
    scenarios, unit, largest = ("slip-oil-sweep", "rig-steps", "car"), "1", 0.2

    def law(self) -> Law:
        angle = 2.0 * pi * self.phase

        def act(seen: Seen) -> dict[str, float]:
            nonlocal angle
            angle += SLICE * seen["slip_speed"]
            return {"friction": self.size * sin(angle)}

        return act


OUTSIDERS: Mapping[str, type[Outsider]] = {
    each.name: each
    for each in (
        FluidFilm,
        TwoZones,
        Cogging,
        CreepingHome,
        FoldingBack,
        SharedSupply,
        LongRest,
        EccentricPack,
    )
}
