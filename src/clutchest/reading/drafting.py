"""A vehicle file drafted from what a log shows: it replays at once, and says what it guesses."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

from clutchest import units
from clutchest.can.database import DatabaseFile
from clutchest.models.machine import Machine
from clutchest.reading.candidates import (
    ROAD,
    USUAL_RADIUS,
    BusSource,
    SignalCandidate,
    SignalSearch,
    noise_of,
    wheel_speed,
)
from clutchest.reading.driveline import Driveline
from clutchest.vehicle import BusSignal, ParameterValue, SignalMap, Vehicle, load_vehicle

OTHER_PERIOD = 0.1  # of a stated period, by which messages of another vehicle differ
MOST_NAMED = 4  # signals in percent
STATED = 0.1  # of a stated reference torque, by which the engine's largest may differ


@dataclass(frozen=True)
class Draft:
    """What a drafted vehicle is made of.

    ``references``: canonical name → Nm that 100 % stands for, of which ``stated`` were read from
    the bus.  ``template``: the shipped vehicle whose numbers it takes as guesses, "" for none.
    """

    machine: Machine
    found: SignalSearch
    driveline: Driveline
    references: Mapping[str, float]
    stated: frozenset[str]
    template: str

    def vehicle(
        self, name: str, model: str, target: Path, dbc: tuple[DatabaseFile, ...]
    ) -> Vehicle:
        """The drafted vehicle, to lie at ``target``."""
        template = load_vehicle(self.template) if self.template else None
        like = template.signals if template else {}
        signals = {
            name: self._map(candidates[0], like.get(name))
            for name, candidates in self.found.candidates.items()
            if not self.left_out(name)
        }
        line = self.driveline
        if line.wheel is not None and line.gears:
            signals[line.column] = self._wheel(line.wheel, like.get(line.column))
        positions = [n for n in self.machine.regimes.signals if self.machine.units.get(n) == "mm"]
        known = any(name in signals for name in positions)
        return Vehicle(
            name,
            model,
            target,
            "",
            dbc,
            signals,
            self._parameters(),
            modes=line.thresholds(self.machine, known),
        )

    def _parameters(self) -> dict[str, ParameterValue]:
        """The template's, and the largest torque as the bus states it."""
        parameters = guessed_parameters(self.machine, self.template)
        for name in self.stated:
            column = self.machine.column(name)
            key = column.magnitude.of if column and column.magnitude else ""
            if key in parameters:
                parameters[key] = ParameterValue(
                    self.references[name],
                    parameters[key].unit,
                    _short(STATED * self.references[name]),
                    "guess: the reference torque that this log states",
                )
        return parameters

    def messages(self) -> set[str]:
        """The messages that it maps."""
        used = {candidates[0].message for candidates in self.found.candidates.values()}
        line = self.driveline
        wheels = {each.message.name for each in (line.wheel, line.other) if each and line.gears}
        gear = {line.gear.source.message.name} if line.gear else set()
        return used | wheels | gear

    def left_out(self, name: str) -> bool:
        """Whether a signal that is not needed cannot be used as it is."""
        optional = name in self.machine.optional_columns
        return optional and self.in_percent(name) and name not in self.references

    def in_percent(self, name: str) -> bool:
        """Whether the likeliest candidate is in percent of a torque."""
        column, found = self.machine.column(name), self.found.candidates.get(name)
        return bool(column and column.reference_spn and found and found[0].unit == "%")

    def _map(self, candidate: SignalCandidate, like: SignalMap | None) -> SignalMap:
        name = candidate.canonical
        percent = self.in_percent(name)
        parts = self.found.companions.get(name, {}) if percent else {}
        return SignalMap(
            name,
            BusSignal(
                candidate.message, candidate.signal, candidate.unit or self.machine.units[name]
            ),
            self._noise(candidate, like),
            noise_ar=like.noise_ar if like else 0.0,
            noise_source="guess: the scatter in this log, the bus's own steps, or the shipped "
            f"{self.template}'s"
            if self.template
            else "guess: the scatter in this log, or the bus's own steps",
            source_address=candidate.sender,
            channel=candidate.channel,
            reference=self.references.get(name) if percent else None,
            reference_source=self._reference_source(name) if percent else "",
            fraction=parts.get("fraction"),
            friction=parts.get("friction"),
            period=_period(self.found.sources.get(name)),
            minimum=0.0 if like and like.minimum == 0.0 else None,  # in whatever unit
        )

    def _noise(self, candidate: SignalCandidate, like: SignalMap | None) -> float:
        """The largest of what the log shows, what steps leave, and the template's; canonical."""
        canonical = self.machine.units[candidate.canonical]
        noise = like.noise if like else 0.0
        unit = candidate.unit or canonical
        if not units.compatible(unit, canonical):
            return noise or 1.0
        scale = units.parse(unit).scale / units.parse(canonical).scale
        column = self.machine.column(candidate.canonical)
        most = column.noisiest if column else noise
        measured = min(candidate.noise * scale, most)
        return _short(max(noise, measured, candidate.step * scale / sqrt(12))) or 1.0

    def _wheel(self, wheel: BusSource, like: SignalMap | None) -> SignalMap:
        """A wheel that stands in for the shaft."""
        line = self.driveline
        gears = tuple(_short4(gear.ratio) for gear in line.gears)
        scatter = noise_of(wheel_speed(wheel.values().value, wheel.layout.unit)) * gears[0]
        step = wheel_speed(wheel.values().value[:1] * 0.0 + wheel.layout.scale, wheel.layout.unit)
        rounding = float(abs(step[0])) / sqrt(12) * gears[0] if len(step) else 0.0
        noise = max(like.noise if like else 0.0, scatter, rounding) or 1.0
        sent = line.gear
        unit = wheel.layout.unit or "rad/s"
        return SignalMap(
            line.column,
            BusSignal(wheel.message.name, wheel.layout.name, unit),
            _short(noise),
            noise_source="guess: the scatter and the bus's own steps in the first gear",
            gears=gears,
            radius=USUAL_RADIUS if line.on_the_road else None,
            gear=replace(sent.source.bus, unit="1") if sent else None,
            gear_numbers=sent.numbers if sent and not sent.counts_from_one else (),
            other=None if line.other is None else replace(line.other.bus, unit=unit),
            period=_period(wheel),
        )

    def _reference_source(self, name: str) -> str:
        """Where the torque that 100 % stands for is from."""
        if name not in self.references:
            return ""
        if name in self.stated:
            return "stated by this log"
        return f"guess: the shipped {self.machine.template}'s largest torque"

    def origin(self) -> tuple[str, ...]:
        """Where the numbers that no log shows are from, what would determine them, and whether the
        log has every signal of that vehicle."""
        words = origin_of_parameters(self.machine, self.template)
        if not words:
            return ()
        theirs = load_vehicle(self.template).signals.values()
        mine = {(c[0].message, c[0].signal) for c in self.found.candidates.values()}
        if not {(signal.bus.message, signal.bus.signal) for signal in theirs} <= mine:
            return words
        same = (
            f"the log has every signal of {self.template} by name: if it is of that very vehicle, "
            f"--vehicle {self.template} knows its numbers better"
        )
        return (*words, same)

    def missing(self) -> tuple[str, ...]:
        """What the drafted vehicle file lacks, in words."""
        words = []
        for column in self.machine.lacking(self.found.candidates):
            if column.name == self.driveline.column and self.driveline.gears:
                continue
            line = f"signals.{column.name} ({column.unit}): no signal has a matching SPN or name"
            if column.geared_by and self.driveline.wheel is not None:
                line += (
                    "; a wheel speed with gears = [ratios engine/wheel], and with radius = tyre "
                    "radius where it is in km/h or m/s, can stand in for it, but in this log it "
                    "never turns with the engine in a gear for long: "
                    + ", ".join(_shown(wheel) for wheel in self._wheels()[:4])
                )
            fitting = self.found.in_unit(column.unit)[:MOST_NAMED]
            line += f"; in such a unit: {', '.join(fitting)}" if fitting else ""
            if not units.compatible(column.unit, "%"):
                line += percents_in_words(self.found.percents())
            words.append(line)
        if not self.template:
            words += [f"parameters.{p.key} ({p.unit}): {p.what}" for p in self.machine.parameters]
        return tuple(words)

    def _wheels(self) -> tuple[BusSource, ...]:
        return self.found.wheels or tuple(w for w in (self.driveline.wheel,) if w)

    def guesses(self) -> tuple[str, ...]:
        """Numbers that the results rest on and that should be replaced first, in words."""
        words = []
        for name, reference in self.references.items():
            column = self.machine.column(name)
            spn = column.reference_spn if column else None
            if self.in_percent(name) and name not in self.stated and not self.left_out(name):
                words.append(
                    f"signals.{name}: reference = {reference:g} Nm, which 100 % stands for; the "
                    f"engine's data sheet, or SPN {spn} on the bus, states it"
                )
        return tuple(words)

    def block(self) -> list[str]:
        """The signal of the wheels as comment lines, where no gear could be learned."""
        wheel = self.driveline.wheel
        if wheel is None or self.driveline.gears:
            return []
        unit = wheel.layout.unit or "rad/s"
        lines = [
            f"[signals.{self.driveline.column}]",
            f'message = "{wheel.message.name}"',
            f'signal = "{wheel.layout.name}"',
            f'unit = "{unit}"',
            "gears = [12.0, 7.0, 4.5]       # ratios engine/wheel, first gear first",
            "noise = 0.3",
        ]
        if units.compatible(unit, ROAD):
            lines.append(f"radius = {USUAL_RADIUS}")
        return lines


