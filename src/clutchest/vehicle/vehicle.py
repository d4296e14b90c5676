"""A vehicle: one TOML file that maps its bus signals and states its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from math import isfinite
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest import units
from clutchest.can.database import DatabaseFile
from clutchest.errors import ClutchestError, UnknownNameError, nearest
from clutchest.models import machine_in_file, machine_of
from clutchest.models.error_curve import ErrorCurve, Numbers, numbers_of
from clutchest.shown import Showing, Shown, printed, with_unit
from clutchest.signals import Floats

if TYPE_CHECKING:
    from clutchest.models.effects import Effect
    from clutchest.models.machine import Machine


FALSE_ALARMS = 1.0  # per 1000 h, unless a vehicle file has another number


SPEED = "m/s"  # of the road
FORCE = "N"  # of a tyre on it


def _says_guess(source: str) -> bool:
    """Whether a number is a guess by what its source says."""
    return source.lower().startswith("guess")


@dataclass(frozen=True, slots=True)
class BusSignal:
    """One signal on the bus: the DBC's names, and the bus unit the file claims for it."""

    message: str
    signal: str
    unit: str


LONG_S = 1.0  # s, more than a sensor of a clutch is behind the others
TIMING = 0.002  # s, by which a signal may be late or early in a healthy vehicle, unless stated


@dataclass(frozen=True, slots=True)
class TableColumn:
    """A column of a table of decoded signals, by name; without a ``unit`` the table states it."""

    column: str
    unit: str = ""


@dataclass(frozen=True, slots=True)
class SignalMap:
    """How the bus makes one canonical signal, and how well.

    A signal that only tables have is on no bus: its ``bus`` has no message.

    ``noise`` standard deviation in the canonical unit (SI, mm for positions), ``delay`` s and
    ``delay_spread``, its standard deviation from one healthy vehicle to the next,
    ``noise_ar`` AR(1) coefficient per sample of this signal, ``noise_source`` the source of both;
    one that begins with "guess" makes them a guess.

    A signal in percent is one of ``reference`` (canonical unit), a J1939 torque ``bus`` plus
    ``fraction`` less ``friction``; a ``reference_source`` that begins with "guess" makes it one.
    A wheel speed becomes an input-shaft speed through ``gears`` (ratio engine/wheel, first gear
    first), in a unit of length per time through the tyres' rolling ``radius`` (m); the gear is
    taken from ``gear`` where mapped, which has ``gear_numbers`` in them (1, 2, … unless given),
    else inferred; with ``other``, the second wheel of the axle,
    the mean of both turns the differential.
    A torque that is a difference, of two half-shafts say, is ``bus`` less the signal ``less``; in a
    unit of force, as that of the tyres, it becomes one through ``radius``.

    ``minimum``, ``maximum`` in the bus unit: samples outside are invalid.  ``source_address``
    (J1939) and ``channel`` choose among several senders.  ``period`` s, where the DBC states no
    cycle time or another vehicle's.
    """

    name: str
    bus: BusSignal
    noise: float
    delay: float = 0.0
    delay_spread: float = TIMING
    noise_ar: float = 0.0
    noise_source: str = ""
    reference: float | None = None
    reference_source: str = ""
    fraction: BusSignal | None = None
    friction: BusSignal | None = None
    gears: tuple[float, ...] = ()
    radius: float | None = None
    gear: BusSignal | None = None
    gear_numbers: tuple[int, ...] = ()
    other: BusSignal | None = None
    less: BusSignal | None = None
    minimum: float | None = None
    maximum: float | None = None
    source_address: int | None = None
    channel: int | None = None
    period: float | None = None

    @property
    def on_bus(self) -> bool:
        """Whether frames carry it."""
        return bool(self.bus.message)

    def through_radius(self, value: Floats) -> Floats:
        """A speed of the road (n) in the bus unit as one of the wheels in rad/s, a tyre's force as
        its torque in Nm."""
        assert self.radius is not None
        if units.compatible(self.bus.unit, FORCE):
            return units.convert(value, self.bus.unit, FORCE) * self.radius
        return units.convert(value, self.bus.unit, SPEED) / self.radius

    def before_radius(self, value: Floats) -> Floats:
        """What the bus reads of such a speed or torque (n), in its unit."""
        assert self.radius is not None
        if units.compatible(self.bus.unit, FORCE):
            return units.convert(value / self.radius, FORCE, self.bus.unit)
        return units.convert(value * self.radius, SPEED, self.bus.unit)

    @property
    def noise_guessed(self) -> bool:
        """Whether the noise is a guess, by its source."""
        return _says_guess(self.noise_source)

    @property
    def reference_guessed(self) -> bool:
        """Whether what 100 % stands for is a guess, by its source."""
        return _says_guess(self.reference_source)


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """``value`` ± ``spread`` (one standard deviation) in ``unit``, the model's own unit."""

    value: float
    unit: str
    spread: float = 0.0
    source: str = ""

    @property
    def guessed(self) -> bool:
        """Whether the value is a guess, by its source."""
        return _says_guess(self.source)


