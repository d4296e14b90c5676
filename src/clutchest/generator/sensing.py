"""How sensors and log may differ from what is stated of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp, inf

from clutchest.generator.sampling import JITTER, Channel
from clutchest.generator.scenarios import Random
from clutchest.recursion import recur
from clutchest.signals import Floats

Values = Mapping[str, float]

# Signals of the fast record of a drive, in its order.
FAST_SIGNALS = (
    "engine_speed",
    "input_shaft_speed",
    "slave_position",
    "motor_position",
    "engine_torque",
    "vehicle_speed",
)
_NOISY = (*FAST_SIGNALS, "coolant_temp", "ambient_temp")


@dataclass(frozen=True)
class Sensing:
    """By signal: ``lag`` s of a sensor (first order); ``noise`` as a multiple of the stated one;
    ``noise_ar``: the stated AR(1) coefficient is that share of the way nearer to 1.  ``tails``:
    degrees of freedom of noise of Student's distribution, of the stated variance; infinite for
    normal noise.  ``jitter``: by how much of its period a message may be off its beat, its stamp
    staying true."""

    lag: Values = field(default_factory=dict)
    noise: Values = field(default_factory=dict)
    noise_ar: Values = field(default_factory=dict)
    tails: float = inf
    jitter: float = JITTER

    def channels(self, stated: Sequence[Channel]) -> list[Channel]:
        """As they are, from as they are stated."""
        return [
            replace(
                c,
                noise=c.noise * self.noise.get(c.name, 1.0),
                noise_ar=c.noise_ar + self.noise_ar.get(c.name, 0.0) * (1.0 - c.noise_ar),
                tails=self.tails,
                jitter=self.jitter,
            )
            for c in stated
        ]

    def lagging(self, fast: Floats, step: float) -> Floats:
        """The fast record (n, 6), every ``step`` s, as lagging sensors follow it."""
        if not any(self.lag.values()):
            return fast
        behind = fast.copy()
        for i, name in enumerate(FAST_SIGNALS):
            if lag := self.lag.get(name, 0.0):
                keep, start = exp(-step / lag), fast[0, i]
                behind[:, i] = start + recur((1.0 - keep) * (fast[:, i] - start), keep)
        return behind


def lagging_sensors(plain: Sensing, random: Random) -> Sensing:
    """Filters of two to six milliseconds in speed sensors and the slave's position sensor."""
    names = ("engine_speed", "input_shaft_speed", "slave_position")
    return replace(plain, lag={name: random.uniform(0.002, 0.006) for name in names})


def other_noise(plain: Sensing, random: Random) -> Sensing:
    """Noise 30 % less to 30 % more than stated, every sensor its own."""
    return replace(plain, noise={name: random.uniform(0.7, 1.3) for name in _NOISY})


def other_colour(plain: Sensing, random: Random) -> Sensing:
    """Neighbouring readings have in common what the vehicle file does not state."""
    return replace(plain, noise_ar={name: random.uniform(0.1, 0.4) for name in _NOISY})


def heavy_tails(plain: Sensing, random: Random) -> Sensing:
    """Student's distribution of 4 to 8 degrees of freedom: one reading in some thousands lies as
    far off as ten standard deviations."""
    return replace(plain, tails=random.uniform(4.0, 8.0))


def jittering(plain: Sensing, random: Random) -> Sensing:
    """Messages that wait for others on the bus: a tenth to a third of a period off their beat."""
    return replace(plain, jitter=random.uniform(0.1, 0.33))
