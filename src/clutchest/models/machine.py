"""The contract between a machine and the inference.

A *machine* is everything that is known of one physical thing: equations, states, sensors, ways in
which its equations may be wrong, effects, faults, procedures.  The inference knows none of them by
name: it asks a :class:`Machine` for the piece, and says in one line where there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from clutchest.errors import ClutchestError, nearest
from clutchest.models.declarations import (
    Comparison,
    Driving,
    Event,
    Inverse,
    Judder,
    OutputTracking,
    Separation,
    Storing,
    Wear,
)
from clutchest.models.delay_relations import DelayRelation
from clutchest.models.effects.effect import Effect
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.experiments import Benches, BenchExperiment
from clutchest.models.fault import Actuator, Demand, Follower, ModelFault
from clutchest.models.machine_defects import defects
from clutchest.models.machine_values import several
from clutchest.models.model import Model
from clutchest.models.procedures import Picture, Procedure
from clutchest.models.regimes import RegimeRules
from clutchest.models.symbols import Column, Input, Parameter, Sensor, State
from clutchest.signals import Floats

Excitation = Callable[
    ["np.random.Generator", Floats, Mapping[str, float]], Mapping[str, Floats]
]  # random numbers (quoted: not loaded to replay), times (k,) s, parameters → inputs by name, (k,)
OwnEffects = Callable[[Mapping[Effect, Mapping[str, float]], Mapping[str, float]], Any]
_EMPTY: Mapping[str, Any] = MappingProxyType({})


NEEDED: Mapping[str, tuple[tuple[Callable[[Machine], object], str], ...]] = {
    "discover": (
        (lambda machine: machine.error_terms, "error terms"),
        (lambda machine: machine.effects, "effects"),
    ),
    "feedforward": ((lambda machine: machine.inverse, "inverse"),),
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
    ``fitted(signals)`` the same for fits to whole drives, where it is not the form of the filter's;
    ``at_rest(parameters, inputs)`` the states at the start of a drive, as far as they are known.
    ``regimes``: which equations hold when.

    ``output``: the model's output that files call ``clutch_torque``, "" for none; ``event``: what
    stretches of the regimes' event mode report; ``overview``: columns that the
    opening page of a recording shows, the machine's speeds unless given; ``tracking``: how an
    actuation and its response are recognised; ``judder``: how an oscillation of sliding surfaces
    is; ``inverse``: the actuator for a requested output;
    ``wear``; ``driving``: which signals say by themselves what slips, and ``storing`` what
    an actuator takes; ``limits``: what ``[limits]`` of a vehicle file may state, with its unit.

    For discovery: ``error_terms``, ways in which an equation may be wrong that no effect knows;
    ``covariates``, quantities of the equations that an error may correlate with (name → unit),
    beside inputs, states, time and energy; ``smooth_over`` (name → unit), further ones that a
    smooth error of a healthy machine may go with; ``rates`` of inputs (name → input), ``peaks``
    (name → the state whose highest value so far it is), ``turns`` (name → the angle, a state in
    rad, of which it is the place within a turn, or the speed, an input or covariate in rad/s, of
    such an angle), ``departures`` (name → the input or covariate of which it is the departure from
    the mean over the last half minute) and ``durations`` (name → the covariate which it says for
    how long has been positive); ``effects``, the library; ``unmodelled``, parts that the equations
    leave out: never a cause, but allowed for as far as each gain goes in a ``healthy`` machine;
    ``separating_sensors`` and ``sensor_for`` (equation → sensor, "" for all others), which sensor
    would separate errors; ``compared``, the pair of a validation.

    For estimation: ``separating_manoeuvres``, what parts two states that one kind of measurement
    knows together.

    For diagnosis: ``faults`` of the equations, the ``fault_signals`` that their tests need,
    ``followers``, ``actuators`` and ``demands``.

    For identification: ``procedures``, ways to determine some of the parameters; ``experiments`` on
    ``benches`` that determine some of them by equations of their own; ``pictures`` of a
    fit of all of them; ``relative_states`` (state → parameters): states that start from their
    nominal value where all of these parameters are fitted, because they are relative to them;
    ``delay_relations``, how late signals are behind the equations' anchor.

    For simulation: ``generate``, a program of its own, and the names of its ``scenarios``,
    ``scenarios_with`` those where a vehicle has these signals, if not all;
    ``manoeuvres``: scenario → what a driver does in it, in words;
    ``own_effects`` (effect → its numbers, parameters by key) gives the generator's ``Outsider``
    for a user's own effects; where
    there is none, ``excitations`` drive the machine's own equations: scenario → function (random
    numbers, times (k,) s, parameters by key) that gives the inputs by name, (k,) each, as the bus
    reports them.  ``template``: the shipped vehicle whose numbers a drafted one takes as guesses,
    ``car_template`` that for a log of a bus that is not J1939, if another.

    ``reservations``: verb → what is to be kept in mind of its answers, in words.

    ``check_equations``: whether they are written out and tried at once, which loads CasADi; of the
    shipped machines the tests do that.
    """

    name: str
    what: str
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    sensors: tuple[Sensor, ...]
    columns: tuple[Column, ...]
    equations: Callable[[Container[str]], Model]
    fitted: Callable[[Container[str]], Model] | None = None
    at_rest: Callable[[Mapping[str, float], Mapping[str, float]], Mapping[str, float]] = (
        lambda parameters, inputs: {}
    )
    regimes: RegimeRules = field(default_factory=RegimeRules)
    output: str = ""
    event: Event | None = None
    overview: tuple[str, ...] = ()
    tracking: OutputTracking | None = None
    judder: Judder | None = None
    inverse: Inverse | None = None
    wear: Wear | None = None
    driving: Driving | None = None
    storing: Storing | None = None
    limits: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    reservations: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    error_terms: Mapping[str, ErrorTerm] = field(default_factory=lambda: _EMPTY)
    covariates: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    smooth_over: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    rates: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    peaks: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    turns: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    departures: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    durations: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    effects: Mapping[str, Effect] = field(default_factory=lambda: _EMPTY)
    unmodelled: Mapping[str, Effect] = field(default_factory=lambda: _EMPTY)
    separating_sensors: tuple[Separation, ...] = ()
    sensor_for: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    compared: Comparison | None = None
    separating_manoeuvres: tuple[Separation, ...] = ()
    faults: tuple[ModelFault, ...] = ()
    fault_signals: tuple[str, ...] = ()
    followers: tuple[Follower, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    demands: tuple[Demand, ...] = ()
    procedures: tuple[Procedure, ...] = ()
    experiments: tuple[BenchExperiment, ...] = ()
    benches: Benches | None = None
    pictures: tuple[Picture, ...] = ()
    relative_states: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: _EMPTY)
    delay_relations: tuple[DelayRelation, ...] = ()
    generate: Callable[..., Any] | None = None
    scenarios: Callable[[], Sequence[str]] = tuple
    scenarios_with: Callable[[Container[str]], Sequence[str]] | None = None
    manoeuvres: Mapping[str, str] = field(default_factory=lambda: _EMPTY)
    own_effects: OwnEffects | None = None
    excitations: Mapping[str, Excitation] = field(default_factory=lambda: _EMPTY)
    template: str = ""
    car_template: str = ""
    check_equations: InitVar[bool] = True

    def __post_init__(self, check_equations: bool) -> None:
        for piece, wrong in defects(self, check_equations):
            raise ClutchestError(f"machine '{self.name}': {piece} {wrong}")

    @property
    def units(self) -> dict[str, str]:
        """Canonical column → unit."""
        return {column.name: column.unit for column in self.columns}

    @property
    def made_covariates(self) -> tuple[str, ...]:
        """Names of the covariates that are made from others."""
        made = (self.rates, self.peaks, self.turns, self.departures, self.durations)
        return tuple(name for each in made for name in each)

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
        unmodelled: Iterable[Effect] = (),
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
        given = {n: getattr(model, n) for n in ("states", "parameters", "inputs", "sensors")}
        given |= {"columns": columns, "error_terms": error_terms}
        given |= {"effects": effects, "unmodelled": unmodelled}
        try:
            listed = {piece: several(piece, each) for piece, each in given.items()}
        except ClutchestError as error:
            raise ClutchestError(f"machine '{model.name}': {error}") from None
        units = {item.name: item.unit for item in model.inputs if item.name not in model.slopes}
        units |= {sensor.column or sensor.name: sensor.unit for sensor in model.sensors}
        return cls(
            name=model.name,
            what=what,
            states=listed["states"],
            parameters=listed["parameters"],
            inputs=listed["inputs"],
            sensors=listed["sensors"],
            columns=listed["columns"] or tuple(Column(name, unit) for name, unit in units.items()),
            equations=lambda signals: model,
            error_terms=_by_name("error_terms", "equation", model, listed["error_terms"]),
            effects=_by_name("effects", "name", model, listed["effects"]),
            unmodelled=_by_name("unmodelled", "name", model, listed["unmodelled"]),
            **pieces,
        )

    @cached_property
    def _on_benches(self) -> Mapping[str, Machine]:
        """Bench → the same machine, fitted with the form of its equations there."""
        forms = self.benches.fitted if self.benches else {}
        return {
            bench: replace(self, fitted=form, check_equations=False)
            for bench, form in forms.items()
        }

    def on_bench(self, bench: str) -> Machine:
        """The same machine, fitted with the form of its equations on one of its benches.  Raises
        ClutchestError where it declares none for it."""
        if bench not in self._on_benches:
            raise ClutchestError(
                f"machine '{self.name}' declares no equations on bench '{bench}'"
                + nearest(bench, self._on_benches)
            )
        return self._on_benches[bench]

    def to_fit(self, signals: Container[str]) -> Model:
        """The form of the equations whose numbers are fitted, that these signals can drive."""
        return (self.fitted or self.equations)(signals)

    @property
    def optional_columns(self) -> frozenset[str]:
        """Columns that the equations can do without: inputs with a default, demands, requests."""
        inputs = {item.name for item in self.inputs if item.default is not None}
        inputs |= {self.tracking.request} - {""} if self.tracking else set()
        return frozenset(inputs.union(*({*d.demands, d.released} for d in self.demands)))

    def lacking(self, there: Container[str]) -> list[Column]:
        """Columns that are needed, and are not ``there``, nor others instead of them."""
        return [
            column
            for column in self.columns
            if column.name not in there
            and column.name not in self.optional_columns
            and not (column.instead and all(name in there for name in column.instead))
        ]

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """Names of what it can be simulated in."""
        return (*self.scenarios(), *self.excitations)

    def scenarios_for(self, signals: Container[str]) -> tuple[str, ...]:
        """Names of what a vehicle with these signals can be simulated in."""
        if self.scenarios_with is None:
            return self.scenario_names
        return (*self.scenarios_with(signals), *self.excitations)

    def on_other_bench(self, scenario: str) -> bool:
        """Whether a scenario is an experiment on benches alone on which the equations have another
        form."""
        forms = self.benches.fitted if self.benches else {}
        benches = [b for e in self.experiments if e.name == scenario for b in e.benches]
        own = [forms.get(bench, self.fitted) for bench in benches]
        return bool(own) and self.fitted not in own

    def reserved(self, verb: str) -> list[str]:
        """Warnings that stand beside every answer of a ``verb``."""
        return [self.reservations[verb]] if verb in self.reservations else []

    def supports(self, verb: str) -> None:
        """Raises ClutchestError where this ``verb`` cannot be asked of the machine."""
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


def _by_name(piece: str, key: str, model: Model, given: Iterable[Any]) -> Mapping[str, Any]:
    """The ``key`` of each → itself.  Raises ClutchestError for a name that occurs twice."""
    named: dict[str, Any] = {}
    for value in given:
        name = getattr(value, key)
        if name in named:
            raise ClutchestError(f"machine '{model.name}': {piece} names '{name}' twice")
        named[name] = value
    return MappingProxyType(named)
