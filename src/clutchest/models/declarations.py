"""Small declarations of a machine: wear, events, comparison, separation of errors."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass

from clutchest.models.model import Model

ENERGY = "energy"  # dissipated since the drive began
REST = "rest_time"  # s: how long surfaces have not slid, and while they do, how long they had not
RECENT_SLIP = "recent_slip"  # the share of time that they slid of late, fading over RECENT
RECENT = 30.0  # s: moisture, a film, heat of a surface
ENGAGEMENTS = "engagements"  # so many times they have begun to slide
HISTORY = {
    "time": "s",
    ENERGY: "J",
    REST: "s",
    RECENT_SLIP: "1",
    ENGAGEMENTS: "1",
}  # every machine's
TURN = 6.283185307179586  # rad


@dataclass(frozen=True, slots=True)
class Wear:
    """The wear of a machine.

    It is the difference of ``state`` from the parameter ``nominal``, downwards (``sign`` −1) or
    upwards (+1); ``rate_state`` is the wear per MJ of dissipated energy, "" where it is no state;
    ``effect`` and its number ``rate`` state that rate in a vehicle file, ``amount`` the wear so
    far.  ``unit`` of the amount; ``part`` that wears, in words.  ``same_as``: effects that no
    signal can distinguish from it.
    """

    state: str
    nominal: str
    unit: str
    part: str
    sign: float = -1.0
    rate_state: str = ""
    effect: str = "wear"
    amount: str = "amount"
    rate: str = "rate"
    same_as: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """An interval of the regimes' event mode, as ``summary.json`` reports it.

    ``hottest``: state of the friction surface, whose peak is reported; ``words``: its name in
    singular and plural; ``slip``: columns of the two speeds that slip on each other, or of the slip
    itself, whose peak is reported.
    """

    hottest: str
    words: tuple[str, str] = ("slip event", "slip events")
    slip: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Driving:
    """Signals that say without friction, position or temperature what surfaces in the event mode
    turn to heat: a reported ``torque`` (Nm), less what accelerates the ``inertia`` (a parameter) of
    the side whose ``speed`` it changes, against the slip to the ``other`` speed.  ``largest``: a
    parameter, the torque's largest value."""

    torque: str
    inertia: str
    speed: str
    other: str
    largest: str

    @property
    def signals(self) -> tuple[str, ...]:
        """All signals that it names."""
        return (self.torque, self.speed, self.other)


@dataclass(frozen=True, slots=True)
class Storing:
    """An actuator that stores energy by its ``position`` alone, and dissipates the rest: the
    product of each of the ``pairs`` of signals is, to a factor above 0, power that it takes.  The
    position itself stands for its rate of change."""

    position: str
    pairs: tuple[tuple[str, str], ...]

    @property
    def signals(self) -> tuple[str, ...]:
        """All signals that it names."""
        return (self.position, *(name for pair in self.pairs for name in pair))


@dataclass(frozen=True, slots=True)
class Comparison:
    """A pair of quantities of the equations that should agree: as ``measured`` and as
    ``simulated``, in ``unit``; ``what`` they are, in words, and ``key`` in files: the first word
    of their names in ``fit.json``."""

    measured: str
    simulated: str
    unit: str
    what: str
    key: str = "output"


@dataclass(frozen=True, slots=True)
class Separation:
    """The separation of two errors or two states: the ``pair`` of names, and ``by`` which sensor or
    manoeuvre, in words."""

    pair: tuple[str, str]
    by: str


@dataclass(frozen=True, slots=True)
class OutputTracking:
    """How well a machine's output follows what is asked of it.

    An actuation lasts while the signal ``drive`` exceeds ``least`` in magnitude; the response is
    the first of the signals ``measured`` that is there, else the machine's estimated output, and
    counts from ``onset`` on.  ``request``: the signal that asks for the output, "" for none.
    ``unit`` of the output.
    """

    drive: str
    least: float
    measured: tuple[str, ...]
    onset: float
    unit: str
    request: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """All signals that it names."""
        return tuple(filter(None, (self.drive, *self.measured, self.request)))


@dataclass(frozen=True, slots=True)
class Judder:
    """Oscillation of the output while surfaces slide, as lines in a sensor's residual.

    ``sensors`` of the output, of which the first that is read counts; ``slip``: the weights by
    column whose sum it is, rad/s, of which the first that is mapped counts; ``least`` amplitude
    that matters, in ``unit``; ``slope`` (parameters, signals at hand, frequency in Hz, mean
    magnitude of the output) → by how much the friction coefficient must fall per m/s of sliding
    speed to make up for one per cent of critical damping, s/m.
    """

    sensors: tuple[str, ...]
    slip: tuple[Mapping[str, float], ...]
    least: float
    unit: str
    slope: Callable[[Mapping[str, float], Container[str], float, float], float]

    @property
    def signals(self) -> tuple[str, ...]:
        """All signals that it names."""
        return (*self.sensors, *(name for weights in self.slip for name in weights))


@dataclass(frozen=True)
class Inverse:
    """A machine turned round: what its actuator has to do for a requested output.

    ``model``: equations whose input ``request`` asks for the output and that contain the control
    which follows it; ``reached``: what answers to it, one of the ``columns``, quantities that are
    written, with their units; ``step`` s between their steps.
    """

    model: Model
    request: str
    reached: str
    columns: Mapping[str, str]
    step: float
