"""Bus signals that may be canonical ones of a machine: by SPN, name, unit, range, behaviour."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from clutchest import units
from clutchest.can.database import Database, Message, SignalLayout
from clutchest.can.decode import decode, rows_of
from clutchest.can.frames import Frames
from clutchest.can.survey import IdStatistics
from clutchest.errors import ClutchestError
from clutchest.models.machine import Machine
from clutchest.models.symbols import Column
from clutchest.reading.gear_ratios import Learned, learn_gears, same_speed
from clutchest.signals import Floats, Why
from clutchest.vehicle import BusSignal

WHEEL = re.compile(
    r"wh(ee)?l\w*(speed|spd|_w_|_v_)|(speed|spd|^[vn])_?(wh(ee)?l|rad)|w(h|heel)?(speed|spd|_?v)_?[fr][lr]"
    r"|rad(drehzahl|geschw)|(vitesse|velocidad|velocita)_?(roue|rueda|ruota)|hjulhast",
    re.IGNORECASE,
)
GEAR = re.compile(
    r"gear|(^|_)gang|rapport_?(eng|boite)|marcha|marcia|v[aä]xel|versnelling|(^|_)bieg",
    re.IGNORECASE,
)
LIVELY = 0.02  # of the samples of a measured quantity that differ from the one before, at least
RECOGNISED_S = 3.0  # of turning together, by which a speed without a known name is recognised
ALWAYS = 0.99  # of a log, for which a speed that is with the engine's is the engine's
MOST_VALUES = 400_000  # of a signal that are looked at
ROAD = "m/s"
USUAL_RADIUS = 0.32  # m, of a wheel whose size is not known

By = Literal["SPN", "name", "behaviour"]


class Values(NamedTuple):
    """Valid samples (n) of a bus signal: ``time`` s, ``value`` in the bus unit; and the ``share``
    of all samples that are valid."""

    time: Floats
    value: Floats
    share: float


@dataclass(frozen=True, slots=True)
class SignalCandidate:
    """A bus signal that may be ``canonical``, and its values in this log.

    ``by``: whether its SPN, its name, or only its behaviour matches; ``low`` and ``high`` in the
    bus unit over the valid samples, None without any; ``valid`` their share; ``step`` of the raw
    value, bus unit; ``noise``, bus unit, as far as it differs from sample to sample.
    ``plausible``: as large as such a signal is; ``lively``: it changes as often as something
    measured.  ``sender`` (J1939 source address) and ``channel`` where the message has several.
    """

    canonical: str
    message: str
    signal: str
    unit: str
    by: By
    valid: float
    low: float | None
    high: float | None
    step: float
    noise: float = 0.0
    plausible: bool = True
    lively: bool = True
    sender: int | None = None
    channel: int | None = None

    @property
    def where(self) -> str:
        """Message and signal, with the sender where there are several."""
        sender = "" if self.sender is None else f" from address 0x{self.sender:02X}"
        return f"{self.message}.{self.signal}{sender}"

    @property
    def rank(self) -> tuple[bool, bool, bool, bool, float]:
        """The larger, the more likely: a signal that varies, as large as it should be, with the
        SPN, measured rather than set, rarely invalid."""
        varies = self.low is not None and self.high is not None and self.high > self.low
        return varies, self.plausible, self.by == "SPN", self.lively, self.valid


@dataclass(frozen=True)
class BusSource:
    """One signal of one id of a log."""

    frames: Frames
    row: IdStatistics
    message: Message
    layout: SignalLayout

    def values(self) -> Values:
        """Its valid samples; of a long log the first and the last."""
        return self._decoded

    @cached_property
    def _decoded(self) -> Values:
        rows = rows_of(self.frames, self.message, self.row.channel)
        rows = rows[self.frames.id[rows] == self.row.id]
        if len(rows) > MOST_VALUES:
            rows = np.concatenate([rows[: MOST_VALUES // 2], rows[-MOST_VALUES // 2 :]])
        column = decode(self.frames, rows, self.message, [self.layout.name])[self.layout.name]
        valid = column.why == Why.VALID
        time = (self.frames.t_ns[column.rows[valid]] - self.frames.t_ns[0]) / 1e9
        return Values(time, column.value[valid], float(np.mean(valid)) if len(valid) else 0.0)

    @property
    def bus(self) -> BusSignal:
        """Its names."""
        return BusSignal(self.message.name, self.layout.name, self.layout.unit)

    @property
    def where(self) -> str:
        """Message and signal."""
        return f"{self.message.name}.{self.layout.name}"

    def changes(self) -> bool:
        """Whether it is a number and has more than one value."""
        return self.layout.width <= 64 and len(np.unique(self.values().value)) > 1

    def measures(self, unit: str) -> bool:
        """Whether its unit, if it states one, may be converted to this one."""
        try:
            return not self.layout.unit or units.compatible(self.layout.unit, unit)
        except ClutchestError:  # a unit that only this DBC knows
            return False


@dataclass(frozen=True)
class SignalSearch:
    """``candidates`` by canonical name, the most likely first; ``sources`` of the first ones;
    ``wheels``: wheel speeds; ``gears``: signals that may be the engaged gear; ``companions``:
    canonical name → key of the vehicle file → J1939 signal; ``rest``: signals with a unit that are
    not among the candidates."""

    candidates: Mapping[str, tuple[SignalCandidate, ...]]
    sources: Mapping[str, BusSource]
    wheels: tuple[BusSource, ...]
    gears: tuple[BusSource, ...]
    companions: Mapping[str, Mapping[str, BusSignal]]
    rest: tuple[BusSource, ...]

    def percents(self) -> list[str]:
        """Which others in percent change."""
        return [s.where for s in self.rest if s.layout.unit == "%" and s.changes()]

    def in_unit(self, unit: str) -> list[str]:
        """Which others are in a unit that converts to this one, and change."""
        return [s.where for s in self.rest if s.measures(unit) and s.changes()]


def sources_of(
    frames: Frames, rows: Sequence[IdStatistics], databases: Sequence[Database]
) -> tuple[BusSource, ...]:
    """Every signal of every id that a database knows; the first one that does."""
    found = []
    for row in rows:
        known = (database.find(row.id, row.extended, row.channel) for database in databases)
        message = next((m for m in known if m), None)
        if message is not None:
            found += [BusSource(frames, row, message, s) for s in message.signals.values()]
    return tuple(found)


def search(sources: Sequence[BusSource], machine: Machine) -> SignalSearch:
    """The signals among ``sources`` that may be those of a machine."""
    candidates: dict[str, list[tuple[SignalCandidate, BusSource]]] = {}
    companions: dict[str, dict[str, BusSignal]] = {}
    for source in sources:
        for column in machine.columns:
            if by := matched_by(source, column):
                each = _candidate(source, sources, column, by)
                candidates.setdefault(column.name, []).append((each, source))
            for part, spn in column.companions.items():
                if source.layout.spn == spn:
                    bus = BusSignal(source.message.name, source.layout.name, source.layout.unit)
                    companions.setdefault(column.name, {})[part] = bus
    wheels = tuple(s for s in sources if WHEEL.search(s.layout.name) and _is_wheel(s))
    wheels = tuple({s.bus: s for s in reversed(wheels)}.values())[::-1]
    _recognise(candidates, sources, wheels, machine)
    optional, ranked, of = machine.optional_columns, {}, {}
    for name in machine.units:
        found = sorted(candidates.get(name, []), key=lambda each: each[0].rank, reverse=True)
        if found and not (name in optional and all(c.low is None for c, _ in found)):
            ranked[name] = tuple(c for c, _ in found)
            of[name] = found[0][1]
    gears = tuple(s for s in sources if GEAR.search(s.layout.name) and s.measures("1"))
    taken = {(c.message, c.signal) for found in ranked.values() for c in found}
    taken |= {(bus.message, bus.signal) for parts in companions.values() for bus in parts.values()}
    rest = tuple(
        s for s in sources if s.layout.unit and (s.message.name, s.layout.name) not in taken
    )
    return SignalSearch(ranked, of, wheels, gears, companions, rest)


def matched_by(source: BusSource, column: Column) -> By | None:
    """Whether the SPN or the name of a signal matches the canonical one; None if neither."""
    if column.spn and source.layout.spn:
        return "SPN" if source.layout.spn == column.spn else None
    named = column.named or rf"^{re.escape(column.name)}$"
    by_name = re.search(named, source.layout.name, re.IGNORECASE) and source.measures(column.unit)
    return "name" if by_name else None


def _is_wheel(source: BusSource) -> bool:
    return source.measures("rad/s") or source.measures(ROAD)


def _candidate(
    source: BusSource, sources: Sequence[BusSource], column: Column, by: By
) -> SignalCandidate:
    twins = {s.row.id: s.row for s in sources if s.message.name == source.message.name}
    channels = {s.row.channel for s in sources if s.message.name == source.message.name}
    values = source.values()
    value = values.value
    lively = len(value) < 2 or float(np.mean(value[1:] != value[:-1])) >= LIVELY
    return SignalCandidate(
        column.name,
        source.message.name,
        source.layout.name,
        source.layout.unit,
        by,
        valid=values.share,
        low=float(value.min()) if len(value) else None,
        high=float(value.max()) if len(value) else None,
        step=abs(float(source.layout.scale)),
        noise=noise_of(value),
        plausible=_plausible(value, source.layout.unit, column),
        lively=lively,
        sender=source.row.id & 0xFF if source.message.is_j1939 and len(twins) > 1 else None,
        channel=source.row.channel if len(channels) > 1 else None,
    )


def noise_of(value: Floats) -> float:
    """Standard deviation of each sample (n) about the straight line through its neighbours: the
    noise of a signal, and whatever in it is faster than its samples."""
    if len(value) < 8:
        return 0.0
    bend = value[2:] - 2.0 * value[1:-1] + value[:-2]
    return float(np.median(np.abs(bend)) / 0.6745 / np.sqrt(6.0))


def _plausible(value: Floats, unit: str, column: Column) -> bool:
    """Whether readings (n) are as large as such a signal's are, as far as that is known."""
    if not len(value) or not units.compatible(unit or column.unit, column.unit):
        return True
    size = units.convert_reading(value, unit or column.unit, column.unit)
    if column.possible is not None:
        low, high, _ = column.possible
        return low < float(np.median(size)) < high
    if column.magnitude is None or column.magnitude.of:
        return True
    least, most = column.magnitude.largest
    return bool(least <= np.percentile(np.abs(size), 99.0) <= most)


