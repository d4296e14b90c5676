"""The contract between a machine and the inference.

A *machine* is everything that is known of one physical thing: equations, states, sensors, ways in
which its equations may be wrong, effects, faults, procedures.  The inference knows none of them by
name: it asks a :class:`Machine` for the piece, and says in one line where there is none.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import chain
from types import MappingProxyType
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from clutchest import units
from clutchest.errors import ClutchestError, nearest
from clutchest.models.declarations import Comparison, Event, Separation, Wear
from clutchest.models.delay_relations import DelayRelation
from clutchest.models.effects.effect import RESERVED, TIME, Effect
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.experiments import Benches, BenchExperiment
from clutchest.models.fault import Demand, Follower, ModelFault
from clutchest.models.model import POWER, Expressions, Model
from clutchest.models.procedures import Picture, Procedure
from clutchest.models.regimes import RegimeRules
from clutchest.models.symbols import Column, Input, Parameter, Sensor, State
from clutchest.models.thresholds import THRESHOLD_UNITS
from clutchest.signals import Floats

ENERGY = "energy"  # dissipated since the drive began: a covariate of every machine
Excitation = Callable[
    [np.random.Generator, Floats, Mapping[str, float]], Mapping[str, Floats]
]  # random numbers, times (k,) s, parameters → inputs by name, (k,) each
OwnEffects = Callable[[Mapping[Effect, Mapping[str, float]], Mapping[str, float]], Any]
POINTS = 16  # at which the equations are tried
_EMPTY: Mapping[str, Any] = MappingProxyType({})


NEEDED: Mapping[str, tuple[tuple[Callable[[Machine], object], str], ...]] = {
    "discover": (
        (lambda machine: machine.error_terms, "error terms"),
        (lambda machine: machine.effects, "effects"),
    ),
    "simulate": (
        (lambda machine: machine.generate or machine.excitations, "generator and no excitations"),
    ),
}  # verb → pieces without which it cannot be asked, each in words


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
    ``covariates``, quantities of the equations that an error may correlate with (name → unit),
    beside inputs, states, time and energy; ``rates`` of inputs (name → input) and ``peaks`` (name →
    the state whose highest value so far it is); ``effects``, the library;
    ``separating_sensors`` and ``sensor_for`` (equation → sensor, "" for all others), which sensor
    would separate errors; ``compared``, the pair of a validation.

    For estimation: ``separating_manoeuvres``, what parts two states that one kind of measurement
    knows together.

    For diagnosis: ``faults`` of the equations, the ``fault_signals`` that their tests need,
    ``followers`` and ``demands``.

    For identification: ``procedures``, ways to determine some of the parameters; ``experiments`` on
    ``benches`` that determine some of them by equations of their own; ``pictures`` of a
    fit of all of them; ``relative_states`` (state → parameters): states that start from their
    nominal value where all of these parameters are fitted, because they are relative to them;
    ``delay_relations``, how late signals are behind the equations' anchor.

    For simulation: ``generate``, a program of its own, and the names of its ``scenarios``;
    ``own_effects`` (effect → its numbers, parameters by key) gives the generator's ``Outsider``
    for a user's own effects; where
    there is none, ``excitations`` drive the machine's own equations: scenario → function (random
    numbers, times (k,) s, parameters by key) that gives the inputs by name, (k,) each, as the bus
    reports them.  ``template``: the shipped vehicle whose numbers a drafted one takes as guesses.
    ``unsupported``: verb → why it cannot be applied to this machine.
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
    covariates: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
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
    demands: tuple[Demand, ...] = ()
    procedures: tuple[Procedure, ...] = ()
    experiments: tuple[BenchExperiment, ...] = ()
    benches: Benches | None = None
    pictures: tuple[Picture, ...] = ()
    relative_states: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: _EMPTY)
    delay_relations: tuple[DelayRelation, ...] = ()
    generate: Callable[..., Any] | None = None
    scenarios: Callable[[], Sequence[str]] = tuple
    own_effects: OwnEffects | None = None
    excitations: Mapping[str, Excitation] = field(default_factory=lambda: _EMPTY)
    template: str = ""
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

    @classmethod
    def of(
        cls,
        model: Model,
        what: str,
        *,
        columns: Iterable[Column] = (),
        error_terms: Iterable[ErrorTerm] = (),
        effects: Iterable[Effect] = (),
        **pieces: Any,
    ) -> Machine:
        """The machine of a single form of the equations, and whatever other ``pieces`` it has.

        ``columns``: those of the model's inputs and sensors unless given.  Raises ClutchestError
        naming the piece that is wrong.
        """
        known = {field.name for field in fields(cls)}
        for piece in (name for name in pieces if name not in known):
            raise ClutchestError(
                f"machine '{model.name}': there is no piece '{piece}'" + nearest(piece, known)
            )
        units = {item.name: item.unit for item in model.inputs if item.name not in model.slopes}
        units |= {sensor.column or sensor.name: sensor.unit for sensor in model.sensors}
        return cls(
            name=model.name,
            what=what,
            states=model.states,
            parameters=model.parameters,
            inputs=model.inputs,
            sensors=model.sensors,
            columns=tuple(columns) or tuple(Column(name, unit) for name, unit in units.items()),
            equations=lambda signals: model,
            error_terms=_by_name("error_terms", model, ((t.equation, t) for t in error_terms)),
            effects=_by_name("effects", model, ((effect.name, effect) for effect in effects)),
            **pieces,
        )

    @property
    def optional_columns(self) -> frozenset[str]:
        """Columns that the equations can do without: of inputs with a default, and demands."""
        inputs = {item.name for item in self.inputs if item.default is not None}
        return frozenset(inputs.union(*({*d.demands, d.released} for d in self.demands)))

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """Names of what it can be simulated in."""
        return (*self.scenarios(), *self.excitations)

    def supports(self, verb: str) -> None:
        """Raises ClutchestError where this ``verb`` cannot be asked of the machine."""
        if verb in self.unsupported:
            raise ClutchestError(f"{verb}: not for '{self.name}': {self.unsupported[verb]}")
        for lacking in (words for piece, words in NEEDED.get(verb, ()) if not piece(self)):
            raise ClutchestError(f"{verb}: machine '{self.name}' declares no {lacking}")

    def sensor_to_separate(self, equations: Sequence[str]) -> str:
        """The sensor that would separate errors in these equations, in words."""
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
    yield from _wrong_units(machine)
    yield from _unknown_names(machine)
    yield from _unknown_quantities(machine)


def _wrong_units(machine: Machine) -> Iterator[tuple[str, str]]:
    """Units that cannot be read."""
    for piece in ("states", "parameters", "inputs", "sensors", "columns"):
        for item in getattr(machine, piece):
            try:
                units.parse(item.unit)
            except ClutchestError as error:
                yield piece, f"has {getattr(item, 'name', None) or item.key} in {error}"


def _unknown_names(machine: Machine) -> Iterator[tuple[str, str]]:
    """Signals, states and parameters that are named and not declared."""
    columns, states = machine.units, [s.name for s in machine.states]
    inputs = [i.name for i in machine.inputs]
    of_columns = chain(
        (("sensors", s.column or s.name) for s in machine.sensors),
        (("regimes.signals", name) for name in machine.regimes.signals),
        (("fault_signals", name) for name in machine.fault_signals),
        (("followers", n) for f in machine.followers for n in (f.leader, f.follower)),
        (("demands", n) for d in machine.demands for n in (d.subject, *d.demands, d.released)),
        (("delay_relations", r.signal) for r in machine.delay_relations),
    )
    for piece, name in of_columns:
        if name not in columns:
            yield piece, f"has no column '{name}'" + nearest(name, columns)
    for name in machine.regimes.thresholds:
        if name not in THRESHOLD_UNITS:
            yield (
                "regimes.thresholds",
                f"has no threshold '{name}'" + nearest(name, THRESHOLD_UNITS),
            )
    for name in machine.peaks.values():
        if name not in states:
            yield "peaks", f"has no state '{name}'" + nearest(name, states)
    for name in machine.rates.values():
        if name not in inputs:
            yield "rates", f"has no input '{name}'" + nearest(name, inputs)
    parameters, sensors = [p.key for p in machine.parameters], [s.name for s in machine.sensors]
    for procedure in machine.procedures:
        piece = f"procedure '{procedure.name}'"
        for key in (key for key in procedure.parameters if key not in parameters):
            yield piece, f"has no parameter '{key}'" + nearest(key, parameters)
        if procedure.sensor and procedure.sensor not in sensors:
            yield piece, f"has no sensor '{procedure.sensor}'" + nearest(procedure.sensor, sensors)
    benches = machine.benches.names if machine.benches else ()
    for experiment in machine.experiments:
        yield from experiment.unknown_names(parameters, benches, columns)
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
        written = model.expressions()
    except AttributeError as error:
        yield "equations", _lacking(machine, error)
        return
    except ClutchestError:
        raise
    except Exception as error:  # whatever a user's equations do wrong
        lines = str(error).strip().splitlines()
        yield (
            "equations",
            f"cannot be written out: {type(error).__name__}: {lines[-1:] and lines[-1]}",
        )
        return
    quantities = set(written.quantities.names())
    if model.name != machine.name:
        yield "equations", f"are of model '{model.name}'"
    if model.anchor not in machine.units:
        yield "equations", f"have no column '{model.anchor}' as their anchor"
    for item in model.inputs:
        if item.default is None and item.name not in {*machine.units, *model.slopes}:
            yield "inputs", f"have no column '{item.name}'" + nearest(item.name, machine.units)
    for name in _no_numbers(written):
        yield "equations", f"make '{name}' something that is no number"
    if machine.event is not None and not (machine.output and POWER in model.outputs):
        yield "event", f"needs an output of the machine, and the equations' output '{POWER}'"
    if machine.output and machine.output not in model.outputs:
        yield "output", f"'{machine.output}' is none of the equations' outputs"
    for name in (name for name in machine.effects if name in RESERVED):
        yield "effects", f"has '{name}', which is a reserved name"
    for name, effect in machine.effects.items():
        if effect.name != name or effect.model not in ("", machine.name):
            yield "effects", f"has '{effect.name}' of model '{effect.model}' as '{name}'"
    for name in machine.covariates:
        if name not in quantities:
            yield "covariates", f"has no quantity '{name}'" + nearest(name, quantities)
    yield from _wrong_error_terms(machine, quantities)
    for fault in machine.faults:
        if not any(n.key == fault.key for n in fault.effect.gains):
            yield f"fault '{fault.name}'", f"has no gain '{fault.key}'"
    for name in machine.excitations:
        if name in machine.scenarios():
            yield "excitations", f"names scenario '{name}' twice"


def _no_numbers(written: Expressions) -> list[str]:
    """Quantities that are no number wherever they are tried."""
    names = written.quantities.names()
    symbols = [written.x, written.u, written.w, written.p, written.g]
    made = ca.vertcat(*(getattr(written.quantities, name) for name in names))
    rng = np.random.default_rng(0)
    points = [rng.uniform(0.5, 50.0, (symbol.numel(), POINTS)) for symbol in symbols]
    values = np.array(ca.Function("tried", symbols, [made])(*points))
    return [name for name, row in zip(names, values, strict=True) if not np.isfinite(row).any()]


def _lacking(machine: Machine, error: AttributeError) -> str:
    """What the equations ask for that is not there."""
    wanted = str(error.name or "")
    for sensor in machine.sensors:
        if wanted == f"{sensor.name}_reading":
            return f"assign no '{wanted}', what the sensor '{sensor.name}' reads"
    declared = [*(p.key for p in machine.parameters), *(i.name for i in machine.inputs)]
    hint = nearest(wanted, [*declared, *(s.name for s in machine.states)])
    return f"use '{wanted}', which is neither declared nor assigned before{hint}"


def _wrong_error_terms(machine: Machine, quantities: Container[str]) -> Iterator[tuple[str, str]]:
    known = {*machine.units, *(s.name for s in machine.states), *machine.covariates}
    known |= {*machine.rates, *machine.peaks, TIME, ENERGY}
    inputs = [item.name for item in machine.inputs]
    for name, term in machine.error_terms.items():
        piece = f"error term '{name}'"
        for covariate in term.covariates:
            if covariate not in known:
                yield piece, f"has no covariate '{covariate}'" + nearest(covariate, known)
        for quantity in term.changes:
            if quantity not in quantities:
                yield piece, f"changes '{quantity}', which the equations do not have"
        if term.late is not None and term.late[0] not in machine.units:
            yield piece, f"delays '{term.late[0]}'" + nearest(term.late[0], inputs)


Piece = TypeVar("Piece")


def _by_name(piece: str, model: Model, pairs: Iterable[tuple[str, Piece]]) -> Mapping[str, Piece]:
    """Name → piece.  Raises ClutchestError for a name that occurs twice."""
    named: dict[str, Piece] = {}
    for name, value in pairs:
        if name in named:
            raise ClutchestError(f"machine '{model.name}': {piece} names '{name}' twice")
        named[name] = value
    return MappingProxyType(named)
