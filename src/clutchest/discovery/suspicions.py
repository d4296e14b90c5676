"""A user's own suspicions: effects from files of theirs, checked before anything is read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from clutchest.errors import ClutchestError, nearest
from clutchest.models import card, model_for
from clutchest.models.effects import Effect, Gains, effects_of_file, library
from clutchest.models.model import Model
from clutchest.vehicle import Vehicle


def suspicions(files: Sequence[Path], vehicle: Vehicle) -> list[Effect]:
    """Every effect of these ``files`` that the vehicle has not in its model already.

    Raises ClutchestError, with the file's name, for one that cannot be looked for.
    """
    model = model_for(vehicle.model, {name for name, _ in card(vehicle.model).columns})
    found: dict[str, Effect] = {}
    for path in dict.fromkeys(path.resolve() for path in files):
        for name, effect in effects_of_file(path).items():
            if name in vehicle.effects:
                continue
            if wrong := _wrong(effect, model) or _taken(name, vehicle.model, found):
                raise ClutchestError(f"{path}: effect '{name}' {wrong}")
            found[name] = effect
    return list(found.values())


def _taken(name: str, model: str, found: dict[str, Effect]) -> str | None:
    where = "the library" if name in library(model) else "another file" if name in found else None
    return f"has the name of one in {where}, expected another" if where else None


def _wrong(effect: Effect, model: Model) -> str | None:
    """Why an effect cannot be looked for, None where it can."""
    if effect.model != model.name:
        return f"is of the model '{effect.model}', expected '{model.name}'"
    if effect.lateness:
        return ("is late by more at one time than at another: nothing to look for, but to be "
                "stated in the vehicle file")  # fmt: skip
    if not effect.gains:
        return "has no number that makes it absent at 0, expected one that is no shape"
    for number in effect.gains:
        if not number.lower <= 0.0 < number.upper:
            return (f"has {number.key} between {number.lower:g} and {number.upper:g}, expected "
                    "0 or less and more than 0")  # fmt: skip
    inputs = [item.name for item in model.inputs]
    for signal in effect.delays:
        if signal not in inputs:
            return f"delays '{signal}', which is no input" + nearest(signal, inputs)
    known = model.expressions().quantities.names()
    own = [f"{state.name}_rate" for state in effect.states]
    try:
        for name in effect.terms(Gains({n.key: ca.SX.sym(n.key) for n in effect.parameters})):
            if name not in (*known, *own):
                return f"changes '{name}', which the equations have not" + nearest(name, known)
        model.with_effects((effect,)).expressions()
    except AttributeError as error:
        if error.name in known:
            return f"asks for '{error.name}' before the equations make it"
        there = [n.key for n in effect.parameters] if isinstance(error.obj, Gains) else known
        return f"asks for '{error.name}', which is not there" + nearest(str(error.name), there)
    except Exception as error:  # whatever the user's file does wrong
        return f"cannot be written out: {type(error).__name__}: {error}"
    return None
