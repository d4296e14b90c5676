"""Single samples that are far off: left out before they drive the equations as inputs."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.sample_timing import SampleTiming, sticking_out
from clutchest.signals import Signal

FAR = 6.0  # standard deviations of the noise beyond both neighbours
ROUGH = 3.5  # times what nine samples out of ten stay within, 1.7 of white noise: as far
STEEP = 1.5  # times the steps before and after it, or the sample may be where the course turns


def without_spikes(
    signal: Signal, noise: float, timing: SampleTiming | None = None
) -> tuple[Signal, int]:
    """``signal`` without samples that stick out beyond both neighbours, and how many there were.

    A step, a ramp and a peak that lasts two samples stay as they are, and so do the turning
    point of a course and a step with overshoot: there the step before or after, or that from one
    neighbour to the other, is larger than what the sample sticks out by.  The first two samples
    and the last two stay, too.  ``noise`` is the standard deviation stated for the signal; 0 leaves
    everything in.  ``timing`` is the signal's own unless given.
    """
    if len(signal) < 3 or noise <= 0.0:
        return signal, 0
    timing = timing or SampleTiming.of(signal)
    step = signal.time[1:] - signal.time[:-1]
    close = step[1:] + step[:-1] < 4.0 * timing.period  # across a gap anything may happen
    out = sticking_out(signal.value)
    far = out > max(FAR * noise, ROUGH * timing.rough)
    far &= out > np.abs(signal.value[2:] - signal.value[:-2])
    far[1:] &= out[1:] > STEEP * np.abs(np.diff(signal.value[:-2]))
    far[:-1] &= out[:-1] > STEEP * np.abs(np.diff(signal.value[2:]))
    far[0] = far[-1] = False
    if not (close & far).any():
        return signal, 0
    spike = np.pad(close & far, 1)
    left = ~spike
    return signal.take(left), int(spike.sum())
