"""What a log says about a driveline: wheels, gears, tyres, and when the clutch is locked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchest import units
from clutchest.models.machine import Machine
from clutchest.models.symbols import Column
from clutchest.reading.candidates import (
    ROAD,
    USUAL_RADIUS,
    BusSource,
    SignalSearch,
    learned,
    pairs,
    with_engine,
)
from clutchest.reading.gear_ratios import GearRatio, Learned

NEARLY = 0.9  # of the longest time in gears, from which the steadier wheels are preferred
STEADY = 1.1  # times the smallest scatter of a ratio, up to which wheels count as steady
ENGAGEMENT_S = 3.0  # a dry clutch seldom slips for longer, as it is driven
FASTEST_TRUCK = 2.0  # rad/s, at which the tyres' radius can be read from both speeds
AGREES = 0.8  # of the time in a gear, for which a signal has to have one value to be the gear


@dataclass(frozen=True, slots=True)
class GearSignal:
    """A signal of the engaged gear: ``names``, and the ``numbers`` that it has in the gears that
    were learned, first gear first."""

    source: BusSource
    numbers: tuple[int, ...]

    @property
    def counts_from_one(self) -> bool:
        """Whether the gears are those from the first on, without one that is missing."""
        return self.numbers == tuple(range(1, len(self.numbers) + 1))


@dataclass(frozen=True)
class Driveline:
    """``column``: canonical name of the shaft behind the clutch, "" of a machine without one.

    ``wheel`` and ``other``: the wheels that stand in for it, None where it is on the bus itself or
    nothing could be learned; ``learned`` from it; ``radius`` m ± of the tyres where two speeds tell
    it; ``gear``: the signal of the engaged gear.
    """

    column: str = ""
    wheel: BusSource | None = None
    other: BusSource | None = None
    learned: Learned | None = None
    radius: tuple[float, float] | None = None
    gear: GearSignal | None = None

    @property
    def gears(self) -> tuple[GearRatio, ...]:
        """The gears of a wheel that stands in for the shaft."""
        return self.learned.gears if self.learned and self.wheel else ()

    @property
    def on_the_road(self) -> bool:
        """Whether the wheel's speed is one of the road, in km/h or m/s."""
        unit = self.wheel.layout.unit if self.wheel else ""
        return bool(unit) and units.compatible(unit, ROAD)

    def thresholds(self, machine: Machine, position: bool) -> dict[str, float]:
        """``[modes]`` that the data call for; ``position``: whether an actuator's position tells
        open from closed."""
        if not self.column or self.learned is None or not self.learned.gears:
            return {}
        wanted = {
            "lock_slip": self.learned.lock_slip,
            "lock_average": self.learned.lock_average,
            "longest_engagement": 0.0 if position else ENGAGEMENT_S,
        }
        return {k: v for k, v in wanted.items() if v and k in machine.regimes.thresholds}

    def words(self) -> list[str]:
        """What was learned, a line each."""
        lines = []
        for number, gear in enumerate(self.gears, 1):
            lines.append(
                f"gear {number}: engine/wheel {gear.ratio:.3f} ± {gear.std:.3f}, held "
                f"{gear.seconds:.1f} s"
            )
        if self.gears and self.on_the_road:
            lines.append(
                f"radius {USUAL_RADIUS} m is a guess: only gears/radius can be seen in a log, and "
                "only that is used"
            )
        if self.radius is not None:
            lines.append(
                f"rolling radius of the tyres {self.radius[0]:.3f} ± {self.radius[1]:.3f} m"
            )
        if self.gear is not None:
            numbers = ", ".join(map(str, self.gear.numbers))
            lines.append(f"in them {self.gear.source.where} has {numbers}")
        return lines

    def as_dict(self) -> dict[str, Any]:
        """For ``inspect.json``."""
        wheel = None if self.wheel is None else self.wheel.bus
        return {
            "wheel": None if wheel is None else f"{wheel.message}.{wheel.signal}",
            "gears": [{"ratio": g.ratio, "std": g.std, "seconds": g.seconds} for g in self.gears],
            "radius_m": None if self.radius is None else self.radius[0],
            "radius_std_m": None if self.radius is None else self.radius[1],
            "locked_s": self.learned.seconds if self.learned else 0.0,
        }


