"""Kinds and numbers of what a machine declares: what is of no use, whatever its equations are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import inf
from numbers import Real
from typing import Any

from clutchest.errors import ClutchestError
from clutchest.models.effects.effect import Effect
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.fault import Actuator, Demand, Follower, ModelFault
from clutchest.models.procedures import Procedure
from clutchest.models.symbols import Column, Input, Parameter, Sensor, State

KINDS: Mapping[str, type] = {
    "states": State,
    "parameters": Parameter,
    "inputs": Input,
    "sensors": Sensor,
    "columns": Column,
    "error_terms": ErrorTerm,
    "effects": Effect,
    "unmodelled": Effect,
    "faults": ModelFault,
    "followers": Follower,
    "actuators": Actuator,
    "demands": Demand,
    "procedures": Procedure,
}
NAMED = (
    "covariates",
    "smooth_over",
    "rates",
    "peaks",
    "turns",
    "departures",
    "durations",
    "limits",
)
STATE_STDS = ("process_noise", "initial_std", "useful_std", "parked_noise", "slip_noise", "wander")
LARGEST_FMI = 31  # of SAE J1939-73, five bits


def several(piece: str, given: Any) -> tuple[Any, ...]:
    """What is ``given`` for a ``piece`` that lists its kind.  Raises ClutchestError naming the
    piece where it is something else: a comma that is missing, a class that is not called."""
    kind = KINDS[piece]
    expected = f"expected several of {kind.__name__}, as in ({kind.__name__}(…),)"
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise ClutchestError(f"{piece} is {_shown(given)}, {expected}")
    listed = tuple(given.values() if isinstance(given, Mapping) else given)
    for each in listed:
        if isinstance(each, type) and issubclass(each, kind):
            raise ClutchestError(f"{piece} has {each.__name__}, expected {each.__name__}()")
        if not isinstance(each, kind):
            raise ClutchestError(f"{piece} has {_shown(each)}, {expected}")
    return listed


def _shown(value: Any) -> str:
    """A value of a wrong kind, in a few words."""
    if isinstance(value, str | Real):
        return repr(value)
    return f"one {type(value).__name__}"


def wrong_kinds(machine: Any) -> Iterator[tuple[str, str]]:
    """(piece, what is wrong with it) where a piece of the ``machine`` is of another kind."""
    for piece in KINDS:
        try:
            several(piece, getattr(machine, piece))
        except ClutchestError as error:
            yield piece, str(error).removeprefix(f"{piece} ")
    for piece in NAMED:
        if not isinstance(getattr(machine, piece), Mapping):
            shown = _shown(getattr(machine, piece))
            yield piece, f"is {shown}, expected names and what they stand for, as in {{…: …}}"


def wrong_numbers(machine: Any) -> Iterator[tuple[str, str]]:
    """(piece, what is wrong with it) where a number of the ``machine`` is none, or impossible."""
    for state in machine.states:
        for key in STATE_STDS:
            if not _within(getattr(state, key), 0.0, inf):
                shown = f"{key} = {getattr(state, key)!r}"
                yield "states", f"has {state.name} with {shown}, expected a number of at least 0"
    for item in machine.inputs:
        if not _within(item.gap, 0.0, inf):
            yield "inputs", f"has {item.name} with gap = {item.gap!r}, expected s of at least 0"
    for fault in machine.faults:
        gain = next((n for n in fault.effect.gains if n.key == fault.key), None)
        most = max(abs(gain.lower), abs(gain.upper)) if gain else inf
        if not (_within(fault.size, 0.0, most) and fault.size > 0.0):
            yield (
                f"fault '{fault.name}'",
                f"has size {fault.size!r}, expected a magnitude above 0, and at most {most:g}, "
                f"the largest plausible '{fault.key}'",
            )
        fmi = fault.fmi if isinstance(fault.fmi, tuple | list) else ()
        if len(fmi) != 2 or not all(isinstance(n, int) and 0 <= n <= LARGEST_FMI for n in fmi):
            yield (
                f"fault '{fault.name}'",
                f"has fmi {fault.fmi!r}, expected two failure modes (SAE J1939-73), 0 to "
                f"{LARGEST_FMI}: of a gain above and below 0",
            )


def wrong_steps(longest: Any) -> str | None:
    """What is wrong with the longest steps of equations, s; None for nothing."""
    steps = longest if isinstance(longest, tuple | list) else ()
    if steps and all(_within(step, 0.0, inf) and step > 0.0 for step in steps):
        return None
    return f"have longest = {longest!r}, expected s above 0, as in (0.02, 0.5)"


def _within(value: Any, least: float, most: float) -> bool:
    """Whether a ``value`` is a number from ``least`` to ``most``."""
    return isinstance(value, Real) and least <= float(value) <= most
