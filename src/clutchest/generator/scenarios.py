"""What the truck is made to do: each scenario is a timetable of legs, drawn by the seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

# Kinds of legs.
REST, DRIVE, POSITION, TORQUE = range(4)

# One leg lasts until the next one's ``time``.
#   REST      neutral, clutch closed, actuator retracted; a moving truck is braked to a stop first
#   DRIVE     towards ``speed`` m/s on ``grade``; a launch in ``gear`` at ``engine_speed`` with
#             ``torque`` Nm; speed 0 means braking to a stop
#   POSITION  input shaft held at ``shaft_speed``, engine governed to ``engine_speed``, clutch
#             moved linearly ``start`` → ``end``, mm from where it rests retracted
#   TORQUE    as POSITION, but the clutch holds ``torque``
# Every leg but REST leaves with the clutch opened; speeds in rad/s where not said otherwise.
LEG = np.dtype(
    [
        ("time", np.float64),
        ("kind", np.int64),
        ("speed", np.float64),
        ("grade", np.float64),
        ("gear", np.int64),
        ("torque", np.float64),
        ("engine_speed", np.float64),
        ("shaft_speed", np.float64),
        ("start", np.float64),
        ("end", np.float64),
    ]
)

Random = np.random.Generator
Legs = list[dict[str, float]]

GEARS = 14.9 * 1.278 ** -np.arange(12.0)  # twelve gears in even steps
PER_METRE = GEARS * 2.9 / 0.5  # input shaft rad/s per m/s: final drive over wheel radius
GRAVITY, ROLLING = 9.81, 0.006
TORQUE_RATE = 700.0  # Nm/s: how fast the control unit lets a held torque grow and fall


@dataclass(frozen=True)
class TruckScenario:
    """``name``, ``what`` it shows and its default ``duration`` s.

    ``legs(rng, duration, mass, kiss_point)`` makes the timetable; ``mass`` kg is drawn from that
    range; ``start_temp`` °C of body and disc where it is not the truck at rest's own, with
    ``start_spread``; ``cruising``: starts in top gear at that speed, m/s; ``cold``: the engine has
    stood long enough to be as cold as the air.
    """

    name: str
    what: str
    duration: float
    legs: Callable[[Random, float, float, float], Legs]
    mass: tuple[float, float] = (16e3, 36e3)
    start_temp: float | None = None
    start_spread: float = 3.0
    cruising: float = 0.0
    cold: bool = False

    def timetable(self, rng: Random, duration: float, mass: float, kiss_point: float) -> NDArray:
        """The legs as an array of LEG, with a last one that never begins."""
        legs = self.legs(rng, duration, mass, kiss_point)
        table = np.zeros(len(legs) + 1, LEG)
        for row, leg in zip(table, legs, strict=False):
            for key, value in leg.items():
                row[key] = value
        table[-1]["time"] = max(duration, table[-2]["time"]) + 1.0
        return table


def launch_leg(
    time: float,
    speed: float,
    grade: float,
    mass: float,
    gear: int,
    slip_time: float,
    engine_speed: float,
) -> dict[str, float]:
    """A launch whose slip should last about ``slip_time`` s."""
    inertia = mass / PER_METRE[gear - 1] ** 2
    load = mass * GRAVITY * (ROLLING + grade) / PER_METRE[gear - 1]
    torque = inertia * engine_speed / slip_time + max(load, 0.0)
    torque = float(np.clip(torque, 250.0, 950.0))
    return {
        "time": time,
        "kind": DRIVE,
        "speed": speed,
        "grade": grade,
        "gear": gear,
        "engine_speed": engine_speed,
        "torque": torque,
    }


def gear_for(energy: float, mass: float, engine_speed: float) -> int:
    """The gear in which launching on the flat costs about ``energy`` J of slip."""
    costs = 0.5 * mass / PER_METRE**2 * engine_speed**2
    return int(np.clip(np.argmin(np.abs(np.log(costs / energy))) + 1, 1, 7))


def _city(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    legs: Legs = [{"time": 0.0, "kind": REST}]
    time = rng.uniform(5.0, 15.0)
    while time < duration:
        grade = float(np.clip(rng.normal(0.0, 0.012), -0.025, 0.03))
        idle = rng.uniform(68.0, 88.0)
        gear = gear_for(rng.uniform(28e3, 70e3), mass, idle)
        speed = rng.uniform(5.0, 15.0)
        leg = launch_leg(time, speed, grade, mass, gear, rng.uniform(1.2, 3.2), idle)
        legs.append(leg)
        time += rng.uniform(18.0, 40.0) + speed
        for _ in range(rng.integers(0, 3)):  # traffic: now faster, now slower, now coasting
            speed = float(np.clip(speed + rng.uniform(-5.0, 5.0), 4.0, 22.0))
            grade = float(np.clip(grade + rng.normal(0.0, 0.008), -0.025, 0.03))
            legs.append({**leg, "time": time, "speed": speed, "grade": grade})
            time += rng.uniform(12.0, 35.0)
        legs.append({**leg, "time": time, "kind": REST, "speed": 0.0})
        time += speed + rng.uniform(10.0, 40.0)
    return legs


def _launches(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    legs: Legs = [{"time": 0.0, "kind": REST}]
    time = rng.uniform(8.0, 15.0)
    while time < duration:
        idle = rng.uniform(66.0, 92.0)
        heavy = rng.random() < 0.25
        energy = rng.uniform(100e3, 220e3) if heavy else rng.uniform(30e3, 80e3)
        gear = gear_for(energy, mass, idle)
        grade = float(np.clip(rng.normal(0.0, 0.008), -0.015, 0.02))
        slip_time = rng.uniform(2.0, 4.0) if heavy else rng.uniform(1.0, 3.0)
        speed = 1.35 * idle / PER_METRE[gear - 1]
        leg = launch_leg(time, speed, grade, mass, gear, slip_time, idle)
        legs.append(leg)
        drive = rng.uniform(14.0, 22.0)
        legs.append({**leg, "time": time + drive, "kind": REST, "speed": 0.0})
        time += drive + rng.uniform(38.0, 50.0)
    return legs


def _ramps(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    held = {"kind": POSITION, "engine_speed": 151.0}
    wide, tight, stroke = 12.0, 4.15, 5.0
    legs: Legs = [{"time": 0.0, "kind": REST}, {"time": 4.0, **held, "start": wide, "end": wide}]
    for k in range(15):
        start, end = (wide, tight) if k % 2 == 0 else (tight, wide)
        legs.append({"time": 10.0 + k * stroke, **held, "start": start, "end": end})
    return [*legs, {"time": 10.0 + 15 * stroke, "kind": REST}]


def _heating(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    """Each heating: the cold clutch is probed, torque pulses heat it, the hot clutch is probed.

    Cold it is closed to a position, which gives some 500 Nm and costs little heat; hot a torque
    of about 1450 Nm is asked for, which it then reaches near that very position.  The first
    heating takes 1.5 MJ, probes included; later ones, which begin warmer, 1.3 MJ, so that the
    disc stays below some 280 °C.
    """
    cold, pulses, hot = 9, 6, 3
    each = 60e3  # J of a probe while hot; one while cold takes some 20 kJ
    legs: Legs = [{"time": 0.0, "kind": REST}]
    time, energy = 60.0, 1.5e6
    while time < duration:
        heating = (energy - cold * 20e3 - hot * each) / pulses
        time = _position_probes(rng, legs, time, kiss_point, cold)
        time = _torque_pulses(rng, legs, time, heating, pulses, pause=6.0)
        time = _torque_pulses(rng, legs, time, each, hot, pause=2.5)
        legs.append({"time": time, "kind": REST})
        time += rng.uniform(510.0, 560.0)
        energy = 1.3e6
    return legs


def _position_probes(rng: Random, legs: Legs, time: float, kiss_point: float, count: int) -> float:
    """``count`` times close, hold and open, appended to ``legs`` from ``time`` s; gives the end."""
    wide = kiss_point + 2.0
    for _ in range(count):
        slip, tight = rng.uniform(9.0, 13.0), kiss_point - rng.uniform(2.2, 2.4)
        held = {"kind": POSITION, "shaft_speed": 60.0, "engine_speed": 60.0 + slip}
        for start, end, lasts in (
            (wide, wide, 2.0),
            (wide, tight, 1.2),
            (tight, tight, 3.0),
            (tight, wide, 1.2),
        ):
            legs.append({"time": time, **held, "start": start, "end": end})
            time += lasts
    return time


def _torque_pulses(
    rng: Random, legs: Legs, time: float, energy: float, count: int, pause: float
) -> float:
    """``count`` pulses of ``energy`` J, each after a ``pause`` of about so many s with the clutch
    open, appended to ``legs`` from ``time`` s; gives the end."""
    for _ in range(count):
        torque, hold = rng.uniform(1400.0, 1500.0), rng.uniform(0.3, 0.9)
        ramp = torque / TORQUE_RATE
        held = {
            "kind": TORQUE,
            "shaft_speed": 60.0,
            "engine_speed": 60.0 + energy / (torque * (hold + ramp)),
        }
        legs.append({"time": time, **held, "torque": 0.0})
        time += pause + rng.uniform(-0.5, 0.5)
        legs.append({"time": time, **held, "torque": torque})
        time += ramp + hold
        legs.append({"time": time, **held, "torque": 1.0})
        time += ramp
    return time


def _slip_steps(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    legs: Legs = [{"time": 0.0, "kind": REST}]
    up = np.linspace(63.0, 136.0, 4)  # 600 to 1300 rpm
    time = 10.0
    while time < duration:
        position = kiss_point - rng.uniform(0.85, 1.25)
        held = {"kind": POSITION, "start": position, "end": position}
        for speed in (*up, *up[::-1]):  # there and back: the disc's heating weighs on both alike
            legs.append({"time": time, **held, "engine_speed": speed})
            time += 1.2
        legs.append({"time": time, "kind": REST})
        time += rng.uniform(75.0, 95.0)
    return legs


def _cooldown(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    torque, speed = rng.uniform(130.0, 160.0), rng.uniform(120.0, 140.0)
    stop = 23.0 + rng.uniform(1.0e6, 1.4e6) / (torque * speed)
    return [
        {"time": 0.0, "kind": REST},
        {"time": 20.0, "kind": TORQUE, "torque": torque, "engine_speed": speed},
        {"time": stop, "kind": REST},
    ]


def _pulses(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    legs: Legs = [{"time": 0.0, "kind": REST}]
    time = 20.0
    while time < duration:
        slip = rng.uniform(22.0, 40.0)
        held = {"kind": TORQUE, "engine_speed": 125.0, "shaft_speed": 125.0 - slip}
        legs.append({"time": time, **held, "torque": 0.0})
        for _ in range(6):
            time += 4.0
            legs.append({"time": time, **held, "torque": rng.uniform(250.0, 560.0)})
            time += 5.0
            legs.append({"time": time, **held, "torque": 0.0})
        time += 3.0
        legs.append({"time": time, "kind": REST})
        time += rng.uniform(35.0, 50.0)
    return legs


def _closed(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    legs: Legs = []
    time = 0.0
    while time < duration:
        legs.append(
            {
                "time": time,
                "kind": DRIVE,
                "speed": rng.uniform(20.5, 23.5),
                "grade": float(np.clip(rng.normal(0.0, 0.005), -0.012, 0.012)),
            }
        )
        time += rng.uniform(20.0, 60.0)
    return legs


def _mixed(rng: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    """A stretch of this, a stretch of that; one that is cut short ends with the truck at rest."""
    legs: Legs = []
    time = 0.0
    while time < duration:
        lasts = rng.uniform(150.0, 300.0)
        kind = (_city, _launches, _slip_steps, _pulses)[rng.integers(4)]
        stretch = kind(rng, lasts, mass, kiss_point)
        legs += [{**leg, "time": time + leg["time"]} for leg in stretch if leg["time"] < lasts]
        time += lasts
    return legs


SCENARIOS: Mapping[str, TruckScenario] = MappingProxyType(
    {
        s.name: s
        for s in (
            TruckScenario(
                "city", "launches, gearshifts, cruising, coasting and stops", 1500.0, _city
            ),
            TruckScenario(
                "launches",
                "some 24 launches, light and heavy, retracted in between",
                1500.0,
                _launches,
                mass=(30e3, 42e3),
            ),
            TruckScenario(
                "ramps",
                "position ramped back and forth for 75 s, then closed (D1)",
                240.0,
                _ramps,
                start_temp=73.0,
                start_spread=0.0,
            ),
            TruckScenario(
                "heating",
                "heated by 1.5 MJ, torque probed cold and hot, closed in between (D4)",
                2500.0,
                _heating,
            ),
            TruckScenario(
                "slip-steps",
                "slip steps 600–1300 rpm at constant position (D3)",
                600.0,
                _slip_steps,
            ),
            TruckScenario(
                "cooldown",
                "hot, one heavy heating, then closed for 40 min",
                2480.0,
                _cooldown,
                start_temp=110.0,
                start_spread=8.0,
            ),
            TruckScenario(
                "pulses", "torque pulses up to 600 Nm at moderate slip (D7, D9)", 1400.0, _pulses
            ),
            TruckScenario(
                "mixed", "stretches of city, launches, slip-steps and pulses", 1200.0, _mixed
            ),
            TruckScenario(
                "cold-start",
                "launches with an engine as cold as the air",
                900.0,
                _launches,
                mass=(30e3, 42e3),
                start_spread=0.5,
                cold=True,
            ),
            TruckScenario(
                "closed",
                "cruising for half an hour without any slip",
                1800.0,
                _closed,
                cruising=22.0,
            ),
        )
    }
)
