"""What may be wrong with a clutch and stands in no library: memory, thresholds, time, timing,
couplings that the model does not have.

Nothing of the package is imported here, so that nothing of the model can leak into it.  Each
class says which ``equation`` it falsifies and by which signal it is driven: ``drivers``, the
first of which is the cause, others being the same thing under another name.  ``size`` is at least
0; beyond ``largest`` no clutch would do it.  ``phase`` (0…1) is chance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Seen = Mapping[str, float]
Law = Callable[[Seen], Mapping[str, float]]
Readings = Mapping[str, Callable[[Floats], Floats]]

OPEN = 8.0  # mm of the motor: from here on no surface touches


@dataclass(frozen=True)
class Outsider:
    """One cause of a given ``size``, in ``unit``; sees and acts as the generator describes."""

    size: float
    phase: float = 0.5
    name: ClassVar[str]
    equation: ClassVar[str]
    drivers: ClassVar[tuple[str, ...]]
    unit: ClassVar[str]
    largest: ClassVar[float]

    @classmethod
    def equations(cls) -> tuple[str, ...]:
        """All equations any of which says where it acts, ``equation`` first."""
        return (cls.equation,)

    def law(self) -> Law | None:
        return None

    def readings(self, true: Readings) -> Readings:
        return true


class Glazing(Outsider):
    """Lining glazes with slip energy, and the glaze is worn off again: a hump over energy."""

    name, equation, drivers = "glazing", "torque", ("energy",)
    unit, largest = "1", 0.4

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            dose = seen["energy"] / 3e5
            return {"torque_share": -self.size * dose * float(np.exp(1.0 - dose))}

        return act


class HeatSpots(Outsider):
    """Friction remembers how hot the disc has been, and never forgets."""

    name, equation, drivers = "heat_spots", "torque", ("temp_disc",)
    unit, largest = "1/(100 K)", 0.5

    def law(self) -> Law:
        hottest = 90.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal hottest
            hottest = max(hottest, seen["temp_disc"])
            return {"torque_share": -self.size * min((hottest - 90.0) / 100.0, 1.0)}

        return act


class Softening(Outsider):
    """The binder goes soft at one body temperature, and is hard again some kelvins below."""

    name, equation, drivers = "softening", "torque", ("temp_body",)
    unit, largest = "1", 0.4

    def law(self) -> Law:
        soft = False

        def act(seen: Seen) -> dict[str, float]:
            nonlocal soft
            soft = seen["temp_body"] > (74.0 if soft else 77.0)
            return {"torque_share": -self.size * soft}

        return act


class OilSplash(Outsider):
    """A drop of oil from the gearbox's seal at some moment, burnt off within minutes."""

    name, equation, drivers = "oil_splash", "torque", ("time",)
    unit, largest = "1", 0.6

    def law(self) -> Law:
        begin = 150.0 + 200.0 * self.phase

        def act(seen: Seen) -> dict[str, float]:
            since = seen["time"] - begin
            return {"torque_share": -self.size * float(np.exp(-since / 200.0)) * (since >= 0.0)}

        return act


class SqueezeFilm(Outsider):
    """Air between lining and plate must be squeezed out: less torque while closing, more while
    opening, per mm/s."""

    name, equation, drivers = "squeeze_film", "torque", ("position_rate",)
    unit, largest = "Nm s/mm", 60.0

    def law(self) -> Law:
        return lambda seen: {"torque": self.size * seen["position_rate"]}


class FannedBody(Outsider):
    """The flywheel's ring gear fans air over the body, the more the faster it turns."""

    name, equation, drivers = "fanned_body", "body_heat", ("engine_speed",)
    unit, largest = "W/K per 100 rad/s", 60.0

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            over = seen["temp_body"] - seen["ambient_temp"]
            return {"body_heat": -self.size * (seen["engine_speed"] / 100.0) * over}

        return act


class ExhaustHeat(Outsider):
    """An exhaust brake beside the bell housing warms the body as hard as the engine works."""

    name, equation, drivers = "exhaust_heat", "body_heat", ("engine_torque",)
    unit, largest = "W per 1000 Nm", 3000.0

    def law(self) -> Law:
        return lambda seen: {"body_heat": self.size * abs(seen["engine_torque"]) / 1000.0}


