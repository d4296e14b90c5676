"""Causes near an effect of the library and none of it, causes in equations or by drivers that no
list has, and two causes at once.

As of ``outsiders``, nothing of the package is imported here.  Where a cause may be located in more
than one equation, because it is the same thing under two names, ``others`` has the second.  Of two
at once, either counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from blind.outsiders import OUTSIDERS, Floats, Law, Outsider, Readings, Seen
from blind.unlisted import NearMiss

RADIATION = 5.67e-8  # W/(m² K⁴)
KELVIN = 273.15


# --- near an effect ------------------------------------------------------------------------------


class TanhStribeck(NearMiss):
    """Friction grows as slip ends, straight at first and with an end: not exponentially."""

    name, equation, drivers = "tanh_stribeck", "torque", ("slip_speed",)
    unit, largest = "1", 0.6

    def law(self) -> Law:
        knee = 10.0 + 20.0 * self.phase

        def act(seen: Seen) -> dict[str, float]:
            near = 1.0 - np.tanh(abs(seen["slip_speed"]) / knee)
            return {"torque_share": self.size * float(near)}

        return act


class BestWarm(NearMiss):
    """The lining grips best at one disc temperature: a parabola about it."""

    name, equation, drivers = "best_warm", "torque", ("temp_disc",)
    unit, largest = "1/(40 K)²", 0.4

    def law(self) -> Law:
        best = 85.0 + 20.0 * self.phase

        def act(seen: Seen) -> dict[str, float]:
            off = np.clip((seen["temp_disc"] - best) / 40.0, -1.5, 1.5)
            return {"torque_share": -self.size * float(off**2)}

        return act


class OneSidedReport(NearMiss):
    """The report is high where the engine drives, and right where it is driven."""

    name, equation, drivers = "one_sided_report", "sensor:engine_torque", ("engine_torque",)
    unit, largest = "1", 0.4

    def readings(self, true: Readings) -> Readings:
        def torque(t: Floats) -> Floats:
            right = true["engine_torque"](t)
            return right + self.size * np.maximum(right, 0.0)

        return {**true, "engine_torque": torque}


class SaturatingReport(NearMiss):
    """Above some 500 Nm the report falls behind the torque by a share of what is above."""

    name, equation, drivers = "saturating_report", "sensor:engine_torque", ("engine_torque",)
    unit, largest = "1", 0.8

    def readings(self, true: Readings) -> Readings:
        knee = 300.0 + 400.0 * self.phase

        def torque(t: Floats) -> Floats:
            right = true["engine_torque"](t)
            return right - self.size * np.maximum(right - knee, 0.0)

        return {**true, "engine_torque": torque}


class RadiatingDisc(NearMiss):
    """The disc radiates to the housing by the fourth power of the temperature; fins count."""

    name, equation, drivers = "radiating_disc", "disc_heat", ("temp_disc",)
    unit, largest = "m²", 8.0

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            hot, cold = (seen[name] + KELVIN for name in ("temp_disc", "temp_housing"))
            through = self.size * RADIATION * (hot**4 - cold**4)
            return {"disc_heat": -through, "housing_heat": through}

        return act


class BeddingIn(NearMiss):
    """New linings wear fast and ever more slowly: exponentially with slip energy."""

    name, equation, drivers = "bedding_in", "zero_position", ("energy",)
    unit, largest = "mm", 1.0

    def law(self) -> Law:
        scale = 1e5 + 3e5 * self.phase

        def act(seen: Seen) -> dict[str, float]:
            return {"zero_position": -self.size * float(1.0 - np.exp(-seen["energy"] / scale))}

        return act


# --- in no list ----------------------------------------------------------------------------------


class LateShaft(NearMiss):
    """The gearbox sends the input shaft's speed late."""

    name, equation, drivers = (
        "late_shaft",
        "timing:input_shaft_speed",
        ("input_shaft_speed", "input_shaft_rate"),
    )
    others = ("sensor:input_shaft_speed",)  # listed since it was missed
    unit, largest = "s", 0.4

    def readings(self, true: Readings) -> Readings:
        def speed(t: Floats) -> Floats:
            return true["input_shaft_speed"](np.maximum(t - self.size, 0.0))

        return {**true, "input_shaft_speed": speed}


