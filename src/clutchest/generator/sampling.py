"""From the truth to the bus: periods, jitter, delays, autocorrelated noise, outliers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from clutchest.errors import ClutchestError, nearest
from clutchest.generator.surroundings import stream
from clutchest.recursion import recur
from clutchest.signals import Floats, Truth

JITTER = 0.02  # of the period: how far a message may be off its beat; its stamp stays true


@dataclass(frozen=True)
class Channel:
    """How one canonical signal is sampled: its ``message``, ``period`` s, ``noise`` standard
    deviation (SI, mm for positions), ``noise_ar`` AR(1) coefficient per sample, ``delay`` s;
    ``tails``: degrees of freedom of Student's distribution, infinite for normal noise; ``jitter``:
    by how much of its period a reading is off its beat."""

    name: str
    message: str
    period: float
    noise: float = 0.0
    noise_ar: float = 0.0
    delay: float = 0.0
    tails: float = inf
    jitter: float = JITTER


@dataclass(frozen=True)
class Sampled:
    """A generated drive.

    ``signals``: canonical name → (time s, value), shape (n,) each, noisy but not quantised, the
    signals of one message on common times; ``parameters`` as drawn, before any effect; ``benches``:
    (start s, end s, name) of the test benches it ran on.
    """

    signals: Mapping[str, tuple[Floats, Floats]]
    truth: Truth
    parameters: Mapping[str, float]
    seed: int
    scenario: str
    benches: tuple[tuple[float, float, str], ...] = ()


def sample(
    channels: Sequence[Channel],
    quantities: Mapping[str, Callable[[Floats], Floats]],
    seed: int,
    duration: float,
    outliers: float,
) -> dict[str, tuple[Floats, Floats]]:
    """Every channel's (time, value); ``quantities``: name → value as a function of true time.

    Raises ClutchestError for a channel that the truck does not have, or one that cannot be.
    """
    if not 0 <= outliers < 1:
        raise ClutchestError(f"share of outliers {outliers:g}: expected 0 ≤ share < 1")
    beats: dict[str, tuple[float, Floats]] = {}
    signals: dict[str, tuple[Floats, Floats]] = {}
    for channel in channels:
        _check(channel, quantities)
        if channel.message not in beats:
            beats[channel.message] = channel.period, _beat(channel, seed, duration)
        period, time = beats[channel.message]
        if channel.period != period:
            raise ClutchestError(
                f"message '{channel.message}': signal '{channel.name}' has a "
                f"period of {channel.period:g} s, the others have "
                f"{period:g} s"
            )
        value = quantities[channel.name](np.maximum(time - channel.delay, 0.0))
        value = value + _noise(channel, seed, len(time))
        signals[channel.name] = time, _with_outliers(value, channel, seed, outliers)
    return signals


def _check(channel: Channel, quantities: Mapping[str, object]) -> None:
    if channel.name not in quantities:
        raise ClutchestError(
            f"the generator makes no signal '{channel.name}'" + nearest(channel.name, quantities)
        )
    if not channel.period > 0:
        raise ClutchestError(f"signal '{channel.name}': period {channel.period:g} s, expected > 0")
    if not (channel.noise >= 0 and channel.delay >= 0 and -1 < channel.noise_ar < 1):
        raise ClutchestError(
            f"signal '{channel.name}': expected noise ≥ 0, delay ≥ 0 and −1 < noise_ar < 1"
        )
    if not (channel.tails > 2 and 0 <= channel.jitter < 0.5):
        raise ClutchestError(
            f"signal '{channel.name}': expected tails > 2 and 0 ≤ jitter < 0.5 of its period"
        )


def _beat(channel: Channel, seed: int, duration: float) -> Floats:
    rng = stream(seed, "beat " + channel.message)
    time = np.arange(rng.uniform(0, channel.period), duration, channel.period)
    time += rng.uniform(-channel.jitter, channel.jitter, len(time)) * channel.period
    return time[(time >= 0) & (time <= duration)]


def _noise(channel: Channel, seed: int, n: int) -> Floats:
    """Stationary AR(1) from its first sample on, with standard deviation ``channel.noise``."""
    rng = stream(seed, "noise " + channel.name)
    if channel.tails == inf:
        white = rng.standard_normal(n)
    else:
        white = rng.standard_t(channel.tails, n) * np.sqrt(1.0 - 2.0 / channel.tails)
    fresh = np.sqrt(1 - channel.noise_ar**2)
    white[1:] *= fresh
    return channel.noise * recur(white, channel.noise_ar)


def _with_outliers(value: Floats, channel: Channel, seed: int, share: float) -> Floats:
    rng = stream(seed, "outliers " + channel.name)
    hit = rng.random(len(value)) < share
    jump = rng.uniform(8.0, 20.0, len(value)) * rng.choice((-1.0, 1.0), len(value))
    return value + hit * jump * channel.noise
