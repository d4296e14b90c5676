"""What a model is made of: states, parameters, inputs and sensors, each with its unit."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True, slots=True)
class State:
    """A quantity with memory.

    ``process_noise`` (unit/√s) and ``initial_std`` (unit) hold where the vehicle file is silent;
    ``useful_std`` is the largest standard deviation at which the estimate still tells something;
    ``informed_by`` is the manoeuvre that lowers it.  ``parked_noise`` (unit/√s) is what a parked
    vehicle adds: wear and friction stay as they were; ``slip_noise`` (unit/√J) is what slip adds,
    by the energy it turns to heat.  What is not ``carried`` starts every drive
    from its prior.  ``healthy_std`` (unit) is how far from nominal it starts in a healthy vehicle,
    where ``initial_std`` is wider because it allows for ageing.  ``prior`` is the parameter whose
    spread is where the state starts, relative to its value for a pure number.  A ``stiff`` state
    relaxes faster than the steps that everything else asks for.  A ``factor`` is always above 0,
    and measurements move its logarithm.
    """

    name: str
    unit: str
    symbol: str
    what: str
    process_noise: float
    initial_std: float
    useful_std: float
    informed_by: str = ""
    parked_noise: float = 0.0
    slip_noise: float = 0.0
    carried: bool = True
    healthy_std: float | None = None
    role: str = "adaptive"  # adaptive | constant | nuisance
    stiff: bool = False
    factor: bool = False
    prior: str = ""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A constant of the equations, from the vehicle file; bounds in ``unit``."""

    key: str
    unit: str
    symbol: str
    what: str
    lower: float = -inf
    upper: float = inf


@dataclass(frozen=True, slots=True)
class Input:
    """A signal that drives the equations.  ``default`` stands in where no such signal is mapped;
    None means that the model cannot do without.  ``gap``: longest hole, s, that may be bridged."""

    name: str
    unit: str
    symbol: str
    what: str
    default: float | None = None
    gap: float = 0.5


@dataclass(frozen=True, slots=True)
class Sensor:
    """A quantity that the model predicts, compared with what was measured.

    It is read from the signal ``column`` (its own name unless given), only while the clutch is in
    ``mode`` (any unless given).  ``repeats``: s, for how long the estimator takes a reading to
    repeat its own error, so that the average over twice as long is worth one reading: what the
    equations lack of second order is no noise that hundreds of readings a second average away.
    """

    name: str
    unit: str
    symbol: str
    what: str
    column: str = ""
    mode: str = ""
    repeats: float = 0.0
