"""Causes by drivers that no list of a model's errors has, and what every near miss declares.

As of ``outsiders``, nothing of the package is imported here.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from blind.outsiders import Floats, Law, Outsider, Readings, Seen

NEAR = 0.1  # s, on both sides, over which a truck speeds up
CLOSE = 0.05  # s, from one step of what fades to the next
LATE = 20.0  # s, over which a hub settles and a coil cools


class NearMiss(Outsider):
    """One that resembles an effect, or one whose place no list has (``listed`` False)."""

    others: ClassVar[tuple[str, ...]] = ()
    listed: ClassVar[bool] = True

    @classmethod
    def equations(cls) -> tuple[str, ...]:
        return (cls.equation, *cls.others)


class OilSurge(NearMiss):
    """Oil surges to the crank as the truck speeds up, and away from it as it brakes."""

    name, equation, drivers = "oil_surge", "engine_speed", ("vehicle_acceleration",)
    others = ("sensor:engine_torque",)  # listed since it was missed
    unit, largest = "Nm", 120.0

    def law(self) -> Law:
        least = 0.3 + 0.6 * self.phase
        speed = before = rate = 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal speed, before, rate
            since = max(seen["time"] - before, 1e-3)
            now, before = (seen["vehicle_speed"] - speed) / since, seen["time"]
            rate += (now - rate) * min(since / NEAR, 1.0)
            speed = seen["vehicle_speed"]
            return {"engine_load": self.size * float(np.tanh(rate / least))}

        return act


class TiltedGearbox(NearMiss):
    """The gearbox tilts on its mounts as it drives or brakes the truck, and the position sensor
    with it."""

    name, equation, drivers = "tilted_gearbox", "sensor:slave_position", ("vehicle_acceleration",)
    others = ("zero_position",)  # listed since it was missed
    unit, largest = "mm", 0.8

    def readings(self, true: Readings) -> Readings:
        least = 0.3 + 0.6 * self.phase

        def position(t: Floats) -> Floats:
            speed = true["vehicle_speed"]
            rate = (speed(t + NEAR) - speed(np.maximum(t - NEAR, 0.0))) / (2.0 * NEAR)
            return true["slave_position"](t) + self.size * np.tanh(rate / least)

        return {**true, "slave_position": position}


class GlazedPatch(NearMiss):
    """A patch of the lining is glazed: torque swings once with every turn of the disc against the
    flywheel."""

    name, equation, drivers = "glazed_patch", "torque", ("slip_angle", "slip_speed")
    others = ("sensor:engine_speed", "engine_speed")  # listed since it was missed
    unit, largest = "1", 0.4
    pace: ClassVar[float] = 0.005  # s

    def law(self) -> Law:
        angle, before = 2.0 * np.pi * self.phase, 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal angle, before
            angle += seen["slip_speed"] * (seen["time"] - before)
            before = seen["time"]
            return {"torque_share": self.size * float(np.sin(angle))}

        return act


class HelicalThrust(NearMiss):
    """Helical gears push the input shaft along by the torque they carry, and with it what the
    position is read from."""

    name, equation, drivers = "helical_thrust", "sensor:slave_position", ("engine_torque",)
    others = ("zero_position",)  # listed since it was missed
    unit, largest = "mm", 0.6

    def readings(self, true: Readings) -> Readings:
        play = 200.0 + 400.0 * self.phase

        def position(t: Floats) -> Floats:
            pushed = np.tanh(true["engine_torque"](t) / play)
            return true["slave_position"](t) + self.size * pushed

        return {**true, "slave_position": position}


class CreepingHose(NearMiss):
    """A hose swells slowly while the clutch is held: the position reads what it was of late."""

    name, equation, drivers = (
        "creeping_hose",
        "sensor:slave_position",
        ("recent_movement", "slave_position"),
    )
    others = ("zero_position",)  # listed since it was missed
    unit, largest = "1", 0.2

    def readings(self, true: Readings) -> Readings:
        fades = 10.0 + 20.0 * self.phase

        def position(t: Floats) -> Floats:
            steps = np.arange(0.0, np.max(t, initial=0.0) + CLOSE, CLOSE)
            kept = np.exp(-CLOSE / fades)
            held = true["slave_position"](steps)
            recent, _ = lfilter([1.0 - kept], [1.0, -kept], held, zi=[kept * held[0]])
            of_late = np.interp(t, steps, recent)
            return true["slave_position"](t) + self.size * (of_late - true["slave_position"](t))

        return {**true, "slave_position": position}


class TurboLag(NearMiss):
    """Boost builds up more slowly than fuel, which is what the report is of: it is ahead of the
    torque as that grows, and right as it falls."""

    name, equation, drivers = "turbo_lag", "sensor:engine_torque", ("engine_torque_rate",)
    others = ("timing:engine_torque",)  # listed since it was missed
    unit, largest = "s", 0.8

    def readings(self, true: Readings) -> Readings:
        most = 100.0 + 200.0 * self.phase  # Nm

        def torque(t: Floats) -> Floats:
            right = true["engine_torque"]
            rate = (right(t + CLOSE) - right(np.maximum(t - CLOSE, 0.0))) / (2.0 * CLOSE)
            return right(t) + np.clip(self.size * rate, 0.0, most)

        return {**true, "engine_torque": torque}


class BentShaft(NearMiss):
    """Every pair of gears bends the input shaft in its own way, and tilts the disc: friction is
    another one in every gear."""

    name, equation, drivers = "bent_shaft", "torque", ("gear",)
    listed = False
    unit, largest = "1", 0.6

    def law(self) -> Law:
        ratio, knee = 50.0, 10.0 + 20.0 * self.phase  # rad/m

        def act(seen: Seen) -> dict[str, float]:
            nonlocal ratio
            if seen["vehicle_speed"] > 1.0:
                ratio = abs(seen["input_shaft_speed"]) / seen["vehicle_speed"]
            return {"torque_share": -self.size * float(np.exp(-ratio / knee))}

        return act


class SettledHub(NearMiss):
    """The hub sticks on its splines where the torque that it carried of late has pressed it."""

    name, equation, drivers = "settled_hub", "zero_position", ("recent_torque",)
    others, listed = ("sensor:slave_position",), False
    unit, largest = "mm", 0.8

    def law(self) -> Law:
        least = 200.0 + 400.0 * self.phase  # Nm
        recent = before = 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal recent, before
            since, before = max(seen["time"] - before, 0.0), seen["time"]
            recent += (seen["clutch_torque"] - recent) * (1.0 - np.exp(-since / LATE))
            return {"zero_position": self.size * float(np.tanh(recent / least))}

        return act


class WarmedCoil(NearMiss):
    """The actuator's motor warms the coil of the position sensor beside it: it reads high after
    much travel."""

    name, equation, drivers = "warmed_coil", "sensor:slave_position", ("recent_travel",)
    others, listed = ("zero_position",), False
    unit, largest = "mm", 0.8

    def readings(self, true: Readings) -> Readings:
        least = 0.5 + 1.0 * self.phase  # mm/s

        def position(t: Floats) -> Floats:
            steps = np.arange(0.0, np.max(t, initial=0.0) + CLOSE, CLOSE)
            kept = np.exp(-CLOSE / LATE)
            travel = np.abs(np.gradient(true["slave_position"](steps), CLOSE))
            warmth = lfilter([1.0 - kept], [1.0, -kept], travel)
            high = self.size * np.tanh(warmth / least)
            return true["slave_position"](t) + np.interp(t, steps, high)

        return {**true, "slave_position": position}