def percents_in_words(names: Iterable[str]) -> str:
    """Which signals or columns in percent may be one that is missing, in words."""
    which = ", ".join(list(names)[:MOST_NAMED])
    if not which:
        return ""
    return f"; in %: {which}, which 'reference', what 100 % stands for, would convert"


def guessed_parameters(machine: Machine, template: str = "") -> dict[str, ParameterValue]:
    """Those of a shipped vehicle, the machine's template unless named, as guesses of another
    vehicle's; none without one."""
    template = template or machine.template
    if not template:
        return {}
    source = f"guess: the shipped {template}'s value"
    return {
        key: replace(p, spread=_widened(p.value, p.unit, p.spread), source=source)
        for key, p in load_vehicle(template).parameters.items()
    }


def origin_of_parameters(machine: Machine, template: str) -> tuple[str, ...]:
    """Of which shipped vehicle guessed parameters are, and what would determine them, in words."""
    if not template:
        return ()
    positions = any(p.unit == "mm" for p in machine.parameters)
    words = (
        f"parameters are those of the nearest shipped vehicle, {template}, with spreads of a third"
        f"{' (of positions 1 mm)' * positions}: torque, energies and temperatures rest on them"
    )
    ways = [(each.name, each.parameters) for each in machine.procedures]
    ways += [(each.name, each.parameters) for each in machine.experiments]
    determined = [f"{name} ({', '.join(parameters)})" for name, parameters in ways]
    if not determined:
        return (words,)
    return words, f"clutchest identify determines them from logs: {', '.join(determined)}"


def drafted_name(log: Path) -> str:
    """A vehicle's name from that of a log."""
    return re.sub(r"\W+", "_", log.name.split(".")[0])


def _period(source: BusSource | None) -> float | None:
    """The period of a message in the log, s, where its database states another one."""
    if source is None or source.message.cycle_time_s is None or source.row.period_s is None:
        return None
    ratio = source.row.period_s / source.message.cycle_time_s
    return None if abs(ratio - 1.0) < OTHER_PERIOD else _short(source.row.period_s)


def _shown(wheel: BusSource) -> str:
    unit = f" ({wheel.layout.unit})" if wheel.layout.unit else ""
    return f"{wheel.where}{unit}"


def _widened(value: float, unit: str, spread: float) -> float:
    """The spread of a value that is of another vehicle: a third of it, of a position 1 mm."""
    if spread == 0:
        return 0.0
    return max(spread, 1.0 if unit == "mm" else _short(0.3 * abs(value)))


def _short(value: float) -> float:
    return float(f"{value:.3g}")


def _short4(value: float) -> float:
    return float(f"{value:.4g}")