class LostContact(Outsider):
    """An open clutch lets the disc float: most of what it gave to the body by contact is lost."""

    name, equation, drivers = "lost_contact", "disc_heat", ("slave_position", "motor_position")
    unit, largest = "W/K", 126.0

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            kept = self.size * (seen["temp_disc"] - seen["temp_body"])
            kept *= seen["motor_position"] > OPEN
            return {"disc_heat": kept, "body_heat": -kept}

        return act


class HeatedHousing(Outsider):
    """A retarder on the gearbox's input warms the housing, the more the faster it turns."""

    name, equation, drivers = "heated_housing", "housing_heat", ("input_shaft_speed",)
    unit, largest = "W per 100 rad/s", 3000.0

    def law(self) -> Law:
        return lambda seen: {"housing_heat": self.size * abs(seen["input_shaft_speed"]) / 100.0}


class Compressor(Outsider):
    """An air compressor that the torque report does not know loads the engine now and then."""

    name, equation, drivers = "compressor", "engine_speed", ("time",)
    unit, largest = "Nm", 150.0

    def law(self) -> Law:
        def act(seen: Seen) -> dict[str, float]:
            on = (seen["time"] / 100.0 + self.phase) % 1.0 < 0.4
            return {"engine_load": self.size * on}

        return act


class Creep(Outsider):
    """Closed, the hydraulic line creeps: the zero position rises with every second of rest, by a
    rate that depends on nothing but whether the position is that of rest."""

    name, equation = "creep", "zero_position"
    drivers = ("time", "slave_position", "motor_position")
    unit, largest = "mm/h", 2.0

    def law(self) -> Law:
        shift = last = 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal shift, last
            if seen["motor_position"] == 0.0:
                shift += self.size / 3600.0 * (seen["time"] - last)
            last = seen["time"]
            return {"zero_position": shift}

        return act


class TiltedReport(Outsider):
    """The engine's torque map is tilted over its speed."""

    name, equation, drivers = "tilted_report", "sensor:engine_torque", ("engine_speed",)
    unit, largest = "Nm per 100 rad/s", 300.0

    def readings(self, true: Readings) -> Readings:
        def torque(t: Floats) -> Floats:
            over = true["engine_speed"](t) - 100.0
            return true["engine_torque"](t) + self.size * over / 100.0

        return {**true, "engine_torque": torque}


class WavySensor(Outsider):
    """The slave sensor's magnet is off centre: its error waves along the stroke."""

    name, equation, drivers = "wavy_sensor", "sensor:slave_position", ("slave_position",)
    unit, largest = "mm", 0.5

    def readings(self, true: Readings) -> Readings:
        def position(t: Floats) -> Floats:
            x = true["slave_position"](t)
            return x + self.size * np.sin(2.0 * np.pi * (x - 38.4) / 3.0)

        return {**true, "slave_position": position}


class LazyReport(Outsider):
    """The torque report is computed once per revolutions: late at idle, punctual at speed."""

    name, equation, drivers = "lazy_report", "timing:engine_torque", ("engine_speed",)
    unit, largest = "s", 0.4

    def readings(self, true: Readings) -> Readings:
        def torque(t: Floats) -> Floats:
            late = self.size * np.clip((130.0 - true["engine_speed"](t)) / 65.0, 0.0, 1.5)
            return true["engine_torque"](np.maximum(t - late, 0.0))

        return {**true, "engine_torque": torque}


class DriftingClock(Outsider):
    """A gateway's clock runs slow and is set right every so often: its messages fall behind."""

    name, equation, drivers = "drifting_clock", "timing:slave_position", ("time",)
    unit, largest = "s", 0.5

    def readings(self, true: Readings) -> Readings:
        def late(t: Floats) -> Floats:
            return self.size * ((t / 150.0 + self.phase) % 1.0)

        def behind(name: str) -> Callable[[Floats], Floats]:
            return lambda t: true[name](np.maximum(t - late(t), 0.0))

        return {**true, **{name: behind(name) for name in ("slave_position", "motor_position")}}


OUTSIDERS: Mapping[str, type[Outsider]] = {kind.name: kind for kind in Outsider.__subclasses__()}