def _recognise(
    candidates: dict[str, list[tuple[SignalCandidate, BusSource]]],
    sources: Sequence[BusSource],
    wheels: Sequence[BusSource],
    machine: Machine,
) -> None:
    """Add the speeds that no name gives away, by what they turn together with: an engine with
    wheels, in gears; a shaft with its engine, but not always.

    Of an engine and the shaft behind its clutch, the shaft is with the wheels for longer.
    """
    road = [*wheels, *(s for s in sources if s.layout.unit and s.measures(ROAD))][:1]
    for column in (c for c in machine.columns if c.geared_by):
        driver = machine.column(column.geared_by)
        of_wheels = {wheel.bus for wheel in wheels}
        speeds = [s for s in sources if s.layout.unit and s.measures(column.unit)]
        speeds = [s for s in speeds if s.bus not in of_wheels]
        if driver is not None and driver.name not in candidates and road:
            together = _together(speeds, road[0], learned)
            if together:
                engine = min(together, key=lambda each: each[0])[1]
                found = _candidate(engine, sources, driver, "behaviour")
                candidates[driver.name] = [(found, engine)]
        if driver is None or column.name in candidates or driver.name not in candidates:
            continue
        engine = max(candidates[driver.name], key=lambda each: each[0].rank)[1]
        taken = {source.bus for _, source in candidates[driver.name]}
        others = [s for s in speeds if s.bus not in taken]
        together = _together(others, engine, with_engine)
        if together:
            shaft = max(together, key=lambda each: each[0])[1]
            candidates[column.name] = [(_candidate(shaft, sources, column, "behaviour"), shaft)]


