"""The causes that a search tries: one gain of one effect, at one value of each of its shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from clutchest.inference.problem import Problem
from clutchest.models.effects import Effect, Number
from clutchest.models.error_term_effects import PREFIX


@dataclass(frozen=True, slots=True)
class CandidateCause:
    """``index`` of its gain in θ; ``shapes`` (key, value) of its effect."""

    effect: Effect
    gain: Number
    index: int
    shapes: tuple[tuple[str, float], ...]

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name

    @property
    def gain_name(self) -> str:
        """The gain's, as :meth:`Problem.index` knows it."""
        return f"{self.name}.{self.gain.key}"


def candidates(problem: Problem) -> tuple[CandidateCause, ...]:
    """Every gain of every effect, at every value of the grids of its shapes."""
    return tuple(
        CandidateCause(effect, gain, problem.index(f"{effect.name}.{gain.key}"), shapes)
        for effect in problem.effects.values()
        if not effect.name.startswith(PREFIX)
        for gain in effect.gains
        for shapes in _grid(effect)
    )


def _grid(effect: Effect) -> Iterator[tuple[tuple[str, float], ...]]:
    shapes = [number for number in effect.parameters if number.shape]
    for values in product(*(number.grid or (number.default,) for number in shapes)):
        yield tuple((n.key, value) for n, value in zip(shapes, values, strict=True))


def settings(
    causes: tuple[CandidateCause, ...],
) -> dict[tuple[str, str], float]:
    """The shapes of a set of candidates as :class:`Problem` takes them."""
    return {(c.name, key): value for c in causes for key, value in c.shapes}
