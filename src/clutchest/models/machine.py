"""The contract between a machine and the inference.

A *machine* is everything that is known of one physical thing: equations, states, sensors, ways in
which its equations may be wrong, effects, faults, procedures.  The inference knows none of them by
name: it asks a :class:`Machine` for the piece, and says in one line where there is none.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from types import MappingProxyType
from typing import Any

from clutchest.errors import ClutchestError, nearest
from clutchest.models.effects.effect import TIME, Effect
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.fault import Follower, ModelFault
from clutchest.models.model import Model
from clutchest.models.regimes import RegimeRules
from clutchest.models.symbols import Column, Input, Parameter, Sensor, State

ENERGY = "energy"  # dissipated since the drive began: a covariate of every machine
_EMPTY: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Wear:
    """What wears, and how far.

    ``state`` tells it by its distance from the parameter ``nominal``, which grows downwards
    (``sign`` −1) or upwards (+1); ``rate_state`` is the wear per MJ of dissipated energy, "" where
    it is no state; ``effect`` and its number ``rate`` state that rate in a vehicle file,
    ``amount`` what was worn before.  ``unit`` of the amount; ``part`` that wears, in words.
    ``same_as``: effects that no signal can tell from it.
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
    """A stretch of the regimes' event mode, as ``summary.json`` reports it.

    ``hottest``: state of the friction surface, whose peak is reported; ``words``: what one is
    called, in singular and plural.
    """

    hottest: str
    words: tuple[str, str] = ("slip event", "slip events")


@dataclass(frozen=True, slots=True)
class Comparison:
    """A pair of quantities of the equations that should agree: as ``measured`` and as
    ``simulated``, in ``unit``; ``what`` they are, in words."""

    measured: str
    simulated: str
    unit: str
    what: str


@dataclass(frozen=True, slots=True)
class Separation:
    """What tells two errors or two states apart: the ``pair`` of names, and ``by`` which sensor or
    manoeuvre, in words."""

    pair: tuple[str, str]
    by: str


