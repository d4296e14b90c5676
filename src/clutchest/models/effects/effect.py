"""An effect: a term in the equations that is absent while its gain is zero.

An effect reaches the model through one of four hooks.

- **equation** and **sensor**: :attr:`Effect.scales` names the quantities that it makes larger by a
  share, :meth:`Effect.terms` those that it changes otherwise, and how.  An
  input that the model reads is a sensor's reading too: there the term maps reading → truth, while
  on a ``…_reading`` quantity it maps truth → reading.
- **timeline**: :attr:`Effect.delays` names the signal that each of its parameters delays,
  :attr:`Effect.lateness` how such a delay varies.
- **step map**: :attr:`Effect.states` adds a state, :meth:`Effect.after_step` updates it after each
  integration step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Protocol

from clutchest.models.symbols import State


class Indices(Protocol):
    """Where names stand in the vectors of a model: states in ``x``, inputs in ``u``."""

    def state(self, name: str) -> int:
        """Index of a state in x."""

    def input(self, name: str) -> int:
        """Index of an input in u."""


@dataclass(frozen=True, slots=True)
class Number:
    """One parameter of an effect.

    A *gain* makes the effect absent at 0 and lies between ``lower`` and ``upper``, its largest
    plausible sizes; a *shape* (``shape=True``) has no absent value, ``default`` stands where none
    is given and ``grid`` lists what a search tries.  ``healthy``: the standard deviation of a gain
    from one healthy vehicle to the next, which no fault test may mistake for a fault.  ``trials``:
    sizes of a gain at which the effect is far from linear in it.
    """

    key: str
    unit: str
    lower: float
    upper: float
    shape: bool = False
    default: float = 0.0
    grid: tuple[float, ...] = ()
    healthy: float = 0.0
    trials: tuple[float, ...] = ()

    @property
    def one_sided(self) -> bool:
        """Whether only positive values are physical."""
        return not self.shape and self.lower == 0.0

    @property
    def least(self) -> float:
        """What a stated value must not fall below: 0 where one-sided, above 0 for a scale."""
        if self.shape:
            return 1e-9 if self.lower > 0.0 else -inf
        return 0.0 if self.one_sided else -inf


@dataclass(frozen=True, slots=True)
class Wording:
    """What a size means in words: texts with a place for |size| × ``scale``, for a size ``below``
    0 and one ``above``."""

    below: str
    above: str
    scale: float = 1.0

    def of(self, size: float) -> str:
        """A size in words."""
        return (self.below if size < 0.0 else self.above).format(self.scale * abs(size))


TIME = "time"  # since the drive's start: a covariate of delays beside signals
# Owners of unknowns in compiled code that are no effects: a parameter of the vehicle file, the
# initial value of a state, the error of an input where untracked states depend on it, how fast a
# state wanders.
PARAMETER, START, INPUT_NOISE, WANDER = "parameter", "start", "input_noise", "wander"
RESERVED = (PARAMETER, START, INPUT_NOISE, WANDER)  # names that no effect can have


@dataclass(frozen=True, slots=True)
class Lateness:
    """A signal's delay per unit of its parameter, s: ``seconds`` at values ``at`` of a
    ``covariate``, a signal or ``time``; linear between them, constant outside."""

    covariate: str
    at: tuple[float, ...]
    seconds: tuple[float, ...]

    @property
    def most(self) -> float:
        """The largest of them, s."""
        return max(self.seconds)

    @property
    def reach(self) -> float:
        """The largest of them by magnitude, s; 1 where all are 0."""
        return max(map(abs, self.seconds)) or 1.0


class Gains:
    """The numbers of one effect as symbols: ``g.slope``."""

    def __init__(self, rows: Mapping[str, Any]) -> None:
        self._rows = dict(rows)

    def __getattr__(self, key: str) -> Any:
        try:
            return self._rows[key]
        except KeyError:
            raise AttributeError(key) from None


class Effect:
    """Base of every effect: subclass it in a file of its own, one class per effect.

    ``name`` as vehicle files write it, ``model`` it belongs to, "" for the one that declares it;
    ``parameters`` its numbers, ``equation`` in which it acts (``torque``, ``disc_heat``,
    ``sensor:…``, …).
    """

    name: ClassVar[str]
    model: ClassVar[str] = ""
    equation: ClassVar[str]
    parameters: ClassVar[tuple[Number, ...]]
    states: ClassVar[tuple[State, ...]] = ()
    scales: ClassVar[Mapping[str, str]] = {}  # quantity → parameter: it is × (1 + parameter)
    delays: ClassVar[Mapping[str, str]] = {}  # signal → parameter that holds its delay, s
    lateness: ClassVar[Mapping[str, Lateness]] = {}  # signal → how its delay varies
    wording: ClassVar[Mapping[str, Wording]] = {}  # of parameters whose size has a plain meaning

    def terms(self, g: Gains) -> Mapping[str, Callable[[Any, Any], Any]]:
        """Quantity → function (value, all quantities) → changed value; the same value at gain 0."""
        return {quantity: _scaled(getattr(g, key)) for quantity, key in self.scales.items()}

    def after_step(self, model: Indices, x: Any, u0: Any, u: Any, g: Gains) -> Any:
        """The state after the step map; ``u0``, ``u`` are the inputs at the step's two ends."""
        return x

    @property
    def gains(self) -> tuple[Number, ...]:
        """The parameters that make the effect absent at 0."""
        return tuple(number for number in self.parameters if not number.shape)


def _scaled(share: Any) -> Callable[[Any, Any], Any]:
    return lambda value, q: value * (1 + share)
