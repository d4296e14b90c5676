"""What a generator is asked for, checked before anything is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np

from clutchest.errors import ClutchestError, nearest
from clutchest.generator.effects import Values
from clutchest.generator.mismatch import Mismatch
from clutchest.generator.outsider import Outsider
from clutchest.generator.sampling import Channel
from clutchest.generator.surroundings import Disturbances


class Timed(Protocol):
    """A scenario that lasts ``duration`` s unless a request says otherwise."""

    @property
    def duration(self) -> float:
        """s."""


Plan = TypeVar("Plan", bound=Timed)


@dataclass(frozen=True)
class DriveRequest:
    """A drive of ``scenario`` with a machine drawn around ``parameters`` (keys and units of its
    vehicle file) with standard deviations ``spreads``, undrawn if ``nominal``, as ``channels`` of a
    bus show it.

    ``duration`` s, the scenario's own unless given; ``effects`` that act, from ``onset`` s on;
    ``outliers`` the share of samples that are far off.  ``truck_seed`` draws the machine's
    parameters, ``seed`` all that a drive brings: load, road, weather, noise and ``disturbances``;
    the same unless said.
    ``outsider``: an unmodelled effect, none of ``effects``; ``mismatch``: what sets a healthy
    machine apart from the model of it; ``deviations``: what a paper admits that its model gets
    wrong.
    """

    parameters: Values
    spreads: Values
    scenario: str
    seed: int
    channels: Sequence[Channel]
    nominal: bool = False
    duration: float | None = None
    effects: Mapping[str, Values] = field(default_factory=dict)
    onset: float = 0.0
    disturbances: Disturbances = field(default_factory=Disturbances)
    outliers: float = 0.0
    truck_seed: int | None = None
    outsider: Outsider | None = None
    mismatch: Mismatch = field(default_factory=Mismatch)
    deviations: Values = field(default_factory=dict)

    @property
    def machine_seed(self) -> int:
        """What the machine's own parameters are drawn with."""
        return self.seed if self.truck_seed is None else self.truck_seed

    def from_the_start(self) -> None:
        """Raises ClutchestError where the effects are to begin within the drive."""
        if self.onset:
            raise ClutchestError(
                f"onset {self.onset:g} s: effects on this machine act from the start of a drive"
            )

    def plan(self, scenarios: Mapping[str, Plan], needed: Iterable[str]) -> tuple[Plan, float]:
        """The scenario of that name and how long it is to last, s.

        Raises ClutchestError for an unknown scenario, a duration or a seed that cannot be, and a
        ``needed`` parameter that is missing.
        """
        name = self.scenario
        if name not in scenarios:
            raise ClutchestError(f"unknown scenario '{name}'" + nearest(name, scenarios))
        plan = scenarios[name]
        try:
            lasts = plan.duration if self.duration is None else float(self.duration)
        except (TypeError, ValueError):
            raise ClutchestError(f"duration {self.duration!r}: expected a number, s") from None
        if not 0 < lasts < np.inf:
            raise ClutchestError(f"duration {lasts:g} s: expected more than 0 s")
        if not 0.0 <= self.onset < lasts:
            raise ClutchestError(f"onset {self.onset:g} s: expected 0 to the {lasts:g} s it lasts")
        for what, number in (("seed", self.seed), ("truck_seed", self.machine_seed)):
            if not isinstance(number, int | np.integer) or number < 0:
                raise ClutchestError(f"{what} {number}: expected a whole number, 0 or more")
        for key in needed:
            if key not in self.parameters:
                raise ClutchestError(
                    f"parameter '{key}' is missing" + nearest(key, self.parameters)
                )
        return plan, lasts
