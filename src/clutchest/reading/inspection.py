"""An unknown log: the ids and signals on the bus, and a vehicle file drafted from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.can import files
from clutchest.can.database import Database, DatabaseFile, load, located
from clutchest.can.deduplication import without_duplicates
from clutchest.can.frames import Frames
from clutchest.can.survey import IdStatistics, survey
from clutchest.can.transport import reassembled
from clutchest.errors import ClutchestError
from clutchest.models import machine_in_file, machine_of, shipped_machines
from clutchest.models.machine import Machine
from clutchest.paths import names_of
from clutchest.reading.candidates import SignalCandidate, search, sources_of
from clutchest.reading.drafting import Draft, drafted_name
from clutchest.reading.driveline import driveline_of
from clutchest.reading.table_formats import tables_in_words
from clutchest.reading.window import EVERYTHING, TimeWindow
from clutchest.shipped import locate_each, shipped
from clutchest.vehicle import BusSignal, dump_vehicle, load_vehicle


@dataclass(frozen=True, slots=True)
class Inspection:
    """Contents of logs and the signals of a machine among them.

    ``rows``: statistics of each id; ``draft``: what was found, and what a vehicle file would be
    made of.
    """

    logs: tuple[Path, ...]
    frames: int
    duration_s: float
    rejected: Mapping[str, int]
    rows: tuple[IdStatistics, ...]
    draft: Draft
    dbc: tuple[DatabaseFile, ...]
    warnings: tuple[str, ...]
    model_file: Path | None = None

    @property
    def machine(self) -> Machine:
        """Whose signals were searched."""
        return self.draft.machine

    @property
    def candidates(self) -> Mapping[str, tuple[SignalCandidate, ...]]:
        """Canonical name → bus signals that may be it, the most likely first."""
        return self.draft.found.candidates

    @property
    def companions(self) -> Mapping[str, Mapping[str, BusSignal]]:
        """Canonical name → key of the vehicle file → J1939 signal."""
        return self.draft.found.companions

    @property
    def wheels(self) -> tuple[str, ...]:
        """Wheel speeds, as message.signal (unit)."""
        return tuple(
            w.where + (f" ({w.layout.unit})" if w.layout.unit else "")
            for w in self.draft.found.wheels
        )

    @property
    def model(self) -> str:
        """What the drafted vehicle file calls its machine."""
        return self.model_file.name if self.model_file else self.machine.name

    @property
    def missing(self) -> tuple[str, ...]:
        """What the drafted vehicle file lacks, in words."""
        return self.draft.missing()

    def as_dict(self) -> dict[str, Any]:
        """What ``inspect.json`` holds."""
        return {
            "logs": [str(path) for path in self.logs],
            "frames": self.frames,
            "duration_s": self.duration_s,
            "frames_rejected": dict(self.rejected),
            "dbc": [str(file) for file in self.dbc],
            "ids": [{**asdict(row), "parameters": list(row.parameters)} for row in self.rows],
            "signals": {
                name: [asdict(candidate) for candidate in candidates]
                for name, candidates in self.candidates.items()
            },
            "driveline": self.draft.driveline.as_dict(),
            "modes": self.draft.driveline.thresholds(self.machine, False),
            "missing": list(self.missing),
            "guesses": list(self.draft.guesses()),
            "nearest_vehicle": self.draft.template or None,
            "warnings": list(self.warnings),
        }

    def write_vehicle(self, path: Path, target: Path) -> None:
        """A vehicle file at ``path`` that will lie at ``target``: the most likely signals, and the
        parameters of the machine's template as guesses."""
        used = {name.partition("@")[0] for name in self.draft.messages()}
        dbc = tuple(
            replace(file, path=file.path.resolve())
            for file in self.dbc
            if used & set(load([file]).messages)
        )
        vehicle = self.draft.vehicle(drafted_name(self.logs[0]), self.model, target, dbc)
        vehicle = replace(vehicle, model_file=self.model_file)
        dump_vehicle(vehicle, path, self._heading(), target)

    def _heading(self) -> str:
        lines = [
            f"Drafted by `clutchest inspect` from {names_of(self.logs)}.",
            "Every parameter is a guess; see the `source` of each.",
        ]
        lines += [f"MISSING {what}" for what in self.missing]
        lines += [f"GUESS {what}" for what in self.draft.guesses()]
        lines += self.draft.origin()
        lines += self.draft.driveline.words()
        lines += [
            f"{name}: also possible: {c.where}"
            for name, candidates in self.candidates.items()
            for c in candidates[1:4]
            if c.low is not None
        ]
        return "\n".join([*lines, *self.draft.block()])