def driveline_of(found: SignalSearch, machine: Machine) -> Driveline:
    """What the speeds that were found say of it."""
    geared = [column for column in machine.columns if column.geared_by]
    if not geared:
        return Driveline()
    column = geared[0]
    engine = found.sources.get(column.geared_by)
    shaft = found.sources.get(column.name)
    if engine is None:
        return Driveline(column.name)
    if shaft is not None and len(shaft.values().value):
        return Driveline(column.name, learned=with_engine(engine, shaft))
    return _by_wheels(found, column, engine)


def _by_wheels(found: SignalSearch, column: Column, engine: BusSource) -> Driveline:
    """The wheels of the driven axle, by which of them are steadiest in gear."""
    road = [
        source for source in found.sources.values() if source.layout.unit and source.measures(ROAD)
    ]
    axles: list[tuple[BusSource, BusSource | None]] = [*pairs(found.wheels)]
    axles += [(wheel, None) for wheel in (*found.wheels, *road)]
    tried = [(learned(wheel, engine, other), wheel, other) for wheel, other in axles]
    known = [each for each in tried if each[0] is not None and each[0].gears]
    if not known:
        return Driveline(column.name, next((axle[0] for axle in axles), None))
    longest = max(result.seconds for result, _, _ in known if result)
    steady = [each for each in known if each[0] and each[0].seconds >= NEARLY * longest]
    least = min(result.scatter for result, _, _ in steady if result)
    # in the order of the axles: both wheels of one turn as the differential does
    best, wheel, other = next(e for e in steady if e[0] and e[0].scatter <= STEADY * least)
    assert best is not None
    return Driveline(
        column.name,
        wheel,
        other,
        best,
        _radius(wheel, road),
        _gear_signal(found.gears, wheel, best),
    )


def _radius(wheel: BusSource, road: Sequence[BusSource]) -> tuple[float, float] | None:
    """Rolling radius, m ±, where a wheel in rad/s and a speed of the road are both there."""
    if not wheel.measures("rad/s") or not wheel.layout.unit or not road:
        return None
    turns, speed = wheel.values(), road[0].values()
    if len(turns.time) < 2 or len(speed.time) < 2:
        return None
    w = np.interp(speed.time, turns.time, units.convert(turns.value, wheel.layout.unit, "rad/s"))
    v = units.convert(speed.value, road[0].layout.unit, ROAD)
    fast = w > FASTEST_TRUCK
    if np.count_nonzero(fast) < 20:
        return None
    ratio = v[fast] / w[fast]
    low, middle, high = np.percentile(ratio, [16, 50, 84])
    return float(middle), float((high - low) / 2)


def _gear_signal(gears: Sequence[BusSource], wheel: BusSource, best: Learned) -> GearSignal | None:
    """The signal that has another whole number in each of the gears, rising with them."""
    time = wheel.values().time
    for source in gears:
        values = source.values()
        if len(values.time) < 2:
            continue
        place = np.searchsorted(values.time, time, side="right") - 1
        shown = values.value[np.maximum(place, 0)]
        numbers = [_steady(shown[best.gear == k]) for k in range(len(best.gears))]
        whole = [n for n in numbers if n is not None]
        if len(whole) == len(best.gears) > 1 and whole == sorted(set(whole)) and whole[0] >= 1:
            return GearSignal(source, tuple(whole))
    return None


def _steady(shown: np.ndarray) -> int | None:
    """The whole number that readings (n) have nearly all the time; None without one."""
    if not len(shown):
        return None
    values, counts = np.unique(shown, return_counts=True)
    most = int(np.argmax(counts))
    if counts[most] < AGREES * len(shown) or values[most] != round(float(values[most])):
        return None
    return int(values[most])