def unlikely(
    machine: Machine,
    parameters: Mapping[str, ParameterValue],
    signals: Mapping[str, SignalMap],
) -> Iterator[str]:
    """One line for each number that no such machine, and no such sensor, is known to have."""
    for p in machine.parameters:
        value, (low, high) = parameters[p.key].value, p.plausible
        if not low <= value <= high:
            yield f"unlikely: {p.key} = {value:g} {p.unit}, such machines have {low:g} … {high:g}"
    for name, signal in signals.items():
        column = machine.column(name)
        if signal.delay > LONG_S:
            yield (
                f"unlikely: signals.{name}.delay = {signal.delay:g} s, such sensors have at most "
                f"{LONG_S:g}"
            )
        if column is not None and signal.noise > column.noisiest:
            yield (
                f"unlikely: signals.{name}.noise = {signal.noise:g} {column.unit}, such sensors "
                f"have at most {column.noisiest:g}"
            )


class Parameters(dict[str, ParameterValue]):
    """Key → value of a vehicle; others make another vehicle."""

    def __missing__(self, key: str) -> ParameterValue:
        raise UnknownNameError(f"no parameter '{key}'{nearest(str(key), self)}")

    def _fixed(self, *_: Any, **__: Any) -> Any:
        raise ClutchestError(
            "the parameters of a vehicle are fixed; expected vehicle.with_parameters(KEY=VALUE), "
            "which gives another"
        )

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _fixed

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


@dataclass(frozen=True, slots=True)
class Estimation:
    """How the filter treats one state: role adaptive, constant or nuisance."""

    role: str
    process_noise: float
    initial_std: float
    useful_std: float
    wander: float


@dataclass(frozen=True, slots=True)
class HealthyGain:
    """How far an effect goes in a healthy vehicle: the standard deviation ``std`` of one of its
    gains, in the gain's unit."""

    effect: str
    key: str
    std: float

    @property
    def gain(self) -> str:
        """The gain's name."""
        return f"{self.effect}.{self.key}"


@dataclass(frozen=True, slots=True)
class SmoothError:
    """How far an equation of a healthy machine may be off, smoothly, over one ``covariate``: the
    error of ``error_term`` has a standard deviation ``std`` (in the unit that the term is told in)
    and is correlated over a ``length`` (unit of the covariate)."""

    error_term: str
    covariate: str
    std: float
    length: float


