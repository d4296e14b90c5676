"""What effects change of some quantities of the equations, each by itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchest.casadi_later import ca, one_at_a_time
from clutchest.models.effects import Effect, Gains
from clutchest.models.model import Model
from clutchest.signals import Floats


@dataclass(frozen=True, slots=True)
class LocalChanges:
    """``of(x, u)``: changes (d, K) of the quantities ``names`` (d) at states (n, K) and inputs
    (nu, K), regime flags on, and their values (d, K) without any effect.  A quantity is as the
    others are without effects: what one change does to another quantity is not in it."""

    names: tuple[str, ...]
    of: Callable[[Floats, Floats], tuple[Floats, Floats]]
    idle: tuple[tuple[str, str], ...]  # (effect, gain) that change none of them

    @classmethod
    @one_at_a_time
    def by(
        cls,
        effects: Mapping[Effect, Mapping[str, float]],
        model: Model,
        parameters: Mapping[str, float],
        names: Sequence[str],
    ) -> LocalChanges:
        """Of ``effects`` (effect → its numbers) in a model with these ``parameters``."""
        held = {name: ca.SX.sym(name) for name in names}
        seen: dict[str, ca.SX] = {}
        with_ = model.with_effects((*effects, _Held(held, seen))).expressions()
        without = model.expressions()
        values = [ca.SX(getattr(without.quantities, name)) for name in names]
        changed = ca.vertcat(*(seen[name] - held[name] for name in names))
        at_values = ca.substitute(changed, ca.vertcat(*held.values()), ca.vertcat(*values))
        p = ca.SX([parameters[parameter.key] for parameter in model.parameters])
        g = ca.SX([effects[effect][key] for effect, key in _numbers(effects)])
        known = [
            (with_.w, ca.SX.ones(with_.w.numel())),
            (without.w, ca.SX.ones(without.w.numel())),
            (with_.p, p),
            (without.p, p),
            (without.x, with_.x),
            (without.u, with_.u),
        ]
        both = ca.vertcat(at_values, *values)
        for symbol, value in known:
            both = ca.substitute(both, symbol, value)
        numbers = _numbers(effects)
        influences = [ca.depends_on(both, with_.g[i]) for i in range(len(numbers))]
        idle = tuple(
            (effect.name, key)
            for (effect, key), does in zip(numbers, influences, strict=True)
            if not does and key not in effect.delays.values()
        )
        both = ca.substitute(both, with_.g, g)
        function = ca.Function("changes", [with_.x, with_.u], [both])

        def of(x: Floats, u: Floats) -> tuple[Floats, Floats]:
            changes, normal = np.split(np.asarray(function(x, u), np.float64), 2)
            return changes, normal

        return cls(tuple(names), of, idle)


def _numbers(effects: Mapping[Effect, object]) -> list[tuple[Effect, str]]:
    return [(effect, number.key) for effect in effects for number in effect.parameters]


class _Held(Effect):
    """Keeps quantities at the values ``held``, and notes in ``seen`` what they would have been."""

    name, model, equation = "held", "", ""
    parameters = ()

    def __init__(self, held: Mapping[str, ca.SX], seen: dict[str, ca.SX]) -> None:
        self._held, self._seen = held, seen

    def terms(self, g: Gains) -> Mapping[str, Callable[[Any, Any], Any]]:
        """See :meth:`Effect.terms`."""
        return {name: self._holding(name) for name in self._held}

    def _holding(self, name: str) -> Callable[[Any, Any], Any]:
        def hold(value: Any, q: Any) -> ca.SX:
            self._seen[name] = ca.SX(value)
            return self._held[name]

        return hold
