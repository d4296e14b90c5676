"""An unknown log: the ids and signals on the bus, and a vehicle file drafted from them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np

from clutchest import units
from clutchest.can import files
from clutchest.can.database import Database, Message, SignalLayout, load
from clutchest.can.decode import decode, rows_of
from clutchest.can.frames import Frames
from clutchest.can.survey import IdStatistics, survey
from clutchest.errors import ClutchestError
from clutchest.models import machine_in_file, machine_of, shipped_machines
from clutchest.models.machine import Machine
from clutchest.models.symbols import Column
from clutchest.reading.window import EVERYTHING, TimeWindow
from clutchest.shipped import locate, shipped
from clutchest.signals import Why
from clutchest.vehicle import (
    BusSignal,
    ParameterValue,
    SignalMap,
    Vehicle,
    dump_vehicle,
    load_vehicle,
)

_WHEEL = re.compile(r"wh(ee)?l\w*(speed|spd|_w_)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class SignalCandidate:
    """A bus signal that may be ``canonical``, and its values in this log.

    ``by``: whether its SPN or its name matches; ``low`` and ``high`` in the bus unit over the valid
    samples, None without any; ``valid`` their share; ``step`` of the raw value, bus unit;
    ``sender`` (J1939 source address) and ``channel`` where the message has several.
    """

    canonical: str
    message: str
    signal: str
    unit: str
    by: Literal["SPN", "name"]
    valid: float
    low: float | None
    high: float | None
    step: float
    sender: int | None = None
    channel: int | None = None

    @property
    def where(self) -> str:
        """Message and signal, with the sender where there are several."""
        sender = "" if self.sender is None else f" from address 0x{self.sender:02X}"
        return f"{self.message}.{self.signal}{sender}"

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """The larger, the more likely: a signal that varies, with the SPN, rarely invalid."""
        varies = self.low is not None and self.high is not None and self.high > self.low
        return varies, self.by == "SPN", self.valid


@dataclass(frozen=True, slots=True)
class Inspection:
    """Contents of logs and the signals of a machine among them.

    ``rows``: statistics of each id; ``candidates`` by canonical name, the most likely first;
    ``wheels``: wheel speeds, as message.signal; ``companions``: canonical name → key of the vehicle
    file → J1939 signal.
    """

    logs: tuple[Path, ...]
    frames: int
    duration_s: float
    rejected: Mapping[str, int]
    rows: tuple[IdStatistics, ...]
    candidates: Mapping[str, tuple[SignalCandidate, ...]]
    wheels: tuple[str, ...]
    companions: Mapping[str, Mapping[str, BusSignal]]
    dbc: tuple[Path, ...]
    warnings: tuple[str, ...]
    machine: Machine
    model_file: Path | None = None

    @property
    def model(self) -> str:
        """What the drafted vehicle file calls its machine."""
        return self.model_file.name if self.model_file else self.machine.name

    @property
    def missing(self) -> tuple[str, ...]:
        """What the drafted vehicle file lacks, in words."""
        optional = self.machine.optional_columns
        missing = []
        for column in self.machine.columns:
            if column.name not in self.candidates and column.name not in optional:
                missing.append(self._missing_signal(column))
            if column.name not in optional and self._needs_reference(column):
                missing.append(
                    f'signals.{column.name}: reference = {{ value = …, unit = "{column.unit}" }}, '
                    f"the {column.unit} that 100 % stands for (J1939: SPN {column.reference_spn})"
                )
        if not self.machine.template:
            missing += [f"parameters.{p.key} ({p.unit}): {p.what}" for p in self.machine.parameters]
        return tuple(missing)

    def _needs_reference(self, column: Column) -> bool:
        """Whether the likeliest candidate is in percent of a torque that no signal states."""
        found = self.candidates.get(column.name)
        return bool(column.reference_spn and found and found[0].unit == "%")

    def _missing_signal(self, column: Column) -> str:
        words = f"signals.{column.name} ({column.unit}): no signal has a matching SPN or name"
        if column.geared_by and self.wheels:
            words += (
                "; a wheel speed with gears = [ratios engine/wheel], and with radius = tyre radius "
                "where it is in km/h or m/s, can stand in for it: " + ", ".join(self.wheels[:4])
            )
        return words

    def as_dict(self) -> dict[str, Any]:
        """What ``inspect.json`` holds."""
        return {
            "logs": [str(path) for path in self.logs],
            "frames": self.frames,
            "duration_s": self.duration_s,
            "frames_rejected": dict(self.rejected),
            "dbc": [str(path) for path in self.dbc],
            "ids": [asdict(row) for row in self.rows],
            "signals": {
                name: [asdict(candidate) for candidate in candidates]
                for name, candidates in self.candidates.items()
            },
            "missing": list(self.missing),
            "warnings": list(self.warnings),
        }

    def write_vehicle(self, path: Path, target: Path) -> None:
        """A vehicle file at ``path`` that will lie at ``target``: the most likely signals, and the
        parameters of the machine's template as guesses.  It loads once what its heading lists as
        missing is filled in."""
        template = load_vehicle(self.machine.template) if self.machine.template else None
        like = template.signals if template else {}
        signals = {
            name: self._map(candidates[0], like.get(name))
            for name, candidates in self.candidates.items()
            if not self._left_out(name)
        }
        parameters = guessed_parameters(self.machine)
        name = re.sub(r"\W+", "_", self.logs[0].name.split(".")[0])
        used = {candidate.message for each in self.candidates.values() for candidate in each[:1]}
        dbc = tuple(path.resolve() for path in self.dbc if used & set(load([path]).messages))
        vehicle = Vehicle(
            name, self.model, target, "", dbc, signals, parameters, model_file=self.model_file
        )
        dump_vehicle(vehicle, path, self._heading(), target)

    def _left_out(self, name: str) -> bool:
        """Whether a signal that is not needed cannot be used as it is."""
        column = self.machine.column(name)
        optional = name in self.machine.optional_columns
        return optional and column is not None and self._needs_reference(column)

    def _heading(self) -> str:
        lines = [
            f"Drafted by `clutchest inspect` from {', '.join(p.name for p in self.logs)}.",
            "Every parameter is a guess; see the `source` of each.",
        ]
        lines += [f"MISSING {what}" for what in self.missing]
        lines += [
            f"{name}: also possible: {c.where}"
            for name, candidates in self.candidates.items()
            for c in candidates[1:4]
            if c.low is not None
        ]
        return "\n".join(lines)

    def _map(self, candidate: SignalCandidate, like: SignalMap | None) -> SignalMap:
        column_unit = self.machine.units[candidate.canonical]
        noise = like.noise if like else 0.0
        if units.compatible(candidate.unit or column_unit, column_unit):
            scale = (
                units.parse(candidate.unit or column_unit).scale / units.parse(column_unit).scale
            )
            rounding = candidate.step * scale / sqrt(12)  # of a signal on a bus of such steps
            noise = noise if noise > rounding else _short(rounding)
        parts = self.companions.get(candidate.canonical, {})
        whose = f"the shipped {self.machine.template}'s, or " if self.machine.template else ""
        return SignalMap(
            candidate.canonical,
            BusSignal(candidate.message, candidate.signal, candidate.unit or column_unit),
            noise,
            noise_ar=like.noise_ar if like else 0.0,
            noise_source=f"guess: {whose}the bus's own steps",
            source_address=candidate.sender,
            channel=candidate.channel,
            fraction=parts.get("fraction"),
            friction=parts.get("friction"),
        )


def inspect_logs(
    paths: Sequence[str | Path],
    dbc: Sequence[Path] = (),
    window: TimeWindow = EVERYTHING,
    model: str = "",
) -> Inspection:
    """Survey ``paths``, logs of frames, and search for the canonical signals of a machine, by SPN
    and by name.

    ``dbc`` names the messages; without any the shipped DBCs do.  ``model``: a machine by name or by
    its file (``.py``); without it, the shipped one with most signals in the logs.  Raises
    ClutchestError for a file that cannot be read.
    """
    model_file = Path(model).resolve() if model.endswith(".py") else None
    asked = machine_in_file(model_file) if model_file else machine_of(model) if model else None
    logs = tuple(locate(str(path), "logs") for path in paths)
    if not logs:
        raise ClutchestError("no log to inspect")
    read = [window.of_frames(files.read_frames(path).sorted(), (str(path),)) for path in logs]
    parts = _in_sequence([frames for frames in read if len(frames)])
    if not parts:
        raise ClutchestError(f"{' '.join(map(str, logs))}: no data in the time window")
    frames = Frames.concatenate(parts).sorted()
    sources = tuple(dbc) or tuple(shipped("dbc").values())
    databases = [load([path]) for path in sources]
    rows = tuple(survey(frames, databases))
    machines = [asked] if asked else shipped_machines()
    searched = [(_search(frames, rows, databases, machine), machine) for machine in machines]
    search, machine = max(searched, key=lambda each: len(each[0].candidates))
    duration = sum(float(np.ptp(part.t_ns)) for part in parts) * 1e-9
    return Inspection(
        logs,
        len(frames),
        duration,
        dict(frames.rejected),
        rows,
        search.candidates,
        search.wheels,
        search.companions,
        sources,
        (*frames.notes, *(warning for database in databases for warning in database.warnings)),
        machine,
        model_file,
    )


def _in_sequence(parts: Sequence[Frames]) -> list[Frames]:
    """Logs whose clocks count from their own start, one after another; others as they are."""
    if all(part.absolute for part in parts):
        return list(parts)
    placed, end = [], 0
    for part in parts:
        placed.append(replace(part, t_ns=part.t_ns - part.t_ns.min() + end))
        end = int(placed[-1].t_ns.max()) + 1
    return placed


@dataclass(frozen=True, slots=True)
class _Search:
    """Candidates by canonical name, wheel speeds, and by canonical name the J1939 signals that
    belong to it."""

    candidates: Mapping[str, tuple[SignalCandidate, ...]]
    wheels: tuple[str, ...]
    companions: Mapping[str, Mapping[str, BusSignal]]


def _search(
    frames: Frames,
    rows: Sequence[IdStatistics],
    databases: Sequence[Database],
    machine: Machine,
) -> _Search:
    candidates: dict[str, list[SignalCandidate]] = {}
    wheels: list[str] = []
    companions: dict[str, dict[str, BusSignal]] = {}
    optional = machine.optional_columns
    for row in rows:
        known = [database.find(row.id, row.extended) for database in databases]
        message = next((m for m in known if m), None)
        if message is None:
            continue
        twins = [other for other in rows if other.message == message.name]
        for layout in message.signals.values():
            for column in machine.columns:
                if by := _matched_by(layout, column):
                    candidates.setdefault(column.name, []).append(
                        _candidate(frames, row, twins, message, layout, column.name, by)
                    )
                for part, spn in column.companions.items():
                    if layout.spn == spn:
                        companion = BusSignal(message.name, layout.name, layout.unit or "%")
                        companions.setdefault(column.name, {})[part] = companion
            if _WHEEL.search(layout.name) and (_fits(layout, "rad/s") or _fits(layout, "m/s")):
                unit = f" ({layout.unit})" if layout.unit else ""
                wheels.append(f"{message.name}.{layout.name}{unit}")
    ranked = {
        name: tuple(sorted(candidates[name], key=lambda c: c.rank, reverse=True))
        for name in machine.units
        if name in candidates
        and not (name in optional and all(c.low is None for c in candidates[name]))
    }
    return _Search(ranked, tuple(dict.fromkeys(wheels)), companions)


def _matched_by(layout: SignalLayout, column: Column) -> Literal["SPN", "name"] | None:
    """Whether the SPN or the name of ``layout`` matches the canonical signal; None if neither."""
    if column.spn and layout.spn:
        return "SPN" if layout.spn == column.spn else None
    named = column.named or rf"^{re.escape(column.name)}$"
    by_name = re.search(named, layout.name, re.IGNORECASE) and _fits(layout, column.unit)
    return "name" if by_name else None


def _fits(layout: SignalLayout, unit: str) -> bool:
    try:
        return not layout.unit or units.compatible(layout.unit, unit)
    except ClutchestError:  # a unit that only this DBC knows
        return False


def _candidate(
    frames: Frames,
    row: IdStatistics,
    twins: Sequence[IdStatistics],
    message: Message,
    layout: SignalLayout,
    canonical: str,
    by: Literal["SPN", "name"],
) -> SignalCandidate:
    several_channels = len({twin.channel for twin in twins}) > 1
    several_senders = message.is_j1939 and len({twin.id for twin in twins}) > 1
    here = rows_of(frames, message, row.channel)
    here = here[frames.id[here] == row.id]
    column = decode(frames, here, message, [layout.name])[layout.name]
    value = column.value[column.why == Why.VALID]
    return SignalCandidate(
        canonical,
        message.name,
        layout.name,
        layout.unit,
        by,
        valid=len(value) / max(len(column.value), 1),
        low=float(value.min()) if len(value) else None,
        high=float(value.max()) if len(value) else None,
        step=abs(float(layout.scale)),
        sender=row.id & 0xFF if several_senders else None,
        channel=row.channel if several_channels else None,
    )


def guessed_parameters(machine: Machine) -> dict[str, ParameterValue]:
    """Those of the machine's template, as guesses of another vehicle's; none without one."""
    if not machine.template:
        return {}
    source = f"guess: the shipped {machine.template}'s value"
    return {
        key: replace(p, spread=_widened(p.value, p.unit, p.spread), source=source)
        for key, p in load_vehicle(machine.template).parameters.items()
    }


def _widened(value: float, unit: str, spread: float) -> float:
    """The spread of a value that is of another vehicle: a third of it, of a position 1 mm."""
    if spread == 0:
        return 0.0
    return max(spread, 1.0 if unit == "mm" else _short(0.3 * abs(value)))


def _short(value: float) -> float:
    return float(f"{value:.3g}")
