"""One line of the table that the suite is judged by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import binomtest

NOMINAL = 0.01  # rate of false findings

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Row:
    """One line of the table: ``value`` with its exact 95 % interval (99 % for nulls) from ``count``
    cases; ``passed`` None where nothing was measured, ``refuted`` where nothing within the interval
    would pass."""

    what: str
    must: str
    count: int = 0
    value: float | None = None
    low: float | None = None
    high: float | None = None
    passed: bool | None = None
    refuted: bool = False


def share(
    what: str, must: str, hits: Sequence[bool], test: Callable[[float], bool], level: float = 0.95
) -> Row:
    """A row for a share of cases, judged on the share itself."""
    if not len(hits):
        return Row(what, must)
    k, n = int(np.sum(hits)), len(hits)
    limits = binomtest(k, n).proportion_ci(level, "exact")
    low, high = float(limits.low), float(limits.high)
    refuted = not any(test(p) for p in np.linspace(low, high, 101))
    return Row(what, must, n, k / n, low, high, test(k / n), refuted)


def false_findings(what: str, records: Sequence[Record]) -> Row:
    """Healthy drives in which anything is found, with a 99 % interval that should hold 1 %."""
    hits = [r["verdict"] != "none" for r in records]
    row = share(what, "does not reject 1 %", hits, lambda _: True, 0.99)
    if row.low is None or row.high is None:
        return row
    passed = row.low <= NOMINAL <= row.high
    return replace(row, passed=passed, refuted=not passed)