def _together(
    speeds: Sequence[BusSource],
    beside: BusSource,
    relation: Callable[[BusSource, BusSource], Learned | None],
) -> list[tuple[float, BusSource]]:
    """(s, speed) of those that turn together with the one ``beside`` for long; one that always
    does is the same speed twice."""
    found = []
    for speed in speeds:
        known = relation(beside, speed)
        if known is None or known.seconds < RECOGNISED_S:
            continue
        time = beside.values().time
        if relation is learned or known.seconds < ALWAYS * float(time[-1] - time[0]):
            found.append((known.seconds, speed))
    return found


def learned(wheel: BusSource, engine: BusSource, second: BusSource | None = None) -> Learned | None:
    """Gears between a wheel, or the mean of two, and an engine; None without both of them."""
    a, b = wheel.values(), engine.values()
    if len(a.time) < 2 or len(b.time) < 2:
        return None
    speed = wheel_speed(a.value, wheel.layout.unit)
    if second is not None:
        c = second.values()
        if len(c.time) < 2:
            return None
        speed = (speed + wheel_speed(np.interp(a.time, c.time, c.value), second.layout.unit)) / 2
    turns = units.convert(b.value, engine.layout.unit or "rad/s", "rad/s")
    return learn_gears(a.time, speed, np.interp(a.time, b.time, turns))


def with_engine(engine: BusSource, shaft: BusSource) -> Learned | None:
    """How the shaft behind a clutch turns with the engine before it; None without both."""
    a, b = shaft.values(), engine.values()
    if len(a.time) < 2 or len(b.time) < 2:
        return None
    turns = units.convert(a.value, shaft.layout.unit or "rad/s", "rad/s")
    engine_turns = units.convert(b.value, engine.layout.unit or "rad/s", "rad/s")
    return same_speed(a.time, turns, np.interp(a.time, b.time, engine_turns))


def wheel_speed(value: Floats, unit: str, radius: float = USUAL_RADIUS) -> Floats:
    """Readings (n) of a wheel in rad/s, those of the road by the ``radius`` m."""
    if unit and units.compatible(unit, ROAD):
        return units.convert(value, unit, ROAD) / radius
    return units.convert(value, unit or "rad/s", "rad/s")


def pairs(wheels: Sequence[BusSource]) -> Iterator[tuple[BusSource, BusSource]]:
    """The wheels left and right of one axle: one message, names that differ in that alone."""
    sides = {"l": "r", "left": "right", "links": "rechts"}
    for a in wheels:
        for b in wheels:
            if a.message.name != b.message.name or a.layout.unit != b.layout.unit:
                continue
            one, two = a.layout.name.lower(), b.layout.name.lower()
            for left, right in sides.items():
                swapped = (
                    one[:k] + right + one[k + len(left) :]
                    for k in range(len(one))
                    if one.startswith(left, k)
                )
                if two in swapped:
                    yield a, b
                    break