@dataclass(frozen=True, slots=True, repr=False)
class Vehicle(Showing):
    """Everything that is particular to one vehicle.

    ``hash`` is over the file's content.  Two vehicles are equal when their content is, wherever
    their files lie.  A DBC that is neither beside the file nor shipped stands in ``dbc`` as the
    bare name; the folders of a log are searched for it when that log is read.  ``effects``: effect
    → number → value, ``effects_spread`` the standard deviation of gains that are not known exactly;
    ``curves``: the effects that are curves.  ``notes``: what a user should know of the file.
    ``columns``: canonical name, or ``time``, → column of a table.
    ``checked`` names the messages whose counter and checksum are verified; ``codes``: fault → SPN
    and FMI (None: the fault's own).  ``model_file``: the Python file of a user's own machine;
    ``digests`` of the content of that and of the ``effects_files``, as they were when the vehicle
    was loaded: other content is not run.  ``bench`` of the machine that its logs are from, "" for
    the machine as a whole.
    """

    name: str
    model: str
    path: Path = field(compare=False)
    hash: str = field(compare=False)
    dbc: tuple[DatabaseFile, ...]
    signals: Mapping[str, SignalMap]
    parameters: Mapping[str, ParameterValue]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    effects_spread: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    estimation: Mapping[str, Estimation] = field(default_factory=dict)
    healthy: tuple[HealthyGain, ...] = ()
    smooth_errors: tuple[SmoothError, ...] = ()
    modes: Mapping[str, float] = field(default_factory=dict)  # thresholds, SI and mm
    limits: Mapping[str, ParameterValue] = field(default_factory=dict)
    monitors: Mapping[str, float] = field(default_factory=dict)
    codes: Mapping[str, tuple[int, int | None]] = field(default_factory=dict)
    effects_files: tuple[Path, ...] = field(default=(), compare=False)
    curves: Mapping[str, ErrorCurve] = field(default_factory=dict)
    checked: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=(), compare=False)
    model_file: Path | None = field(default=None, compare=False)
    digests: Mapping[Path, str] = field(default_factory=dict, compare=False)
    columns: Mapping[str, TableColumn] = field(default_factory=dict)
    bench: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", Parameters(self.parameters))

    def shown(self) -> Shown:
        """The parameters with unit, spread and source."""
        guessed = f", {len(self.guessed)} of them guessed" if self.guessed else ""
        counts = f"{len(self.signals)} signals, {len(self.parameters)} parameters{guessed}"
        rows = [
            (key, f"{p.value:.6g}", printed(p.unit), f"{p.spread:.3g}", p.source)
            for key, p in self.parameters.items()
        ]
        head = ("parameter", "value", "unit", "spread (1σ)", "source")
        return Shown(f"{self.name}, {self.model}, {counts}", head, rows)

    @property
    def false_alarms_per_1000h(self) -> float:
        """False alarms per 1000 h and monitor that the vehicle file allows."""
        return self.monitors.get("false_alarms_per_1000h", FALSE_ALARMS)

    @property
    def machine(self) -> Machine:
        """The machine by name, or the one defined in ``model_file``."""
        if self.model_file is None:
            machine = machine_of(self.model)
        else:
            machine = machine_in_file(self.model_file, self.digests.get(self.model_file, ""))
        return machine.on_bench(self.bench) if self.bench else machine

    @property
    def library(self) -> Mapping[str, Effect]:
        """Name → effect, of the machine's library and of the user's own files."""
        from clutchest.models.effects import with_files

        return with_files(self.machine.effects, self.effects_files, self.digests)

    @property
    def python_files(self) -> tuple[Path, ...]:
        """The Python files that it names."""
        return (*([self.model_file] if self.model_file else []), *self.effects_files)

    def with_parameters(self, **values: float) -> Vehicle:
        """The same vehicle with other values of some parameters, in the units that they have here.

        Their spreads stay.  Raises ClutchestError for a parameter that it does not have, or a value
        that is no finite number or none that a vehicle file may state.
        """
        parameters = dict(self.parameters)
        bounds = {p.key: (p.lower, p.upper) for p in self.machine.parameters}
        for key, value in values.items():
            old = self.parameters[key]
            if not isinstance(value, Real) or not isfinite(value):
                raise ClutchestError(f"{key}: {value!r} is no finite number")
            low, high = bounds[key]
            if not low <= value <= high:
                given = with_unit(f"{value:g}", old.unit)
                raise ClutchestError(f"{key} = {given}, expected {low:g} … {high:g}")
            source = f"given instead of {old.value:g}"
            parameters[key] = replace(old, value=float(value), source=source)
        outdated = {*unlikely(self.machine, self.parameters, self.signals)}
        file = f"{self.path.name}: "
        notes = (
            *(note for note in self.notes if note.removeprefix(file) not in outdated),
            *unlikely(self.machine, parameters, self.signals),
        )
        digest = sha256(f"{self.hash} {sorted(values.items())}".encode()).hexdigest()
        hash_ = digest[: len(self.hash)]
        return replace(self, parameters=parameters, hash=hash_, notes=notes)

    @property
    def guessed(self) -> tuple[str, ...]:
        """Keys of the parameters whose values are guesses."""
        return tuple(key for key, p in self.parameters.items() if p.guessed)

    @property
    def effect_numbers(self) -> dict[str, Mapping[str, float]]:
        """Effect → number → value of every effect in the model, those of ``curves`` included."""
        return self._with_curves(self.effects, 0)

    @property
    def effect_spreads(self) -> dict[str, Mapping[str, float]]:
        """The standard deviations of the same, where they are not known exactly."""
        return self._with_curves(self.effects_spread, 1)

    def _with_curves(self, stated: Numbers, which: int) -> dict[str, Mapping[str, float]]:
        numbers = dict(stated)
        for name, curve in self.curves.items():
            timing = self.machine.error_terms[curve.error_term].late is not None
            numbers |= numbers_of(name, curve, timing)[which]
        return numbers
