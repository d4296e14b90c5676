"""What a model is made of: states, parameters, inputs and sensors, each with its unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class State:
    """A quantity with memory.

    ``process_noise`` (unit/√s) and ``initial_std`` (unit) hold unless the vehicle file has others;
    ``useful_std`` is the largest standard deviation at which the estimate is of use;
    ``informed_by`` is the manoeuvre that lowers it.  ``parked_noise`` (unit/√s) is what a parked
    vehicle adds: wear and friction stay as they were; ``slip_noise`` (unit/√J) is what slip adds,
    by the energy it turns to heat.  What is not ``carried`` starts every drive
    from its prior.  ``healthy_std`` (unit) is how far from nominal it starts in a healthy vehicle,
    where ``initial_std`` is wider because it allows for ageing.  ``prior`` is the parameter whose
    spread is where the state starts, relative to its value for a pure number.  A ``stiff`` state
    relaxes faster than the steps that everything else asks for.  A ``factor`` is always above 0,
    and measurements move its logarithm.

    ``possible`` (unit): the lowest and the highest value that is physically possible.

    For discovery: ``wander`` (unit/√s) is as far as it may wander, as a random walk, in a healthy
    machine that is driven; unless the vehicle file says otherwise.
    For fault tests: ``restart_std`` (unit) is how far from rest it may start in a healthy machine
    that is restarted warm, 0 for no further than at any start; ``drift`` how far it drifts in a
    healthy machine, in standard deviations of its start per √h.
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
    restart_std: float = 0.0
    drift: float = 0.0
    wander: float = 0.0
    possible: tuple[float, float] = (-inf, inf)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A constant of the equations, from the vehicle file; bounds in ``unit``.

    ``plausible`` (unit): what such machines have; a value outside is used, and said.
    """

    key: str
    unit: str
    symbol: str
    what: str
    lower: float = -inf
    upper: float = inf
    plausible: tuple[float, float] = (-inf, inf)


@dataclass(frozen=True, slots=True)
class Input:
    """A signal that drives the equations.  ``default`` is used where no such signal is mapped;
    None: the model requires the signal.  ``gap``: longest gap, s, that may be bridged.  ``exact``:
    its noise is nothing beside what the equations are off by, and derivatives are those at its
    readings.  What a controller makes at once of a sensor's noise is not exact.  ``smooth``: a mass
    or a filter is behind it, so that its samples show how it turns between them; beside a sharp
    bend of another, as of a voltage that is switched, fits take no reading."""

    name: str
    unit: str
    symbol: str
    what: str
    default: float | None = None
    gap: float = 0.5
    exact: bool = False
    smooth: bool = False


@dataclass(frozen=True, slots=True)
class Sensor:
    """A quantity that the model predicts, compared with what was measured.

    It is read from the signal ``column`` (its own name unless given), only while the clutch is in
    ``mode`` (any unless given).  ``repeats``: s, for how long the estimator takes a reading to
    repeat its own error, so that the average over twice as long counts as one reading: errors of
    second order in the equations do not average out over hundreds of readings a second.
    ``tolerance``: as many standard deviations as innovations may have, in the median over ten
    seconds, where the equations are wrong by the largest plausible errors; beyond, signals and
    model contradict each other.  ``least``: of the quantity, below which the equations do not hold,
    as an engine that has stalled does not give the torque that it reports: fits take no reading
    there.
    """

    name: str
    unit: str
    symbol: str
    what: str
    column: str = ""
    mode: str = ""
    repeats: float = 0.0
    tolerance: float = 10.0
    least: float = -inf


@dataclass(frozen=True, slots=True)
class Magnitude:
    """How large the readings of a signal are in any drive in which it is not zero.

    The ``largest`` (all but 1 %) lie between these, times the parameter ``of`` if there is one;
    the ``smallest`` (5 %) of those that are not zero is not above this.  ``moves``: a signal that
    varies only under readings as large.
    """

    largest: tuple[float, float]
    smallest: float = inf
    of: str = ""
    moves: str = ""


@dataclass(frozen=True, slots=True)
class Column:
    """A canonical signal that a vehicle file may map.

    ``possible``: lowest and highest value that is physically possible, and the fastest change, per
    s.  ``rests``: it may stay at exactly 0 without being frozen.  Names on a bus: its ``spn``
    (J1939), a regular expression ``named`` that its name matches, ``companions`` (SPNs of signals
    that belong to it, by the vehicle file's key), ``reference_spn`` of what 100 % of it stands for.
    ``magnitude``: how large its readings are, by which a wrong unit of a table shows.
    ``geared_by``: the signal by which a gear is inferred, where a wheel speed times a gear's ratio
    can stand in for this one.  ``noisiest``: the largest standard deviation that such a sensor has.
    ``instead``: columns that together make this one needless.
    """

    name: str
    unit: str
    possible: tuple[float, float, float] | None = None
    rests: bool = False
    spn: int | None = None
    named: str = ""
    companions: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    reference_spn: int | None = None
    geared_by: str = ""
    magnitude: Magnitude | None = None
    noisiest: float = inf
    instead: tuple[str, ...] = ()