class WeakToneWheel(NearMiss):
    """The shaft's tone wheel loses teeth where it turns slowly: its speed reads low there."""

    name, equation, drivers = (
        "weak_tone_wheel",
        "sensor:input_shaft_speed",
        ("input_shaft_speed",),
    )  # listed since the late one was missed
    unit, largest = "1", 0.5

    def readings(self, true: Readings) -> Readings:
        begin = 15.0 + 30.0 * self.phase

        def speed(t: Floats) -> Floats:
            right = true["input_shaft_speed"](t)
            return right * (1.0 - self.size * np.exp(-np.square(right / begin)))

        return {**true, "input_shaft_speed": speed}


class WrongTeeth(NearMiss):
    """The engine's speed is counted with a wrong number of teeth: it reads high in proportion."""

    name, equation, drivers = "wrong_teeth", "sensor:engine_speed", ("engine_speed",)
    others, listed = ("engine_speed",), False
    unit, largest = "1", 0.05

    def readings(self, true: Readings) -> Readings:
        def speed(t: Floats) -> Floats:
            return true["engine_speed"](t) * (1.0 + self.size)

        return {**true, "engine_speed": speed}


class FlashTemperature(NearMiss):
    """Friction falls with the power of slip: the surface is hot before any mass is."""

    name, equation, drivers = (
        "flash_temperature",
        "torque",
        ("slip_power", "slip_speed", "clutch_torque"),
    )
    # listed since it was missed
    unit, largest = "1 per 50 kW", 0.6

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            power = abs(seen["clutch_torque"] * seen["slip_speed"])
            return {"torque_share": -self.size * min(power / 50e3, 1.5)}

        return act


class FrictionalLag(NearMiss):
    """Friction lags behind slip: more while slip grows, less while it ends."""

    name, equation, drivers = "frictional_lag", "torque", ("slip_rate", "slip_speed")
    # listed since it was missed
    unit, largest = "1", 0.4

    def law(self) -> Law:
        last = before = 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal last, before
            since = max(seen["time"] - before, 1e-3)
            rate = (abs(seen["slip_speed"]) - last) / since
            last, before = abs(seen["slip_speed"]), seen["time"]
            return {"torque_share": self.size * float(np.tanh(rate / 40.0))}

        return act


class FloatingFingers(NearMiss):
    """The diaphragm's fingers fly outwards: the zero position moves with the engine's speed."""

    name, equation, drivers = "floating_fingers", "zero_position", ("engine_speed",)
    others, listed = ("sensor:slave_position",), False
    unit, largest = "mm per (100 rad/s)²", 0.5

    def law(self) -> Law:
        return lambda seen: {"zero_position": self.size * (seen["engine_speed"] / 100.0) ** 2}


class ShakenSensor(NearMiss):
    """The position sensor rectifies the engine's shaking about one resonance."""

    name, equation, drivers = "shaken_sensor", "sensor:slave_position", ("engine_speed",)
    others = ("zero_position",)  # listed since it was missed
    unit, largest = "mm", 0.6

    def readings(self, true: Readings) -> Readings:
        resonance = 80.0 + 50.0 * self.phase

        def position(t: Floats) -> Floats:
            off = (true["engine_speed"](t) - resonance) / 12.0
            return true["slave_position"](t) + self.size / (1.0 + np.square(off))

        return {**true, "slave_position": position}


class Judder(NearMiss):
    """Torque swings at some nine hertz while slip is slow."""

    name, equation, drivers = "judder", "torque", ("slip_speed", "time")
    others, listed = ("sensor:engine_speed", "engine_speed"), False
    unit, largest = "1", 0.3
    pace: ClassVar[float] = 0.005  # s

    def law(self) -> Law:
        frequency = 8.0 + 2.0 * self.phase

        def act(seen: Seen) -> dict[str, float]:
            swing = self.size * np.sin(2.0 * np.pi * frequency * seen["time"])
            return {"torque_share": float(swing) * (abs(seen["slip_speed"]) < 20.0)}

        return act


