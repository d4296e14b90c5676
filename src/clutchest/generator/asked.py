"""What every generator is asked for, checked before anything is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol, TypeVar

import numpy as np

from clutchest.errors import ClutchestError, nearest


class Timed(Protocol):
    """A scenario that lasts ``duration`` s unless told otherwise."""

    @property
    def duration(self) -> float:
        """s."""


Plan = TypeVar("Plan", bound=Timed)


def asked(
    scenario: str,
    scenarios: Mapping[str, Plan],
    duration: float | None,
    seeds: Mapping[str, int],
    parameters: Mapping[str, float],
    needed: Iterable[str],
) -> tuple[Plan, float]:
    """The scenario of that name and how long it is to last, s.

    Raises ClutchestError for an unknown scenario, a duration or a seed that cannot be, and a
    ``needed`` parameter that is missing.
    """
    if scenario not in scenarios:
        raise ClutchestError(f"unknown scenario '{scenario}'" + nearest(scenario, scenarios))
    plan = scenarios[scenario]
    lasts = plan.duration if duration is None else float(duration)
    if not 0 < lasts < np.inf:
        raise ClutchestError(f"duration {lasts:g} s: expected more than 0 s")
    for name, number in seeds.items():
        if number < 0:
            raise ClutchestError(f"{name} {number}: expected 0 or more")
    for key in needed:
        if key not in parameters:
            raise ClutchestError(f"parameter '{key}' is missing" + nearest(key, parameters))
    return plan, lasts
