"""Segmentation of a log at gaps in which the clutch may have slipped unobserved.

Temperatures are simulated from the inputs alone: the heat of an unobserved slip would be missing
from there on, and look like a cause.  So the data after such a gap are a drive of their own, with
initial states of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from clutchest.estimate.drive_setup import DriveSetup, usable
from clutchest.estimate.timeline import regimes
from clutchest.estimate.whole_log import delays
from clutchest.signals import Signal, Signals
from clutchest.vehicle import Vehicle

UNOBSERVED = 1.5  # s; a clutch that slips at neither end of a shorter gap did not slip within
SHORTEST = 5.0  # s, of a piece that is worth a start of its own


def segmented(signals: Signals, vehicle: Vehicle) -> Signals:
    """The same drives, those with gaps in several pieces.  Raises as
    :func:`clutchest.estimate.drive_setup.usable` does."""
    pieces = [piece for drive in signals.drives for piece in _pieces(drive, vehicle)]
    return replace(pieces[0], later=tuple(pieces[1:]))


def _pieces(drive: Signals, vehicle: Vehicle) -> list[Signals]:
    model = vehicle.machine.to_fit(drive.available)
    setting = DriveSetup(vehicle, model, 1.0, delays(vehicle))
    present, _ = usable(drive, setting)
    gaps = _gaps(present, setting)
    times = present[model.anchor].time
    begins, ends = [-np.inf, *(b for _, b in gaps)], [*(a for a, _ in gaps), np.inf]
    spans = [(a, min(b, drive.end)) for a, b in zip(begins, ends, strict=True)]
    long = [(a, b) for a, b in spans if min(b, times[-1]) - max(a, times[0]) > SHORTEST]
    return [_piece(drive, setting, a, b) for a, b in long] if gaps and long else [drive]


def _gaps(present: Mapping[str, Signal], setting: DriveSetup) -> list[tuple[float, float]]:
    """Begin and end, s, of the gaps in any signal that drives the equations fast."""
    model, intervals = setting.model, list[tuple[float, float]]()
    fast = [model.slopes.get(name, name) for name in setting.fast(present)]
    for name in {model.anchor, *fast}:
        t = present[name].time
        k = np.flatnonzero(np.diff(t) > setting.thresholds.gap)
        intervals += zip(t[k].tolist(), t[k + 1].tolist(), strict=True)
    joined = list[tuple[float, float]]()
    for begin, end in sorted(intervals):
        if joined and begin <= joined[-1][1]:
            begin, end = joined[-1][0], max(end, joined.pop()[1])
        joined.append((begin, end))
    if not joined:
        return []
    edges = np.ravel(joined)
    stamps = np.union1d(present[model.anchor].time, edges)
    engaged = regimes(stamps, present, setting.vehicle, fast).engaged[stamps.searchsorted(edges)]
    slips = np.any(engaged.reshape(-1, 2), axis=1).tolist()
    return [(a, b) for (a, b), may in zip(joined, slips, strict=True) if may or b - a > UNOBSERVED]


def _piece(drive: Signals, setting: DriveSetup, since: float, end: float) -> Signals:
    """The samples from ``since`` to ``end``, s; of a signal that holds its last value, that too."""
    signals = {}
    for name, signal in drive.items():
        late = setting.late(name)
        first = int(np.searchsorted(signal.time, since + late))
        last = int(np.searchsorted(signal.time, end + late, side="right"))
        if setting.held(name):
            known = np.flatnonzero(signal.valid[: first + 1])
            first = int(known[-1]) if len(known) else first
        piece = signal.take(slice(first, last))
        signals[name] = replace(piece, time=np.maximum(piece.time, since + late))
    return replace(drive, signals=signals, end=end, later=())
