"""Drives as records of benches: by what is stated, else by what the machine makes of the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from clutchest.checked import check
from clutchest.errors import ClutchestError, nearest
from clutchest.estimate.other_bench import bench_record
from clutchest.models.experiments import Benches, BenchRecord, BenchSection
from clutchest.reading.bench_metadata import stated_benches
from clutchest.shipped import locate
from clutchest.shown import counted
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

Stated = Sequence[tuple[BenchSection, ...]]  # of each drive; empty where nothing is stated


@dataclass(frozen=True, slots=True)
class BenchRecords:
    """All records of some drives, notes on how their benches are known, and of each record the
    drive and the section that it is."""

    records: tuple[BenchRecord, ...]
    notes: tuple[str, ...]
    sections: tuple[tuple[Signals, BenchSection], ...]

    def on(self, benches: Sequence[str]) -> tuple[BenchRecord, ...]:
        """Those of some benches."""
        return tuple(record for record in self.records if record.bench in benches)

    @property
    def benches(self) -> list[str]:
        """Every bench there is a record of."""
        return list(dict.fromkeys(record.bench for record in self.records))


def bench_records(signals: Signals, vehicle: Vehicle, stated: Stated = ()) -> BenchRecords:
    """The records of all drives.  ``stated``: benches of each drive, guessed where there are none.

    Raises ClutchestError where the machine has no benches.
    """
    benches = vehicle.machine.benches
    if benches is None:
        raise ClutchestError(f"machine '{vehicle.machine.name}' declares no benches")
    records, notes, parts = [], [], []
    for i, drive in enumerate(signals.drives):
        whole = bench_record(drive, vehicle)
        sections = stated[i] if i < len(stated) else ()
        if not sections:
            sections = benches.guess(whole)
            notes.append(_guessed(drive, sections, benches))
        for section in sections:
            check("benches", section, BenchSection)
            of = whole.between(section.start, section.end)
            records.append(replace(of, bench=section.bench))
            parts.append((drive, section))
    return BenchRecords(tuple(records), tuple(notes), tuple(parts))


def look_otherwise(records: BenchRecords, vehicle: Vehicle, *, partly: bool = False) -> list[str]:
    """In words, every drive whose data look like none of the benches that its records are of; with
    ``partly`` every one whose data look like one more bench, too."""
    benches = vehicle.machine.benches
    assert benches is not None
    of: dict[int, tuple[Signals, set[str]]] = {}
    for drive, section in records.sections:
        of.setdefault(id(drive), (drive, set()))[1].add(section.bench)
    words = []
    for drive, stated in of.values():
        looks = dict.fromkeys(s.bench for s in benches.guess(bench_record(drive, vehicle)))
        if (set(looks) - stated) if partly else (looks and not stated & set(looks)):
            known, seen = (", ".join(names) for names in (sorted(stated), looks))
            words.append(f"{_names(drive)} is stated to be of bench {known}, but looks like {seen}")
    return words


def stated_sections(
    drives: Signals, logs: Sequence[str], names: Sequence[str], vehicle: Vehicle
) -> Stated:
    """The benches of every drive: ``names`` one for all ``logs`` or one for each, else as
    ``simulate`` wrote them beside a log; empty where neither says.

    Raises ClutchestError for another number of names, or one that is no bench.
    """
    _check_names(names, vehicle)
    if not names:
        return [stated_benches(drive) for drive in drives.drives]
    if len(names) not in (1, len(logs)):
        raise ClutchestError(
            f"{len(names)} benches for {counted(len(logs), 'log')}, expected one, or one for each"
        )
    sources = [str(locate(log, "logs")) for log in logs]
    named = dict(zip(sources, list(names) * len(logs), strict=False))
    every = [{named.get(s, names[0]) for s in drive.sources} for drive in drives.drives]
    for drive, of in zip(drives.drives, every, strict=True):
        if len(of) > 1:
            raise ClutchestError(
                f"{' '.join(drive.sources)}: pieces of one drive on {len(of)} benches"
            )
    return [(BenchSection(-inf, inf, of.pop()),) for of in every]


def sections_by_name(
    names: Sequence[str], drives: Sequence[Signals], vehicle: Vehicle
) -> list[tuple[BenchSection, ...]]:
    """The same, with ``names`` one for all drives or one for each."""
    _check_names(names, vehicle)
    if not names:
        return [stated_benches(drive) for drive in drives]
    if len(names) not in (1, len(drives)):
        raise ClutchestError(
            f"benches: {len(names)} for {counted(len(drives), 'drive')}, expected one, or one "
            "for each"
        )
    of_all = [*names] * (len(drives) if len(names) == 1 else 1)
    return [(BenchSection(-inf, inf, name),) for name in of_all]


def _check_names(names: Sequence[str], vehicle: Vehicle) -> None:
    """Raises ClutchestError for one that is no bench of the machine."""
    benches = vehicle.machine.benches
    for name in names:
        if benches is None or name not in benches.names:
            raise ClutchestError(
                f"bench: machine '{vehicle.machine.name}' has no bench '{name}'"
                + nearest(name, benches.names if benches else ())
            )


def _names(drive: Signals) -> str:
    return " ".join(source.rpartition("/")[2] for source in drive.sources) or "the log"


def _guessed(drive: Signals, sections: Sequence[BenchSection], benches: Benches) -> str:
    names = _names(drive)
    if not sections:
        return f"{names}: neither current nor motion, so that no bench is recognised"
    words = [
        f"{section.bench} ({benches.names[section.bench]}) from {section.start:.0f} to "
        f"{section.end:.0f} s"
        for section in sections
    ]
    return f"{names}: bench guessed from the data: {', '.join(words)}; --bench states it"
