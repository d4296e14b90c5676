"""Identifiability of every effect in a log, before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.result import Identifiable
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import ScoreTest, d_prime
from clutchest.models.effects import Effect
from clutchest.signals import Floats


def identifiability(
    causes: Sequence[CandidateCause], units: Floats, scores: ScoreTest, level: float
) -> tuple[Identifiable, ...]:
    """For each effect: the size that is detected in half of such logs at the family-wise ``level``,
    and the effect that resembles it most."""
    sizes = scores.threshold(level) / scores.std  # in units of each gain; 0 where std is inf
    sizes = np.where(np.isfinite(scores.std), sizes, np.inf)
    results = []
    for name in dict.fromkeys(c.name for c in causes):
        own = [i for i, c in enumerate(causes) if c.name == name]
        # the size itself is judged by what is plausible: 1 in units of a gain
        i = min(own, key=lambda k: sizes[k])
        rivals = (
            [
                (d_prime(scores.information, scores.one_sided, i, sizes[i], k), causes[k].name)
                for k in range(len(causes))
                if causes[k].name != name
            ]
            if sizes[i] < 1e6
            else []
        )
        distance, nearest = min(rivals, default=(None, None))
        results.append(
            Identifiable(
                name,
                causes[i].gain.unit,
                float(sizes[i] * units[causes[i].index]) if sizes[i] < 1e6 else None,
                causes[i].gain.upper,
                nearest,
                distance,
            )
        )
    return tuple(results)


def not_testable(problem: Problem, effects: Sequence[Effect]) -> list[Identifiable]:
    """The same of ``effects`` that the equations of these signals cannot have: never detectable."""
    known = {*problem.effects, *problem.vehicle.effect_numbers}
    return [
        Identifiable(e.name, e.gains[0].unit, None, e.gains[0].upper, None, None)
        for e in effects
        if e.name not in known
    ]


def untested_effects(problem: Problem, effects: Sequence[Effect]) -> list[str]:
    """Of ``effects`` those that these signals' equations cannot have, by the signal that would
    bring them: a sentence for each."""
    machine, usable = problem.vehicle.machine, problem.usable
    taken = problem.compiled.model.taking(effects)
    left = [e for e in effects if e not in taken]
    words = []
    for column in [c for c in machine.units if left and c not in usable]:
        brought = machine.to_fit(usable | {column}).taking(left)
        if brought:
            names = ", ".join(e.name for e in brought)
            words.append(f"not tested, because there is no {column}: {names}")
        left = [e for e in left if e not in brought]
    if left:
        words.append(f"not tested with these signals: {', '.join(e.name for e in left)}")
    return words
