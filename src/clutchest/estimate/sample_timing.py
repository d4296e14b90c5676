"""How a signal comes, learnt from its beginning: what comes later changes nothing of it, so that a
drive that is still going on is judged as it will be in a replay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchest.signals import HEAD, Floats, Signal


@dataclass(frozen=True, slots=True)
class SampleTiming:
    """Of one signal: ``period`` s between samples, and by how much nine samples out of ten at most
    stick out beyond both neighbours (``rough``, its unit)."""

    period: float
    rough: float

    @classmethod
    def of(cls, signal: Signal) -> SampleTiming:
        """From the samples of the first ``HEAD`` s; a signal with less than two is slower."""
        count = int(np.searchsorted(signal.time, signal.time[:1].sum() + HEAD, side="right"))
        if count < 2:
            return cls(HEAD, 0.0)
        out = np.maximum(sticking_out(signal.value[:count]), 0.0)
        rough = float(np.percentile(out, 90)) if len(out) else 0.0
        return cls(float(np.median(np.diff(signal.time[:count]))), rough)


def sticking_out(value: Floats) -> Floats:
    """By how much every sample but the first and the last lies beyond both its neighbours (n−2)."""
    if len(value) < 3:
        return np.zeros(0)
    before, here, after = value[:-2], value[1:-1], value[2:]
    return np.maximum(here - np.maximum(before, after), np.minimum(before, after) - here)
