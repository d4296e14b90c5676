"""Simulation of a model by itself, open loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from clutchest.compute.build import generate_forward
from clutchest.errors import ClutchestError, nearest
from clutchest.generated import load
from clutchest.models.model import Model
from clutchest.signals import Floats


@dataclass(frozen=True, slots=True)
class Forward:
    """A model compiled to run forward, writing out the quantities ``watched``."""

    model: Model
    watched: tuple[str, ...]
    functions: ModuleType

    def run(
        self,
        parameters: Mapping[str, float],
        start: Mapping[str, float],
        inputs: Mapping[str, Floats],
        period: float,
        steps: int = 1,
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> dict[str, Floats]:
        """Name → column (K), of every watched quantity, at the rows of ``inputs`` (each (K)).

        Rows lie ``period`` s apart, with ``steps`` steps in between; ``start`` has every state,
        ``parameters`` every parameter and ``effects`` numbers of the model's effects, 0 or the
        default where silent.  Raises ClutchestError for what is missing.
        """
        model = self.model
        x = _vector("state", [state.name for state in model.states], start)
        p = _vector("parameter", [parameter.key for parameter in model.parameters], parameters)
        given = effects or {}
        g = np.array(
            [
                given.get(effect.name, {}).get(key, number.default if number.shape else 0.0)
                for effect in model.effects
                for number in effect.parameters
                for key in (number.key,)
            ]
        )
        u = np.stack([np.asarray(inputs[item.name], np.float64) for item in model.inputs], axis=1)
        out = np.zeros((len(u), len(self.watched)))
        w = np.append(np.ones(len(model.regime)), np.zeros(len(model.doubted)))
        self.functions.march(x, u, period / steps, steps, w, p, g, out)
        return dict(zip(self.watched, out.T, strict=True))


def forward(model: Model, watched: Sequence[str]) -> Forward:
    """Compile a model to be run forward; the first time on a machine takes about a second."""
    digest, text = generate_forward(model, watched)
    return Forward(model, tuple(watched), load(digest, text))


def _vector(what: str, names: Sequence[str], values: Mapping[str, float]) -> Floats:
    for name in names:
        if name not in values:
            raise ClutchestError(f"{what} '{name}' is missing" + nearest(name, values))
    return np.array([float(values[name]) for name in names])