class RestedLining(NearMiss):
    """Moisture settles on a lining at rest, and dries as it slips: it bites harder after a rest."""

    name, equation, drivers = "rested_lining", "torque", ("rest_time", "recent_slip")
    # listed since it was missed
    unit, largest = "1", 0.5

    def law(self) -> Law:
        wet, before = 1.0, 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal wet, before
            since, before = max(seen["time"] - before, 0.0), seen["time"]
            slips = abs(seen["slip_speed"]) > 5.0
            wet += (1.0 - slips - wet) * (1.0 - np.exp(-since / (4.0 if slips else 60.0)))
            return {"torque_share": self.size * float(wet)}

        return act


class RoughRoad(NearMiss):
    """The position sensor rectifies the shaking of the road: the faster the truck, the more."""

    name, equation, drivers = "rough_road", "sensor:slave_position", ("vehicle_speed",)
    others = ("zero_position",)  # listed since it was missed
    unit, largest = "mm", 0.6

    def readings(self, true: Readings) -> Readings:
        rough = 8.0 + 8.0 * self.phase

        def position(t: Floats) -> Floats:
            speed = np.square(true["vehicle_speed"](t) / rough)
            return true["slave_position"](t) + self.size * speed / (1.0 + speed)

        return {**true, "slave_position": position}


class Polished(NearMiss):
    """Every engagement polishes the lining a little, however much heat it makes."""

    name, equation, drivers = "polished", "torque", ("engagements",)
    # listed since it was missed
    unit, largest = "1", 0.6

    def law(self) -> Law:
        few = 5.0 + 15.0 * self.phase
        count, slipped = 0, False

        def act(seen: Seen) -> dict[str, float]:
            nonlocal count, slipped
            slips = abs(seen["slip_speed"]) > (1.0 if slipped else 10.0)
            count, slipped = count + (slips and not slipped), slips
            return {"torque_share": -self.size * float(1.0 - np.exp(-count / few))}

        return act


class HeavyCore(NearMiss):
    """The position sensor's core is dragged along as the engine jerks at its mounts."""

    name, equation, drivers = "heavy_core", "sensor:slave_position", ("engine_acceleration",)
    others = ("zero_position",)  # listed since it was missed
    unit, largest = "mm", 0.8

    def readings(self, true: Readings) -> Readings:
        least = 20.0 + 40.0 * self.phase

        def position(t: Floats) -> Floats:
            speed = true["engine_speed"]
            rate = (speed(t + 0.02) - speed(np.maximum(t - 0.02, 0.0))) / 0.04
            return true["slave_position"](t) + self.size * np.tanh(rate / least)

        return {**true, "slave_position": position}


# --- two at once ---------------------------------------------------------------------------------


class ReportAndBedding(NearMiss):
    """A report that is high where the engine drives, and linings that bed in."""

    name, equation, drivers = (
        "report_and_bedding",
        "sensor:engine_torque",
        ("engine_torque", "energy"),
    )
    others = ("zero_position",)
    unit, largest = "of each", 1.0

    def law(self) -> Law:
        return BeddingIn(self.size * BeddingIn.largest, self.phase).law()

    def readings(self, true: Readings) -> Readings:
        return OneSidedReport(self.size * OneSidedReport.largest, self.phase).readings(true)


class StribeckAndFingers(NearMiss):
    """Friction that grows as slip ends, and fingers that fly outwards."""

    name, equation, drivers = "stribeck_and_fingers", "torque", ("slip_speed", "engine_speed")
    others = ("zero_position", "sensor:slave_position")
    unit, largest = "of each", 1.0

    def law(self) -> Law:
        stribeck = TanhStribeck(self.size * TanhStribeck.largest, self.phase).law()
        fingers = FloatingFingers(self.size * FloatingFingers.largest, self.phase).law()
        return lambda seen: {**stribeck(seen), **fingers(seen)}


NEAR_MISSES: Mapping[str, type[NearMiss]] = {kind.name: kind for kind in NearMiss.__subclasses__()}
FOREIGN: Mapping[str, type[Outsider]] = {**OUTSIDERS, **NEAR_MISSES}  # all that no library has
