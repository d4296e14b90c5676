"""The model as a functional mock-up unit: FMI 3.0, model exchange, by CasADi's exporter."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca

from clutchest.errors import ClutchestError
from clutchest.export.exported_model import ExportedModel, identifier
from clutchest.vehicle import Vehicle


def write_fmu(vehicle: Vehicle, folder: Path) -> list[str]:
    """Write the model of a vehicle into a folder, as NAME.fmu; its name.

    Parameters, numbers of effects and regime flags are parameters of the unit, with the vehicle's
    values; readings and outputs are its outputs.  Raises ClutchestError where the equations have a
    step map (play, bristles), which a model for exchange cannot have, where there is no C compiler,
    or where the headers of FMI 3.0 are not at hand.
    """
    exported = ExportedModel.of(vehicle)
    e = exported.expressions
    if not ca.is_equal(ca.simplify(e.mapped), e.x):
        raise ClutchestError(
            f"{vehicle.path.name}: these equations jump at steps (play or bristles), which an FMU "
            "for model exchange cannot; export --c has them"
        )
    headers = _headers()
    target = (folder / f"{exported.identifier}.fmu").resolve()
    with TemporaryDirectory() as temporary, _inside(Path(temporary)):
        try:
            unit = daes(exported)
            files = unit.export_fmu({"no_warning": True, "with_serialization": False})
            files = unit.compile_fmu(files, {"include_dirs": [str(headers)]})
            Path(unit.pack_fmu(files, {})).replace(target)
        except RuntimeError as problem:
            words = str(problem).strip().splitlines()[-1]
            raise ClutchestError(f"the FMU cannot be compiled: {words}") from None
    return [target.name]


def daes(exported: ExportedModel) -> ca.DaeBuilder:
    """The equations as CasADi's exporter takes them."""
    model, e = exported.model, exported.expressions
    unit = ca.DaeBuilder(exported.identifier, "", {})
    x = [unit.add(state.name) for state in model.states]
    u = [unit.add(item.name, "input") for item in model.inputs]
    numbers = {**exported.parameters, **exported.effects}
    taken = {*exported.states, *exported.inputs}
    named = {key: identifier(key) + ("_nominal" if key in taken else "") for key in numbers}
    p = {key: unit.add(name, "parameter", "tunable") for key, name in named.items()}
    w = [unit.add(flag, "parameter", "tunable") for flag in exported.flags]
    values = [x, u, [p[k] for k in exported.parameters], [p[k] for k in exported.effects], w]
    at = [ca.vertcat(*each) if each else ca.MX(0, 1) for each in values]
    equations = ca.Function("equations", [e.x, e.u, e.p, e.g, e.w], [e.rate, e.readings, e.outputs])
    rates, readings, outputs = equations(*at)
    for i, state in enumerate(x):
        unit.eq(unit.der(state), rates[i])
        unit.set_initial(model.states[i].name, "exact")
        unit.set_start(model.states[i].name, exported.states[model.states[i].name])
        # units would ask for definitions, which the exporter does not write
        unit.set_description(
            model.states[i].name, f"{model.states[i].what}, {model.states[i].unit}"
        )
    for item in model.inputs:
        unit.set_start(item.name, exported.inputs[item.name])
        unit.set_description(item.name, f"{item.what}, {item.unit}")
    words = {q.key: f"{q.what}, {q.unit}" for q in model.parameters}
    words |= {key: f"of the effect {key}, {of}" for key, of in exported.effect_units.items()}
    for key, value in numbers.items():
        unit.set_start(named[key], value)
        unit.set_description(named[key], words[key])
    for flag in exported.flags:
        unit.set_start(flag, float(flag in model.regime))
        unit.set_description(flag, f"regime: {flag}, {exported.flag_units[flag]}")
    for i, sensor in enumerate(model.sensors):
        name = f"{sensor.name}_reading"
        unit.eq(unit.add(name, "output"), readings[i])
        unit.set_description(name, f"reading of the sensor: {sensor.what}, {sensor.unit}")
    for i, (name, of) in enumerate(exported.output_units.items()):
        unit.eq(unit.add(name, "output"), outputs[i])
        unit.set_description(name, ", ".join(filter(None, (name.replace("_", " "), of))))
    return unit


def _headers() -> Path:
    """The folder of FMI 3.0's headers, which FMPy brings along."""
    spec = find_spec("fmpy")
    places = spec.submodule_search_locations if spec else None
    for place in places or ():
        for found in Path(place).rglob("fmi3Functions.h"):
            return found.parent
    raise ClutchestError(
        "the headers of FMI 3.0 are not installed: pip install 'clutchest[fmu]' brings them"
    )


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    """The exporter writes into the present folder: let it be this one."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
