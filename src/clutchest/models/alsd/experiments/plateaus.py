"""Stretches of a record in which everything is steady, and means over them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from clutchest.models.experiments import BenchRecord
from clutchest.signals import Floats, Signal

JUMP = 6.0  # standard deviations of the difference of two samples
LEVEL = 5.0  # standard deviations by which means of two halves may differ


def plateaus(
    record: BenchRecord, names: Sequence[str], settle: float, least: float
) -> list[tuple[float, float]]:
    """(start, end) s between which none of the named signals jumps, at least ``least`` s of them
    once the first ``settle`` s are left out."""
    edges = [record.signals[names[0]].time[[0, -1]]]
    for name in names:
        signal = record.signals[name]
        jumps = np.flatnonzero(
            np.abs(np.diff(signal.value)) > JUMP * np.sqrt(2) * record.noise[name]
        )
        edges += [signal.time[jumps], signal.time[jumps + 1]]
    cuts = np.unique(np.concatenate(edges))
    pairs = zip(cuts[:-1] + settle, cuts[1:], strict=True)
    return [(float(a), float(b)) for a, b in pairs if b - a >= least]


def centre(signal: Signal, start: float, end: float) -> tuple[float, int]:
    """The value in the middle of ``start`` … ``end`` by a straight line through the samples there,
    and how many there are."""
    rows = slice(*np.searchsorted(signal.time, (start, end)))
    time, value = signal.time[rows], signal.value[rows]
    if len(time) < 3:
        return float(signal.at(np.array([(start + end) / 2]))[0]), 1
    return float(np.polyfit(time - (start + end) / 2, value, 1)[1]), len(time)


def speed(signal: Signal, start: float, end: float) -> tuple[float, float]:
    """Slope of an angle's samples in ``start`` … ``end``, and its standard deviation for samples
    with noise of 1."""
    rows = slice(*np.searchsorted(signal.time, (start, end)))
    time = signal.time[rows] - (start + end) / 2
    spread = float(np.sqrt(np.sum((time - time.mean()) ** 2)))
    return float(np.polyfit(time, signal.value[rows], 1)[0]), 1 / spread


def means(
    record: BenchRecord, names: Sequence[str], spans: Sequence[tuple[float, float]]
) -> Iterator[tuple[Floats, Floats]]:
    """Per signal: its values in the middle of the ``spans`` (k,), and their standard deviations."""
    for name in names:
        pairs = [centre(record.signals[name], *span) for span in spans]
        std = [record.std_of_mean(name, count) for _, count in pairs]
        yield np.array([value for value, _ in pairs]), np.array(std)
