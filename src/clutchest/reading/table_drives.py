"""The drives in one table: cut at long gaps, as CAN logs are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np

from clutchest.signals import Counts, Floats, Signals


def drives_of(signals: Signals, gap: float) -> list[Signals]:
    """The drives in one table, cut where no signal has a sample for more than ``gap`` s: a parked
    vehicle, a clock that was set, or a wrong time."""
    spans = sorted(span for signal in signals.values() for span in _spans(signal.time, gap))
    ends = accumulate((last for _, last in spans), max)
    cuts = [first for (first, _), end in zip(spans[1:], ends, strict=False) if first - end > gap]
    if not cuts:
        return [signals]
    edges = [-np.inf, *cuts, np.inf]
    return [_part(signals, first, stop) for first, stop in pairwise(edges)]


def _spans(time: Floats, gap: float) -> Iterator[tuple[float, float]]:
    """First and last of the times (n) in order between two gaps."""
    cuts = np.flatnonzero(np.diff(time) > gap) + 1
    for first, stop in pairwise([0, *cuts.tolist(), len(time)]):
        if first < stop:
            yield float(time[first]), float(time[stop - 1])


def _part(signals: Signals, first: float, stop: float) -> Signals:
    """The samples from ``first`` up to ``stop``, on a clock of their own."""
    begin = max(first, 0.0)
    parts = {
        name: replace(piece, time=piece.time - begin)
        for name, signal in signals.items()
        if len(piece := signal.take((signal.time >= first) & (signal.time < stop)))
    }
    rows = len(np.unique(np.concatenate([piece.time for piece in parts.values()])))
    whole = first == -np.inf  # what the file as a whole lost is counted once
    start = signals.start_ns
    return replace(
        signals,
        signals=parts,
        start_ns=None if start is None else start + round(begin * 1e9),
        end=max(float(piece.time[-1]) for piece in parts.values()),
        counts=Counts(rows, rows, signals.counts.rejected if whole else {}),
        warnings=signals.warnings if whole else (),
    )
