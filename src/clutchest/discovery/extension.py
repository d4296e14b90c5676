"""The vehicle with what was found in its model, and how well that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from clutchest.discovery import patch
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import Found
from clutchest.discovery.search import Hypothesis, Search
from clutchest.inference.map_fit import covariance
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import StatedGain
from clutchest.models.effects import effects_of_file
from clutchest.vehicle import Vehicle

Sizes = Mapping[str, Mapping[str, Found]]  # effect → key → number


def extend(
    problem: Problem, acts: Sizes, curve: Curve | None, own: Sequence[Path]
) -> tuple[Vehicle, str | None]:
    """The problem's vehicle with the effects that ``act`` in its model, or with a curve, whose file
    of effects is the text; ``own``: the user's files, which may be needed for it."""
    vehicle, text = problem.vehicle, None
    effects, spreads = dict(vehicle.effects), dict(vehicle.effects_spread)
    files = list(vehicle.effects_files)
    if curve is not None:
        patched = patch.written(curve, problem.compiled.model, effects)
        if patched is not None:
            text = patched.text
            effects |= patched.effects
            spreads |= patched.spread
            files.append(Path(patch.FILE))
    gains = {(e.name, n.key) for e in problem.compiled.model.effects for n in e.gains}
    for name, numbers in acts.items():
        effects[name] = {**effects.get(name, {}), **{key: f.value for key, f in numbers.items()}}
        spreads[name] = {
            key: f.std for key, f in numbers.items() if (name, key) in gains and 0.0 < f.std < inf
        }
    used = {effect for effect in effects if effect not in vehicle.machine.effects}
    for path in own:
        if used & set(effects_of_file(path)):
            files.append(path.resolve())
    extended = replace(vehicle, effects=effects, effects_spread=spreads, effects_files=tuple(files))
    return extended, text


def corrected(search: Search, h: Hypothesis) -> dict[str, dict[str, Found]]:
    """What the vehicle file states, but not exactly, as it comes out beside the causes of a
    hypothesis: their sizes hold beside no other."""
    problem = search.problem
    stated, free = problem.vehicle.effects, search.free(h.chosen)
    wanted = {
        int(i): t for i in problem.nuisances if isinstance(t := problem.thetas[i], StatedGain)
    }
    if not wanted:
        return {}
    fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes)
    variance = np.diag(covariance(search.objective, fit, free))
    least = {(e.name, n.key): n.least for e in problem.compiled.model.effects for n in e.gains}
    found: dict[str, dict[str, Found]] = {}
    for i, t in wanted.items():
        value = stated[t.effect].get(t.key, 0.0) + float(fit.theta[i] * t.unit)
        std = float(np.sqrt(variance[free == i][0]) * t.unit)
        found.setdefault(t.effect, {})[t.key] = Found(max(value, least[t.effect, t.key]), std)
    return found
