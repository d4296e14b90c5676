"""Single samples that are far off: left out before they drive the equations as inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.signals import Signal

FAR = 6.0  # standard deviations of the noise beyond both neighbours
ROUGH = 5.0  # times what nine samples out of ten stay within, should the stated noise be too small


def without_spikes(signal: Signal, noise: float) -> tuple[Signal, int]:
    """``signal`` without samples that stick out beyond both neighbours, and how many there were.

    A step, a ramp and a peak that lasts two samples stay as they are.  ``noise`` is the standard
    deviation stated for the signal; 0 leaves everything in.
    """
    value = signal.value
    if len(value) < 3 or noise <= 0.0:
        return signal, 0
    before, here, after = value[:-2], value[1:-1], value[2:]
    above = here - np.maximum(before, after)
    below = np.minimum(before, after) - here
    out = np.maximum(above, below)
    usual = np.percentile(np.maximum(out, 0.0), 90)
    period = np.diff(signal.time)
    close = period[1:] + period[:-1] < 4.0 * np.median(period)  # across a gap anything may happen
    spike = np.pad(close & (out > max(FAR * noise, ROUGH * usual)), 1)
    if not spike.any():
        return signal, 0
    left = ~spike
    kept = replace(signal, time=signal.time[left], value=value[left], why=signal.why[left])
    return kept, int(spike.sum())
