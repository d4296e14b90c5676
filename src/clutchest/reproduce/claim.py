"""What a paper states, judged on a computation that could have come out otherwise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from clutchest import __version__
from clutchest.vehicle import Vehicle

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Verdict:
    """What came out: in words, as ``numbers`` in the units their names say, whether that is what
    the paper states, and ``data`` for its figure."""

    obtained: str
    passed: bool
    numbers: Mapping[str, float] = field(default_factory=dict)
    data: Any = None


@dataclass(frozen=True, slots=True)
class Claim(Generic[S]):
    """One row: ``stated`` by the paper in its ``figure``; ``judge`` redoes it in a setup.

    ``without``: mechanism → the setup that lacks it, in which the claim must fail; a claim that
    cannot fail is none.  ``strained_by`` names the imperfections of the data that it must bear.
    """

    name: str
    what: str
    figure: str
    stated: str
    judge: Callable[[S], Verdict]
    without: Mapping[str, Callable[[S], S]]
    strained_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Margin:
    """An imperfection of ``size`` may grow to ``holds_at`` before the row fails; ``fails_at`` is
    the next larger size tried, None where it held as far as was tried."""

    size: float
    holds_at: float
    fails_at: float | None


def judged(claim: Claim[S], setup: S, margins: Mapping[str, Margin]) -> Row:
    """The claim in ``setup``, and without each of its mechanisms."""
    without = {name: claim.judge(lacking(setup)) for name, lacking in claim.without.items()}
    return Row(claim, claim.judge(setup), without, margins)


def margin(judge: Callable[[float], Verdict], size: float, most: float = 16.0) -> Margin:
    """How far an imperfection of ``size`` may grow while ``judge(size)`` passes: doubled until it
    fails, at most ``most`` times, then between the last two."""
    holds, fails = size, None
    while fails is None and holds < most * size:
        grown = 2.0 * holds
        if judge(grown).passed:
            holds = grown
        else:
            fails = grown
    for _ in range(2 if fails is not None else 0):
        assert fails is not None
        middle = (holds + fails) / 2.0
        if judge(middle).passed:
            holds = middle
        else:
            fails = middle
    return Margin(size, holds, fails)


@dataclass(frozen=True, slots=True)
class Row:
    """A claim judged: as it is, and without each of its mechanisms."""

    claim: Claim[Any]
    verdict: Verdict
    without: Mapping[str, Verdict]
    margins: Mapping[str, Margin] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether what the paper states came out, and would not have without its mechanisms."""
        return self.verdict.passed and not any(v.passed for v in self.without.values())

    def as_dict(self) -> dict[str, Any]:
        """The row in ``table.json``."""
        return {
            "row": self.claim.name,
            "what": self.claim.what,
            "figure": self.claim.figure,
            "stated": self.claim.stated,
            "obtained": self.verdict.obtained,
            "pass": self.passed,
            "numbers": self.verdict.numbers,
            "without": {
                name: {"obtained": v.obtained, "pass": v.passed} for name, v in self.without.items()
            },
            "imperfections": {
                name: {"size": m.size, "holds_at": m.holds_at, "fails_at": m.fails_at}
                for name, m in self.margins.items()
            },
        }


@dataclass(frozen=True, slots=True)
class Reproduction:
    """All rows of one paper.  ``draw`` writes its figures into a folder; ``imperfections`` of the
    data: name → (size, unit, what)."""

    paper: str
    title: str
    vehicle: Vehicle
    rows: tuple[Row, ...]
    imperfections: Mapping[str, tuple[float, str, str]]
    notes: tuple[str, ...]
    draw: Callable[[Path], None]

    @property
    def passed(self) -> bool:
        """Whether every row passed."""
        return all(row.passed for row in self.rows)

    def as_dict(self) -> dict[str, Any]:
        """The contents of ``table.json``."""
        return {
            "paper": self.paper,
            "title": self.title,
            "clutchest": __version__,
            "vehicle": self.vehicle.name,
            "vehicle_hash": self.vehicle.hash,
            "pass": self.passed,
            "rows": [row.as_dict() for row in self.rows],
            "imperfections": {
                name: {"size": size, "unit": unit, "what": what}
                for name, (size, unit, what) in self.imperfections.items()
            },
            "notes": list(self.notes),
        }
