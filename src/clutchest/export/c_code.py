"""The model as C code: what an ECU or a block of a simulation calls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import casadi as ca

from clutchest import __version__
from clutchest.compute.step import heun
from clutchest.errors import ClutchestError
from clutchest.export.exported_model import ExportedModel, identifier
from clutchest.vehicle import Vehicle


def write_c(vehicle: Vehicle, folder: Path) -> list[str]:
    """Write the model of a vehicle into a folder, as NAME.c, NAME.h and NAME_data.h; their names.

    Functions take and give arrays as CasADi has them (``arg``, ``res``): see the heading of
    NAME_data.h.  Raises ClutchestError where a file cannot be written.
    """
    exported = ExportedModel.of(vehicle)
    name = exported.identifier
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True, "cpp": False})
    for function in functions(exported):
        generator.add(function)
    try:
        generator.generate(f"{folder}/")
        (folder / f"{name}_data.h").write_text(_data(exported), encoding="utf-8")
    except (OSError, RuntimeError) as problem:
        raise ClutchestError(f"{folder}: cannot write C code: {problem}") from None
    return [f"{name}.c", f"{name}.h", f"{name}_data.h"]


def functions(exported: ExportedModel) -> Iterator[ca.Function]:
    """Rates, one step, readings and outputs, each with its derivative by the states."""
    e, name = exported.expressions, exported.identifier
    taken = heun(exported.model, e)
    at = {"x": e.x, "u": e.u, "w": e.w, "p": e.p, "g": e.g}
    over = {"x": e.x, "u0": e.u, "u1": taken.u1, "dt": taken.dt, "w": e.w, "p": e.p, "g": e.g}
    for what, arguments, value in (
        ("rates", at, e.rate),
        ("step", over, taken.x),
        ("readings", at, e.readings),
        ("outputs", at, e.outputs),
    ):
        yield ca.Function(
            f"{name}_{what}",
            [*arguments.values()],
            [value, ca.densify(ca.jacobian(value, e.x))],
            [*arguments],
            [what, "by_state"],
        )


def _data(exported: ExportedModel) -> str:
    """Names, places and values of everything that the functions take."""
    model, prefix = exported.model, exported.identifier.upper()
    units = {s.name: s.unit for s in model.states} | {s.name: s.unit for s in model.sensors}
    units |= {item.name: item.unit for item in model.inputs}
    keys = {q.key: q.unit for q in model.parameters}
    parts = [
        f"/* {exported.vehicle.name}: {model.name}, by clutchest {__version__}, vehicle file "
        f"{exported.vehicle.hash}.",
        " *",
        " * NAME_rates(x, u, w, p, g), NAME_readings and NAME_outputs with the same arguments, and",
        " * NAME_step(x, u0, u1, dt, w, p, g), from the inputs u0 to u1 dt s later, give a value",
        " * and, column by column, its derivative by x.  They are called as",
        " * int f(const double **arg, double **res, casadi_int *iw, double *w, int mem). */",
        "#pragma once",
        "",
        *_array(f"{prefix}_X", "states x at rest", exported.states, units),
        *_array(f"{prefix}_U", "inputs u", exported.inputs, units),
        *_array(
            f"{prefix}_W",
            "regime w",
            {f: float(f in model.regime) for f in exported.flags},
            exported.flag_units,
        ),
        *_array(f"{prefix}_P", "parameters p", exported.parameters, keys),
        *_array(f"{prefix}_G", "numbers g of the effects", exported.effects, exported.effect_units),
        *_array(f"{prefix}_H", "readings", {s.name: 0.0 for s in model.sensors}, units),
        *_array(f"{prefix}_Y", "outputs", dict.fromkeys(model.outputs, 0.0), exported.output_units),
    ]
    return "\n".join(parts)


def _array(
    name: str, what: str, values: Mapping[str, float], units: Mapping[str, str]
) -> Iterator[str]:
    """An enumeration of places and an array of values."""
    yield f"/* {what} */"
    places = [f"{name}_{identifier(key)}" for key in values]
    yield f"enum {{ {', '.join([*places, f'{name}_COUNT'])} }};"
    yield f"static const double {name}[] = {{"
    for key, value in values.items():
        yield f"    {value!r}, /* {', '.join(filter(None, (key, units[key])))} */"
    yield "    0.0"  # C has no empty array
    yield "};"
    yield ""