def inspect_logs(
    paths: Sequence[str | Path],
    dbc: Sequence[str | Path | DatabaseFile] = (),
    window: TimeWindow = EVERYTHING,
    model: str = "",
) -> Inspection:
    """Survey ``paths``, logs of frames, and search for the canonical signals of a machine, by SPN,
    name, unit, range and behaviour.

    ``dbc`` names the messages: files, or shipped DBCs by name; without any all shipped ones do.
    ``model``: a machine by name or by its file (``.py``); without it, the shipped one with most
    signals in the logs.  Raises ClutchestError for a file that cannot be read, and where no id of
    the logs is in ``dbc``.
    """
    model_file = Path(model).resolve() if model.endswith(".py") else None
    asked = machine_in_file(model_file) if model_file else machine_of(model) if model else None
    logs = tuple(locate_each(map(str, paths), "logs"))
    if not logs:
        raise ClutchestError("no log to inspect")
    read = [window.of_frames(_frames(path), (str(path),)) for path in logs]
    parts = _in_sequence([frames for frames in read if len(frames)])
    if not parts:
        raise ClutchestError(f"{' '.join(map(str, logs))}: no data in the time window")
    frames = without_duplicates(Frames.concatenate(parts).sorted())
    sources = tuple(located(each) for each in dbc or shipped("dbc").values())
    databases = _databases(sources)
    rows = tuple(survey(frames, databases))
    if dbc and not any(row.message for row in rows):
        raise ClutchestError(_nothing_known(logs, sources, rows, databases))
    signals = sources_of(frames, rows, databases)
    machines = [asked] if asked else shipped_machines()
    searched = [(search(signals, machine), machine) for machine in machines]
    found, machine = max(searched, key=lambda each: len(each[0].candidates))
    references, stated = _references(frames, databases, machine)
    on_j1939 = any(source.message.is_j1939 for source in found.sources.values())
    draft = Draft(
        machine,
        found,
        driveline_of(found, machine),
        references,
        stated,
        machine.template if on_j1939 or not machine.car_template else machine.car_template,
    )
    return Inspection(
        logs,
        len(frames),
        sum(float(np.ptp(part.t_ns)) for part in parts) * 1e-9,
        {**dict(frames.rejected), **dict(frames.passed_over)},
        rows,
        draft,
        sources,
        (*frames.notes, *(warning for database in databases for warning in database.warnings)),
        model_file,
    )


def _frames(path: Path) -> Frames:
    """All frames of a log, in order of time."""
    blocks = files.read_blocks(path, tables_in_words())
    return Frames.concatenate(files.held(path, blocks)).sorted()


def _databases(sources: Sequence[DatabaseFile]) -> list[Database]:
    """One for each file; those of a channel together, since they may have names in common."""
    of_a_channel = [file for file in sources if file.channel is not None]
    together = [load(of_a_channel)] if of_a_channel else []
    return [*together, *(load([file]) for file in sources if file.channel is None)]


def _nothing_known(
    logs: Sequence[Path],
    dbc: Sequence[DatabaseFile],
    rows: Sequence[IdStatistics],
    databases: Sequence[Database],
) -> str:
    """That a DBC is of another bus, in words."""
    theirs = [m for database in databases for m in database.messages.values()]
    known = [row for row in rows if any(base.find(row.id, row.extended) for base in databases)]
    names = ", ".join(file.path.name for file in dbc)
    log = ", ".join(path.name for path in logs)
    if known:
        channels = ", ".join(map(str, sorted({row.channel for row in known})))
        return (
            f"{names}: {len(known)} of {len(rows)} ids of {log} are in it, on channel {channels}; "
            "expected --dbc N=FILE with such a channel"
        )
    extended = sum(row.extended for row in rows)
    of_them = sum(message.extended for message in theirs)
    words = (
        f"0 of {len(rows)} ids of {log} are in {names}: the log has "
        f"{_ids([(row.id, row.extended) for row in rows])}, the database "
        f"{_ids([(m.id, m.extended) for m in theirs])}"
    )
    if bool(extended) != bool(of_them):
        words += "; one has 11 bits only, the other 29"
    return words + "; is it the DBC of another bus?  Without --dbc the shipped ones are tried"


def _ids(ids: Sequence[tuple[int, bool]]) -> str:
    shown = [f"{i:08X}" if extended else f"{i:03X}" for i, extended in sorted(ids)[:4]]
    return ", ".join(shown) + (" …" if len(ids) > 4 else "") if shown else "none"


def _references(
    frames: Frames, databases: Sequence[Database], machine: Machine
) -> tuple[dict[str, float], frozenset[str]]:
    """Canonical name → torque that 100 % stands for, Nm, as a message states it or, without one, as
    a guess; and the names of those that are stated."""
    wanted = {c.name: c.reference_spn for c in machine.columns if c.reference_spn}
    if not wanted:
        return {}, frozenset()
    known = [*databases, *(load([path]) for path in shipped("dbc").values())]
    messages = {m.name: m for database in known for m in database.messages.values()}
    carrying = [
        m for m in messages.values() if any(s.spn in wanted.values() for s in m.signals.values())
    ]
    whole = reassembled(frames, carrying)
    read: dict[int, float] = {}
    for source in sources_of(whole, survey(whole, known), known):
        spn = source.layout.spn
        if spn is not None and spn in wanted.values() and spn not in read:
            value = source.values().value
            if len(value) and float(np.median(value)) > 0.0:
                read[spn] = float(np.median(value))
    guess = _largest_torque(machine)
    references = {name: read.get(spn, guess) for name, spn in wanted.items()}
    references = {name: value for name, value in references.items() if value}
    return references, frozenset(name for name, spn in wanted.items() if spn in read)


def _largest_torque(machine: Machine) -> float:
    """The template's largest torque, Nm, to which the magnitudes of its torques are relative."""
    of = {c.magnitude.of for c in machine.columns if c.magnitude and c.magnitude.of}
    if not machine.template or not of:
        return 0.0
    return load_vehicle(machine.template).parameters[of.pop()].value


def _in_sequence(parts: Sequence[Frames]) -> list[Frames]:
    """Logs whose clocks count from their own start, one after another; others as they are."""
    if all(part.absolute for part in parts):
        return list(parts)
    placed, end = [], 0
    for part in parts:
        placed.append(replace(part, t_ns=part.t_ns - part.t_ns.min() + end))
        end = int(placed[-1].t_ns.max()) + 1
    return placed
