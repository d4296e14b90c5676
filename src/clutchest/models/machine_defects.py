"""What is wrong with the declaration of a machine: names that occur twice or are not declared,
units that cannot be read, equations that give no numbers."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from itertools import chain
from typing import Any

import numpy as np

from clutchest import units
from clutchest.casadi_later import ca
from clutchest.errors import ClutchestError, nearest
from clutchest.models.declarations import HISTORY
from clutchest.models.effects.effect import RESERVED
from clutchest.models.equation_slips import not_written, slips
from clutchest.models.machine_values import wrong_kinds, wrong_numbers, wrong_steps
from clutchest.models.model import POWER, Expressions
from clutchest.models.thresholds import THRESHOLD_UNITS

POINTS = 16  # at which the equations are tried


def defects(machine: Any, equations: bool = True) -> Iterator[tuple[str, str]]:
    """(piece, what is wrong with it) of a machine that cannot be registered; what its equations
    lack only where ``equations`` are to be tried."""
    yield from wrong_kinds(machine)
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
    yield from wrong_numbers(machine)
    yield from _unknown_names(machine)
    if equations:
        yield from _unknown_quantities(machine)


def _wrong_units(machine: Any) -> Iterator[tuple[str, str]]:
    """Units that cannot be read."""
    named = [
        (piece, getattr(item, "name", None) or item.key, item.unit)
        for piece in ("states", "parameters", "inputs", "sensors", "columns")
        for item in getattr(machine, piece)
    ]
    for piece in ("covariates", "smooth_over"):
        named += [(piece, name, unit) for name, unit in getattr(machine, piece).items()]
    for piece, name, unit in named:
        try:
            units.parse(unit)
        except ClutchestError as error:
            yield piece, f"has {name} in {error}"


def _unknown_names(machine: Any) -> Iterator[tuple[str, str]]:
    """Signals, states and parameters that are named and not declared."""
    columns, states = machine.units, [s.name for s in machine.states]
    inputs = [i.name for i in machine.inputs]
    of_columns = chain(
        (("sensors", s.column or s.name) for s in machine.sensors),
        (("regimes.signals", name) for name in machine.regimes.signals),
        (("fault_signals", name) for name in machine.fault_signals),
        (("followers", n) for f in machine.followers for n in (f.leader, f.follower)),
        (("actuators", n) for a in machine.actuators for n in (a.drive, a.output)),
        (("demands", n) for d in machine.demands for n in (d.subject, *d.demands, d.released)),
        (("overview", name) for name in machine.overview),
        (("delay_relations", r.signal) for r in machine.delay_relations),
        (("event", name) for name in (machine.event.slip if machine.event else ())),
        (("tracking", n) for n in (machine.tracking.signals if machine.tracking else ())),
        (("judder", n) for n in (machine.judder.signals if machine.judder else ())),
        (("driving", n) for n in (machine.driving.signals if machine.driving else ())),
        (("storing", n) for n in (machine.storing.signals if machine.storing else ())),
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
    yield from _unknown_covariates(machine, states, inputs)
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


def _unknown_covariates(
    machine: Any, states: list[str], inputs: list[str]
) -> Iterator[tuple[str, str]]:
    for name in machine.peaks.values():
        if name not in states:
            yield "peaks", f"has no state '{name}'" + nearest(name, states)
    units = {item.name: item.unit for item in machine.inputs} | dict(machine.covariates)
    angles = [s.name for s in machine.states if s.unit == "rad"]
    angles += [name for name, unit in units.items() if unit == "rad/s"]
    for name in machine.turns.values():
        if name not in angles:
            yield "turns", f"has no state '{name}' in rad, nor a speed" + nearest(name, angles)
    known = (*inputs, *machine.covariates)
    for piece, of in (("rates", machine.rates), ("departures", machine.departures)):
        for name in of.values():
            if name not in known:
                yield piece, f"has no input or covariate '{name}'" + nearest(name, known)
    for name in machine.durations.values():
        if name not in machine.covariates:
            yield "durations", f"has no covariate '{name}'" + nearest(name, machine.covariates)


def _unknown_quantities(machine: Any) -> Iterator[tuple[str, str]]:
    """What the fullest form of the equations lacks."""
    try:
        model = machine.equations(machine.units)
        if wrong := wrong_steps(model.longest):
            yield "equations", wrong
        written = model.expressions()
    except ClutchestError:
        raise
    except Exception as error:  # whatever a user's equations do wrong
        yield "equations", not_written(machine, error)
        return
    quantities = set(written.quantities.names())
    yield from slips(machine, model, written)
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
    yield from _wrong_effects(machine)
    for piece in ("covariates", "smooth_over"):
        for name in getattr(machine, piece):
            if name not in quantities:
                yield piece, f"has no quantity '{name}'" + nearest(name, quantities)
    yield from _wrong_error_terms(machine, quantities)
    for fault in machine.faults:
        gains = [n.key for n in fault.effect.gains]
        if fault.key not in gains:
            yield f"fault '{fault.name}'", f"has no gain '{fault.key}'" + nearest(fault.key, gains)
    for name in machine.excitations:
        if name in machine.scenarios():
            yield "excitations", f"names scenario '{name}' twice"


def _wrong_effects(machine: Any) -> Iterator[tuple[str, str]]:
    for piece in ("effects", "unmodelled"):
        for name, effect in getattr(machine, piece).items():
            if name in RESERVED:
                yield piece, f"has '{name}', which is a reserved name"
            if effect.name != name or effect.model not in ("", machine.name):
                yield piece, f"has '{effect.name}' of model '{effect.model}' as '{name}'"
    for name in machine.effects.keys() & machine.unmodelled.keys():
        yield "unmodelled", f"has '{name}', which is one of the effects"


def _no_numbers(written: Expressions) -> list[str]:
    """Quantities that are no number wherever they are tried."""
    names = written.quantities.names()
    symbols = [written.x, written.u, written.w, written.p, written.g]
    made = ca.vertcat(*(getattr(written.quantities, name) for name in names))
    rng = np.random.default_rng(0)
    points = [rng.uniform(0.5, 50.0, (symbol.numel(), POINTS)) for symbol in symbols]
    values = np.array(ca.Function("tried", symbols, [made])(*points))
    return [name for name, row in zip(names, values, strict=True) if not np.isfinite(row).any()]


def _wrong_error_terms(machine: Any, quantities: Container[str]) -> Iterator[tuple[str, str]]:
    known = {*machine.units, *(s.name for s in machine.states), *machine.covariates}
    known |= {*(i.name for i in machine.inputs), *machine.made_covariates, *HISTORY}
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