@dataclass(frozen=True)
class Machine:
    """Everything that the toolkit may ask of one physical thing.

    A piece that is left out means "has none": verbs that need it say so.

    ``name`` as vehicle files write it, ``what`` it is in a few words.  ``states``, ``parameters``,
    ``inputs``, ``sensors`` of the fullest form of the equations, ``columns`` the canonical signals
    that a vehicle may map.  ``equations(signals)`` gives the form that these signals can drive;
    ``at_rest(parameters, inputs)`` the states at the start of a drive, as far as they are known.
    ``regimes``: which equations hold when.

    ``output``: the model's output that files call ``clutch_torque``, "" for none; ``event``: what
    stretches of the regimes' event mode report; ``wear``; ``limits``: what ``[limits]`` of a
    vehicle file may state, with its unit.

    For discovery: ``error_terms``, ways in which an equation may be wrong that no effect knows;
    ``covariates``, quantities of the equations that an error may correlate with, beside inputs,
    states, time and energy; ``rates`` of inputs (name → input) and ``peaks`` (name → the state
    whose highest value so far it is); ``effects``, the library; ``separating_sensors`` and
    ``sensor_for`` (equation → sensor, "" for all others), which sensor would tell errors apart;
    ``compared``, the pair of a validation.

    For estimation: ``separating_manoeuvres``, what parts two states that one kind of measurement
    knows together.

    For diagnosis: ``faults`` of the equations, the ``fault_signals`` that their tests need, and
    ``followers``.  ``procedures`` and ``delay_relations`` for identification, ``pictures``.

    For simulation: ``generate``, a program of its own, and the names of its ``scenarios``; where
    there is none, ``excitations`` drive the machine's own equations.  ``template``: the shipped
    vehicle whose numbers a drafted one takes as guesses.  ``parts``: what reports call states.
    ``unsupported``: verb → why it cannot be asked of this machine.
    """

    name: str
    what: str
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    sensors: tuple[Sensor, ...]
    columns: tuple[Column, ...]
    equations: Callable[[Container[str]], Model]
    at_rest: Callable[[Mapping[str, float], Mapping[str, float]], Mapping[str, float]] = (
        lambda parameters, inputs: {}
    )
    regimes: RegimeRules = field(default_factory=RegimeRules)
    output: str = ""
    event: Event | None = None
    wear: Wear | None = None
    limits: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    error_terms: Mapping[str, ErrorTerm] = field(default_factory=lambda: _EMPTY)
    covariates: tuple[str, ...] = ()
    rates: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    peaks: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    effects: Mapping[str, Effect] = field(default_factory=lambda: _EMPTY)
    separating_sensors: tuple[Separation, ...] = ()
    sensor_for: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    compared: Comparison | None = None
    separating_manoeuvres: tuple[Separation, ...] = ()
    faults: tuple[ModelFault, ...] = ()
    fault_signals: tuple[str, ...] = ()
    followers: tuple[Follower, ...] = ()
    generate: Callable[..., Any] | None = None
    scenarios: Callable[[], Sequence[str]] = tuple
    template: str = ""
    parts: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    unsupported: Mapping[str, str] = field(default_factory=lambda: _EMPTY)

    def __post_init__(self) -> None:
        for piece, wrong in _defects(self):
            raise ClutchestError(f"machine '{self.name}': {piece} {wrong}")

    @property
    def units(self) -> dict[str, str]:
        """Canonical column → unit."""
        return {column.name: column.unit for column in self.columns}

    def column(self, name: str) -> Column | None:
        """A canonical column by name; None where there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def supports(self, verb: str) -> None:
        """Raises ClutchestError where this ``verb`` cannot be asked of the machine."""
        if verb in self.unsupported:
            raise ClutchestError(f"{verb}: not for '{self.name}': {self.unsupported[verb]}")

    def sensor_to_separate(self, equations: Sequence[str]) -> str:
        """The sensor that would tell errors in these equations apart, in words."""
        for separation in self.separating_sensors:
            if set(separation.pair) <= set(equations):
                return separation.by
        general = self.sensor_for.get("", "a second sensor of what is in question")
        kinds = dict.fromkeys(self.sensor_for.get(equation, general) for equation in equations)
        return " or ".join(kinds)


def _defects(machine: Machine) -> Iterator[tuple[str, str]]:
    """(piece, what is wrong with it) of a machine that cannot be registered."""
    if not re.fullmatch(r"[a-z]\w*", machine.name):
        yield "name", "must be a word in lower case"
    for piece in ("states", "inputs", "sensors", "columns"):
        if not getattr(machine, piece):
            yield piece, "is empty, expected at least one"
    for piece, names in (
        ("states", [s.name for s in machine.states]),
        ("parameters", [p.key for p in machine.parameters]),
        ("inputs", [i.name for i in machine.inputs]),
        ("sensors", [s.name for s in machine.sensors]),
        ("columns", [c.name for c in machine.columns]),
    ):
        for name in (n for n in names if names.count(n) > 1):
            yield piece, f"names '{name}' twice"
    yield from _unknown_names(machine)
    yield from _unknown_quantities(machine)


def _unknown_names(machine: Machine) -> Iterator[tuple[str, str]]:
    """Signals, states and parameters that are named and not declared."""
    columns, states = machine.units, [s.name for s in machine.states]
    inputs = [i.name for i in machine.inputs]
    of_columns = chain(
        (("sensors", s.column or s.name) for s in machine.sensors),
        (("regimes.signals", name) for name in machine.regimes.signals),
        (("fault_signals", name) for name in machine.fault_signals),
        (("followers", n) for f in machine.followers for n in (f.leader, f.follower)),
    )
    for piece, name in of_columns:
        if name not in columns:
            yield piece, f"has no column '{name}'" + nearest(name, columns)
    for name in machine.peaks.values():
        if name not in states:
            yield "peaks", f"has no state '{name}'" + nearest(name, states)
    for name in machine.rates.values():
        if name not in inputs:
            yield "rates", f"has no input '{name}'" + nearest(name, inputs)
    if machine.event is not None and machine.event.hottest not in states:
        yield "event", f"has no state '{machine.event.hottest}'"
    if machine.event is not None and not machine.regimes.event:
        yield "event", "needs the mode that it lasts, in regimes.event"
    if machine.wear is not None:
        for name in filter(None, (machine.wear.state, machine.wear.rate_state)):
            if name not in states:
                yield "wear", f"has no state '{name}'" + nearest(name, states)
    for sensor in machine.sensors:
        if sensor.mode and sensor.mode not in machine.regimes.modes:
            yield (
                "sensors",
                f"read in mode '{sensor.mode}'" + nearest(sensor.mode, machine.regimes.modes),
            )


def _unknown_quantities(machine: Machine) -> Iterator[tuple[str, str]]:
    """What the fullest form of the equations lacks."""
    try:
        model = machine.equations(machine.units)
    except AttributeError as error:
        yield "equations", f"cannot be written out: {error}"
        return
    if model.name != machine.name:
        yield "equations", f"are of model '{model.name}'"
    if model.anchor not in machine.units:
        yield "equations", f"have no column '{model.anchor}' as their anchor"
    for item in model.inputs:
        if item.default is None and item.name not in {*machine.units, *model.slopes}:
            yield "inputs", f"have no column '{item.name}'" + nearest(item.name, machine.units)
    if machine.output and machine.output not in model.outputs:
        yield "output", f"'{machine.output}' is none of the equations' outputs"
    for name, effect in machine.effects.items():
        if effect.name != name or effect.model != machine.name:
            yield "effects", f"has '{effect.name}' of model '{effect.model}' as '{name}'"
    known = {*machine.units, *(s.name for s in machine.states), *machine.covariates}
    known |= {*machine.rates, *machine.peaks, TIME, ENERGY}
    for name, term in machine.error_terms.items():
        for covariate in term.covariates:
            if covariate not in known:
                yield (
                    f"error term '{name}'",
                    f"has no covariate '{covariate}'" + nearest(covariate, known),
                )
    for fault in machine.faults:
        if not any(n.key == fault.key for n in fault.effect.gains):
            yield f"fault '{fault.name}'", f"has no gain '{fault.key}'"
