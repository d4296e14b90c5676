"""What is unknown of drives, as types: parameters, gains of effects, first states, delays, noise.

Each unknown number counts in its ``unit``: 1 is the standard deviation of the prior of a nuisance,
and the largest plausible value of a gain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf

from clutchest.estimate.whole_log import Compiled
from clutchest.models.effects import Effect
from clutchest.models.effects.effect import INPUT_NOISE, PARAMETER, START, WANDER

Shapes = Mapping[tuple[str, str], float]  # (effect, key of a shape) → value


@dataclass(frozen=True, slots=True)
class UnknownParameter:
    """A parameter of the vehicle file that has a spread, which is its prior; the equations allow
    what lies between ``lower`` and ``upper``, in its unit."""

    key: str
    unit: float
    lower: float = -inf
    upper: float = inf

    def __str__(self) -> str:
        return self.key

    def within(self, most: float) -> UnknownParameter:
        """The same, off by ``most`` standard deviations at most."""
        return replace(self, lower=max(self.lower, -most), upper=min(self.upper, most))


@dataclass(frozen=True, slots=True)
class StatedGain:
    """A gain of an effect of the vehicle file; ``exact`` where the file gives it no spread: then it
    is no unknown of any fit."""

    effect: str
    key: str
    unit: float
    exact: bool = False

    def __str__(self) -> str:
        return f"{self.effect}.{self.key}"


@dataclass(frozen=True, slots=True)
class UnknownGain:
    """A gain of a candidate effect, absent at 0.

    ``lower`` and ``upper`` plausible values in its unit; ``healthy``: standard deviation, in its
    unit, from one healthy vehicle to the next.
    """

    effect: str
    key: str
    unit: float
    lower: float = -1.0
    upper: float = 1.0
    healthy: float = 0.0

    def __str__(self) -> str:
        return f"{self.effect}.{self.key}"


@dataclass(frozen=True, slots=True)
class InitialState:
    """The first value of a state in one ``drive`` (index)."""

    state: str
    unit: float
    drive: int = 0

    def __str__(self) -> str:
        return f"start of {self.state}"


@dataclass(frozen=True, slots=True)
class SignalDelay:
    """A small delay of a signal, beyond what the vehicle file states; ``unit`` s."""

    signal: str
    unit: float

    def __str__(self) -> str:
        return f"delay of {self.signal}"


@dataclass(frozen=True, slots=True)
class HealthyPart:
    """As far as an effect acts in a healthy vehicle: a part of its gain that has a prior."""

    effect: str
    key: str
    unit: float

    def __str__(self) -> str:
        return f"healthy {self.effect}.{self.key}"


@dataclass(frozen=True, slots=True)
class InputNoise:
    """What an input is off by, where states without readings of their own take it in; never a
    number of a fit, but a direction in which readings scatter."""

    input: str
    unit: float = 1.0

    def __str__(self) -> str:
        return f"noise of {self.input}"


@dataclass(frozen=True, slots=True)
class StateWander:
    """What is added to the rate of a state that wanders; a direction as well."""

    state: str
    unit: float = 1.0

    def __str__(self) -> str:
        return f"wander of {self.state}"


Unknown = (
    UnknownParameter
    | StatedGain
    | UnknownGain
    | InitialState
    | SignalDelay
    | HealthyPart
    | InputNoise
    | StateWander
)


def of_compiled(compiled: Compiled, sought: Mapping[str, Effect]) -> Iterator[Unknown]:
    """The unknowns that the thetas of a compiled model are, in their order; ``sought``: candidate
    effects by name, other effects are those of the vehicle file."""
    parameters = compiled.model.parameters
    values = {p.key: (p, at) for p, at in zip(parameters, compiled.p.tolist(), strict=True)}
    for (owner, key), spread in zip(compiled.thetas, compiled.spread.tolist(), strict=True):
        if owner == PARAMETER:
            allowed, at = values[key]
            yield UnknownParameter(
                key, spread, (allowed.lower - at) / spread, (allowed.upper - at) / spread
            )
        elif owner == START:
            yield InitialState(key, spread)
        elif owner == INPUT_NOISE:
            yield InputNoise(key)
        elif owner == WANDER:
            yield StateWander(key)
        elif owner in sought:
            n = next(n for n in sought[owner].gains if n.key == key)
            lower, upper, healthy = n.lower / n.upper, 1.0, n.healthy / n.upper
            yield UnknownGain(owner, key, n.upper, lower, upper, healthy)
        else:
            yield StatedGain(owner, key, spread or 1.0, exact=spread == 0.0)
