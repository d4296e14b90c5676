"""How the trucks of a make scatter around its data sheet."""

from __future__ import annotations

from dataclasses import dataclass

from clutchest.generator.scenarios import Random

SHAPE = 4.0  # of the gamma distribution: a skewness of 1


@dataclass(frozen=True)
class Population:
    """Parameters scatter by ``width`` stated spreads; ``skewed``: each by a gamma distribution of
    skewness 1 whose longer tail points either way, instead of a normal one."""

    width: float = 1.0
    skewed: bool = False

    def deviate(self, random: Random) -> float:
        """How many stated spreads one parameter of one truck is off."""
        if not self.skewed:
            return self.width * float(random.standard_normal())
        side = float(random.choice((-1.0, 1.0)))
        return self.width * side * (float(random.gamma(SHAPE)) - SHAPE) / SHAPE**0.5


NORMAL = Population()  # as the vehicle file states it
