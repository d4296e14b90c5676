"""A model set up for its tests: a vehicle without spreads, a drive written down by hand, and the
filter compiled without any effect and with every effect of the library.

Nothing here comes from the generator: the drive is smooth by design, so that differences of
whole runs are clean.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property

from benches import Plausible, Setup
from benches.differential import DIFFERENTIAL
from benches.third import THIRD
from benches.truck import TRUCK
from clutchest.estimate import initial_state, timeline, whole_log
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, Filtered, FilterOptions
from clutchest.models.machine import Machine
from clutchest.models.model import Model
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle


@dataclass(frozen=True)
class Bench:
    """One model with everything that its tests need."""

    setup: Setup
    vehicle: Vehicle
    model: Model
    signals: Signals

    @classmethod
    def of(cls, model: str) -> Bench:
        """The bench of a model by name; its vehicle's parameters are certain."""
        setup = BENCHES[model]
        vehicle = load_vehicle(setup.vehicle, trust=True)
        certain = {key: replace(p, spread=0.0) for key, p in vehicle.parameters.items()}
        vehicle = replace(vehicle, parameters=certain)
        signals = setup.drive(vehicle, setup.duration, 0.0)
        return cls(setup, vehicle, vehicle.machine.equations(signals), signals)

    @property
    def plausible(self) -> Plausible:
        """Where the model must make sense."""
        return self.setup.plausible

    @cached_property
    def bare(self) -> Compiled:
        """The filter without effects."""
        return whole_log.compile_model(self.vehicle, self.model, ())

    @cached_property
    def full(self) -> Compiled:
        """The filter with every effect of the library present at gain 0."""
        effects = tuple(self.vehicle.machine.effects.values())
        return whole_log.compile_model(self.vehicle, self.model, effects)

    def timeline(self, compiled: Compiled, delays: Mapping[str, float] | None = None) -> Timeline:
        """The drive as events, signals late by ``delays`` s."""
        return timeline.build(self.signals, self.vehicle, compiled.model, 10.0, delays or {})

    def belief(self, compiled: Compiled, line: Timeline) -> Belief:
        """The prior at the first event, warm enough to excite every effect."""
        belief = initial_state.fresh(self.vehicle, compiled, line)
        for state, value in self.plausible.warm.items():
            belief.x[compiled.model.state(state)] = value
        return belief

    @cached_property
    def at_zero(self) -> tuple[Timeline, Filtered]:
        """Every effect at gain 0: the drive's events, and the run with signatures and gains."""
        line = self.timeline(self.full)
        filtered = whole_log.run(
            self.full, line, self.belief(self.full, line), FilterOptions(keep=True)
        )
        return line, filtered


@cache
def machine(model: str) -> Machine:
    """The machine of a bench by its model's name."""
    return load_vehicle(BENCHES[model].vehicle, trust=True).machine


BENCHES: dict[str, Setup] = {"dry_clutch": TRUCK, "alsd": DIFFERENTIAL, "third": THIRD}
