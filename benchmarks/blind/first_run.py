"""The main lines of the table: every case of its kind, each as it came out the first time, none
left out for what its drive could show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from blind.drives import NOISES
from blind.plan import ALL
from blind.row import Record, Row, false_findings, share
from clutchest.generator import GROUPS

FOUND = ("named", "ambiguous", "unknown")


def first_run(records: Sequence[Record]) -> list[Row]:
    """Every such line."""
    return [
        *nulls(records),
        *mismatches(records),
        *effects(records),
        *_outsiders(records, "outsider", "outsiders"),
        *_outsiders(records, "near-miss", "near misses"),
    ]


def nulls(records: Sequence[Record]) -> list[Row]:
    """The model's own structure, nothing hidden."""
    of = [r for r in records if r["part"] == "null"]
    return [
        *_by("noise", of, NOISES, "false findings"),
        false_findings("false findings, all noises", of),
    ]


def mismatches(records: Sequence[Record]) -> list[Row]:
    """Healthy trucks that differ from the model as ordinary vehicles do."""
    of, what = [r for r in records if r["part"] == "mismatch"], "false findings, unlike the model"
    return [
        *_by("cause", of, (*GROUPS, ALL), what),
        false_findings(f"{what}, pooled", of),
    ]


def _by(key: str, of: Sequence[Record], values: Iterable[str], what: str) -> list[Row]:
    return [false_findings(f"{what}, {v}", [r for r in of if r[key] == v]) for v in values]


def effects(records: Sequence[Record]) -> list[Row]:
    """Effects of the library, alone and in pairs; a cause whose form is refuted is not right."""
    one = [r for r in records if r["part"] == "effect" and r["verdict"] in FOUND]
    two = [r for r in records if r["part"] == "two"]
    library = [r for r in records if r["part"] in ("effect", "two")]
    return [
        share("all detected effects: named right", "", [right(r) for r in one], _any),
        share(
            "all detected effects: truth named or in the set",
            "",
            [r["truth"][0] in r["causes"] for r in one],
            _any,
        ),
        share("all pairs: both named", "", [right(r) for r in two], _any),
        share(
            "all effects and pairs: called unknown",
            "≤ 3 %",
            [r["verdict"] == "unknown" for r in library],
            lambda p: p <= 0.03,
        ),
        share(
            "all effects and pairs: form refuted",
            "≤ 3 %",
            [bool(r.get("refuted")) for r in library],
            lambda p: p <= 0.03,
        ),
    ]


def _outsiders(records: Sequence[Record], part: str, what: str) -> list[Row]:
    return placed([r for r in records if r["part"] == part], f"all {what}")


def placed(of: Sequence[Record], what: str) -> list[Row]:
    """How causes that are in no library are called, and where they are said to be."""
    return [
        share(
            f"{what}: unknown, or form refuted",
            "≥ 90 %",
            [unexplained(r) for r in of],
            lambda p: p >= 0.90,
        ),
        share(f"{what}: equation", "≥ 85 %", [at_equation(r) for r in of], lambda p: p >= 0.85),
        share(
            f"{what}: driver in the first two",
            "≥ 80 %",
            [at_driver(r, r["drivers"]) for r in of],
            lambda p: p >= 0.80,
        ),
    ]


def right(record: Record) -> bool:
    """Whether all that is hidden is named, nothing else, and no form of it refuted."""
    named = record["verdict"] == "named" and set(record["causes"]) == set(record["truth"])
    return named and not record.get("refuted")


def unexplained(record: Record) -> bool:
    """Whether it is said that no effect explains the drive as it stands."""
    refuted = record["verdict"] == "named" and bool(record.get("refuted"))
    return record["verdict"] == "unknown" or refuted


def at_equation(record: Record) -> bool:
    """Whether the equation is one of those that say where the cause acts."""
    where = record["expected_where"]
    return record["equation"] in where.get("equations", [where["equation"]])


def at_driver(record: Record, drivers: Sequence[str] | None) -> bool:
    """Whether a true driver is among the first two."""
    return bool(set(record["expected_where"]["drivers"]) & set((drivers or [])[:2]))


def _any(_: float) -> bool:
    return True
