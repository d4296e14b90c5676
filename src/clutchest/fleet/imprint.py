"""Which logs hold the same drive, and which clocks contradict each other.

One drive may stand in several files: a copy, a conversion to another format, a table of its
signals.  Counted twice it would falsify the wear per energy.  Conversions round, and tables have
other time stamps, so drives are compared by the mean and standard deviation of every signal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.signals import Signals

ROUNDING = 1e-3  # of a signal's standard deviation, its mean and that may differ by
CONSTANT = 1e-6  # of its value, a signal that does not change
NEAR_S = 1.5  # between two begins that are the same: some headers state whole seconds
FEWEST = 2  # signals in common


@dataclass(frozen=True, slots=True)
class Imprint:
    """One drive of the file ``log``: ``start_ns`` since the epoch, None where that is not known,
    ``duration_s``, and of every signal (mean, standard deviation) in its unit."""

    log: str
    start_ns: int | None
    duration_s: float
    moments: Mapping[str, Sequence[float]]

    @classmethod
    def of(cls, drive: Signals, log: Path) -> Imprint:
        """That of a drive."""
        moments = {}
        for name, signal in drive.items():
            value = signal.only_valid().value
            if len(value) and np.isfinite(std := float(np.std(value))):
                moments[name] = (float(np.mean(value)), std)
        return cls(str(log), drive.start_ns, float(drive.end), moments)

    @property
    def end_ns(self) -> float:
        """When it ends; -inf where that is not known."""
        return -np.inf if self.start_ns is None else self.start_ns + self.duration_s * 1e9

    def is_of_drive(self, other: Imprint) -> bool:
        """Whether both are of one drive."""
        begins = [k.start_ns for k in (self, other) if k.start_ns is not None]
        if max(begins, default=0) - min(begins, default=0) > NEAR_S * 1e9:
            return False
        both = self.moments.keys() & other.moments.keys()
        return (
            len(both) >= FEWEST
            and abs(self.duration_s - other.duration_s) <= NEAR_S
            and all(_alike(self.moments[name], other.moments[name]) for name in both)
        )


@dataclass(frozen=True, slots=True)
class Passed:
    """What a vehicle's logs so far leave to the next one: ``state``, as ``Run.final``, and the
    drives in them."""

    state: dict[str, Any] | None = None
    drives: tuple[Imprint, ...] = ()

    def after(self, row: Mapping[str, Any]) -> Passed:
        """With one more log, whose ``row`` is given."""
        more = tuple(Imprint(**each) for each in row.get("imprints", ()))
        return Passed(row["state"], (*self.drives, *more))

    def known(self, drives: Sequence[Imprint]) -> str | None:
        """The first log with the same ``drives``; None unless all of them are known."""
        found = [next((k.log for k in self.drives if k.is_of_drive(d)), None) for d in drives]
        return found[0] if found and all(found) else None

    def ends_after(self, start_ns: int | None) -> bool:
        """Whether some drive so far ends after ``start_ns``, where both clocks are known."""
        return start_ns is not None and any(k.end_ns > start_ns for k in self.drives)


def rows_of(drives: Sequence[Imprint]) -> list[dict[str, Any]]:
    """Ready for JSON."""
    return [asdict(drive) for drive in drives]


def _alike(a: Sequence[float], b: Sequence[float]) -> bool:
    spread = max(a[1], b[1])
    least = CONSTANT * max(abs(a[0]), abs(b[0]))
    return abs(a[0] - b[0]) <= ROUNDING * spread + least and abs(a[1] - b[1]) <= (
        ROUNDING * spread + least
    )
