"""What sets a healthy truck apart from the model of its clutch: structure, sensors, population,
start, wander, driver; one declaration, drawn anew for every truck."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from clutchest.errors import ClutchestError, nearest
from clutchest.generator import sensing, structure
from clutchest.generator.population import Population
from clutchest.generator.scenarios import Random, TruckScenario
from clutchest.generator.sensing import Sensing
from clutchest.generator.stop_and_go import STOP_AND_GO
from clutchest.generator.structure import Structure
from clutchest.generator.surroundings import Disturbances, stream


@dataclass(frozen=True)
class Mismatch:
    """Nothing unless said.  ``hotter`` K: body and disc at the start, the housing by half of it;
    ``disc_hotter`` K: the disc beyond that.  ``wander``: ``torque_bias_walk`` Nm/√s and
    ``friction_walk`` 1/√s of :class:`Disturbances`.  ``own_driver``: the scenario asked for is not
    driven, but a timetable that no scenario contains."""

    structure: Structure = field(default_factory=Structure)
    sensing: Sensing = field(default_factory=Sensing)
    population: Population = field(default_factory=Population)
    hotter: float = 0.0
    disc_hotter: float = 0.0
    wander: Mapping[str, float] = field(default_factory=dict)
    own_driver: bool = False

    @classmethod
    def drawn(cls, groups: Iterable[str], seed: int) -> Mismatch:
        """Of these GROUPS, as ``seed`` draws them: each the same whatever others there are.

        Raises ClutchestError for an unknown group.
        """
        mismatch = cls()
        for group in groups:
            if group not in GROUPS:
                raise ClutchestError(f"unknown mismatch '{group}'" + nearest(group, GROUPS))
            mismatch = GROUPS[group](mismatch, stream(seed, "mismatch " + group))
        return mismatch

    def disturbed(self, disturbances: Disturbances) -> Disturbances:
        """With the wander."""
        return replace(disturbances, **self.wander)

    def plan(self, asked: TruckScenario) -> TruckScenario:
        """What is driven."""
        return STOP_AND_GO if self.own_driver else asked


Draw = Callable[[Mismatch, Random], Mismatch]


def _part(draw: Callable[[Structure, Random], Structure]) -> Draw:
    return lambda m, random: replace(m, structure=draw(m.structure, random))


def _sensors(draw: Callable[[Sensing, Random], Sensing]) -> Draw:
    return lambda m, random: replace(m, sensing=draw(m.sensing, random))


def _hot(m: Mismatch, random: Random) -> Mismatch:
    return replace(m, hotter=random.uniform(15.0, 60.0), disc_hotter=random.uniform(0.0, 60.0))


def _priors(m: Mismatch, random: Random) -> Mismatch:
    return replace(m, population=Population(width=1.5, skewed=True))


def _wander(m: Mismatch, random: Random) -> Mismatch:
    return replace(m, wander={"friction_walk": 5e-4, "torque_bias_walk": 0.5})


def _driver(m: Mismatch, random: Random) -> Mismatch:
    return replace(m, own_driver=True)


GROUPS: Mapping[str, Draw] = MappingProxyType(
    {
        "disc": _part(structure.two_node_disc),
        "flywheel": _part(structure.own_flywheel),
        "housing": _part(structure.split_housing),
        "engine-lag": _part(structure.lagging_engine),
        "driveline": _part(structure.soft_driveline),
        "torque-curve": _part(structure.bent_curve),
        "sensor-lag": _sensors(sensing.lagging_sensors),
        "noise-level": _sensors(sensing.other_noise),
        "noise-colour": _sensors(sensing.other_colour),
        "noise-tails": _sensors(sensing.heavy_tails),
        "sampling": _sensors(sensing.jittering),
        "priors": _priors,
        "hot-start": _hot,
        "wander": _wander,
        "driver": _driver,
    }
)
