"""The drives in one table: cut at long gaps, as CAN logs are."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from clutchest.signals import Counts, Signals


def drives_of(signals: Signals, gap: float) -> list[Signals]:
    """The drives in one table, cut where no signal has a sample for more than ``gap`` s: a parked
    vehicle, a clock that was set, or a wrong time."""
    times = [signal.time for signal in signals.values() if len(signal)]
    time = np.unique(np.concatenate(times)) if times else np.zeros(0)
    cuts = time[1:][np.diff(time) > gap]
    if not len(cuts):
        return [signals]
    edges = [-np.inf, *cuts.tolist(), np.inf]
    return [_part(signals, first, stop) for first, stop in pairwise(edges)]


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
