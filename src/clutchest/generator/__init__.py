"""The independent truth: a truck with a dry clutch, simulated by a program of its own; in
``alsd`` an active limited-slip differential on its rig or in a car.

Nothing here knows the filter's model; plain numbers go in, arrays come out.
"""

from clutchest.generator.effects import EFFECTS, Effect
from clutchest.generator.generate import generate
from clutchest.generator.mismatch import GROUPS, Mismatch
from clutchest.generator.outsider import Outsider
from clutchest.generator.request import DriveRequest
from clutchest.generator.sampling import Channel, Sampled
from clutchest.generator.scenarios import SCENARIOS, TruckScenario
from clutchest.generator.surroundings import Disturbances

__all__ = [
    "EFFECTS",
    "GROUPS",
    "SCENARIOS",
    "Channel",
    "Disturbances",
    "DriveRequest",
    "Effect",
    "Mismatch",
    "Outsider",
    "Sampled",
    "TruckScenario",
    "generate",
]
