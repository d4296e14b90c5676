"""The independent truth of the active limited-slip differential, on its rig and in a car."""

from clutchest.generator.alsd.effects import EFFECTS
from clutchest.generator.alsd.generate import generate
from clutchest.generator.alsd.scenarios import SCENARIOS

__all__ = ["EFFECTS", "SCENARIOS", "generate"]
