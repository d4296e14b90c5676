"""Slips of the pen in a user's equations: what they ask for that is not there, a rate or a start
of no state, a reading in the unit of another quantity; each with the line where that is known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from numbers import Real
from pathlib import Path
from traceback import extract_tb
from typing import Any

from clutchest import units
from clutchest.casadi_later import ca
from clutchest.errors import alike, nearest
from clutchest.models.model import Expressions, Model, Quantities

OWN = Path(__file__).parents[1]
IF = "write ca.if_else, ca.fmax or ca.fmin instead of if, max and min"


def not_written(machine: Any, error: Exception) -> str:
    """Why the equations of a ``machine`` cannot be written out, by the ``error`` that they raise,
    and in which line of the user's file."""
    line = _line(error)
    if isinstance(error, AttributeError) and isinstance(error.obj, Quantities):
        return _lacking(machine, str(error.name or ""), line, error.obj.names())
    words = " ".join(str(error).strip().splitlines()[-1:])
    if "truth value" in words:
        words = f"an expression has no truth value; {IF}"
    return f"cannot be written out{line}: {type(error).__name__}: {words}"


def _line(error: Exception) -> str:
    """``" in line 12"`` of the file that is neither ours nor a library's; empty if unknown."""
    for frame in reversed(extract_tb(error.__traceback__)):
        path = Path(frame.filename)
        if OWN not in path.parents and "site-packages" not in path.parts:
            return f" in line {frame.lineno}"
    return ""


def _lacking(machine: Any, wanted: str, line: str, there: Sequence[str]) -> str:
    """What the equations ask for that is not ``there``."""
    for sensor in machine.sensors:
        if wanted == f"{sensor.name}_reading":
            return f"assign no '{wanted}', what the sensor '{sensor.name}' reads"
    hint = alike(wanted, there) or nearest(wanted, [p.key for p in machine.parameters])
    return f"use '{wanted}'{line}, which is neither declared nor assigned before{hint}"


def slips(machine: Any, model: Model, written: Expressions) -> Iterator[tuple[str, str]]:
    """(piece, what is wrong with it) of a ``model`` that could be ``written`` out."""
    declared = {*(i.name for i in model.inputs), *(p.key for p in model.parameters)}
    declared |= {f"{state.name}_rate" for state in model.states}
    made = [name for name in written.quantities.names() if name not in declared]
    for i, state in enumerate(model.states):
        rate = f"{state.name}_rate"
        for name in made if written.rate[i].is_zero() else ():
            if one_slip(name, rate):
                yield (
                    "equations",
                    f"assign '{name}', and no rate of state '{state.name}'; did you mean '{rate}'?",
                )
    for i, sensor in enumerate(model.sensors):
        for j, state in enumerate(model.states):
            same = ca.is_equal(written.readings[i], written.x[j])
            if same and units.parse(sensor.unit) != units.parse(state.unit):
                yield (
                    "sensors",
                    f"read '{sensor.name}' in {sensor.unit}, which is the state '{state.name}' in "
                    f"{state.unit}; expected the same unit (that of the log may be another)",
                )
    yield from _wrong_start(machine, model)


def one_slip(written: str, meant: str) -> bool:
    """Whether a name differs from the one that is ``meant`` by one letter more, less, or another,
    or by two that are swapped."""
    i = next((k for k, (a, b) in enumerate(zip(written, meant, strict=False)) if a != b), None)
    if i is None:
        return abs(len(written) - len(meant)) == 1
    rest, of = written[i:], meant[i:]
    swapped = rest[:2] == of[1::-1] and rest[2:] == of[2:]
    return rest[1:] == of[1:] or rest[1:] == of or rest == of[1:] or swapped


def _wrong_start(machine: Any, model: Model) -> Iterator[tuple[str, str]]:
    """What is wrong with ``at_rest``, tried with ones for all that is not known."""
    parameters = {p.key: 1.0 for p in model.parameters}
    inputs = {i.name: 1.0 if i.default is None else i.default for i in model.inputs}
    try:
        start = machine.at_rest(parameters, inputs)
    except KeyError as error:
        wanted = str(error.args[0]) if error.args else ""
        known = [*parameters, *inputs]
        yield "at_rest", f"asks for '{wanted}', no parameter or input" + nearest(wanted, known)
        return
    except Exception:  # these numbers may be none that it can take
        return
    if not isinstance(start, Mapping):
        yield "at_rest", f"gives one {type(start).__name__}, expected states and their values"
        return
    states = [state.name for state in model.states]
    for name, value in start.items():
        if name not in states:
            yield "at_rest", f"has no state '{name}'" + nearest(str(name), states)
        elif not isinstance(value, Real):
            yield "at_rest", f"gives {value!r} for '{name}', expected a number"
