"""What a machine of one's own is written with: one import for its file.

See ``docs/machine.md``, "Your own machine".
"""

from clutchest.models.declarations import (
    Comparison,
    Driving,
    Event,
    Inverse,
    OutputTracking,
    Separation,
    Storing,
    Wear,
)
from clutchest.models.effects.effect import Effect, Gains, Lateness, Number
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.fault import Actuator, Demand, Follower, ModelFault
from clutchest.models.machine import Machine
from clutchest.models.model import Model, Quantities
from clutchest.models.regimes import Observed, RegimeRules, Regimes
from clutchest.models.symbols import Column, Input, Parameter, Sensor, State

__all__ = [
    "Actuator",
    "Column",
    "Comparison",
    "Demand",
    "Driving",
    "Effect",
    "ErrorTerm",
    "Event",
    "Follower",
    "Gains",
    "Input",
    "Inverse",
    "Lateness",
    "Machine",
    "Model",
    "ModelFault",
    "Number",
    "Observed",
    "OutputTracking",
    "Parameter",
    "Quantities",
    "RegimeRules",
    "Regimes",
    "Sensor",
    "Separation",
    "State",
    "Storing",
    "Wear",
]
