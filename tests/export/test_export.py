"""Exported models give what the equations here give."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import clutchest
from clutchest.errors import ClutchestError
from clutchest.export.c_code import functions, write_c
from clutchest.export.exported_model import ExportedModel, identifier
from clutchest.export.fmu import write_fmu
from clutchest.vehicle import Vehicle

COMPILER = shutil.which("gcc") or shutil.which("cc")
compiled = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
DRIVE = {"engine_torque": 400.0, "input_shaft_speed": 20.0, "slave_position": 34.0}


def truck(**effects: dict[str, float]) -> Vehicle:
    from dataclasses import replace

    return replace(clutchest.load_vehicle("truck"), effects=effects)


def drawn(model: ExportedModel, rng: np.random.Generator) -> list[np.ndarray]:
    """States, inputs, flags, parameters and effects near those of a truck that slips."""
    x, u = (np.array([*values.values()]) for values in (model.states, model.inputs))
    u = u + np.array([DRIVE.get(name, 0.0) for name in model.inputs])
    x[list(model.states).index("engine_speed")] = 90.0
    near = [each * rng.uniform(0.95, 1.05, len(each)) for each in (x, u)]
    w = np.array([float(flag in model.model.regime) for flag in model.flags])
    return [*near, w, np.array([*model.parameters.values()]), np.array([*model.effects.values()])]


@compiled
@pytest.mark.parametrize("name", ["truck", "alsd_rig"])
def test_compiled_c_gives_the_equations(name: str, tmp_path: Path) -> None:
    vehicle = truck(friction_speed={"slope": -0.12}) if name == "truck" else name
    vehicle = clutchest.load_vehicle(vehicle)
    written = write_c(vehicle, tmp_path)
    library = tmp_path / "model.so"
    command = [COMPILER, "-O1", "-shared", "-fPIC", str(tmp_path / written[0]), "-lm", "-o"]
    subprocess.run([*command, str(library)], check=True)
    subprocess.run([COMPILER, "-fsyntax-only", "-xc", str(tmp_path / written[2])], check=True)
    model, rng = ExportedModel.of(vehicle), np.random.default_rng(1)
    for function in functions(model):
        other = ca.external(function.name(), str(library))
        for _ in range(5):
            at = [rng.normal(size=function.numel_in(i)) for i in range(function.n_in())]
            mine, its = function(*at), other(*at)
            for a, b in zip(mine, its, strict=True):
                np.testing.assert_allclose(np.array(a), np.array(b), rtol=1e-12, equal_nan=True)


@compiled
@pytest.mark.slow
def test_a_unit_simulates_as_the_equations_do(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    vehicle = truck(friction_speed={"slope": -0.12})
    (name,) = write_fmu(vehicle, tmp_path)
    model = ExportedModel.of(vehicle)
    x, u, w, p, g = drawn(model, np.random.default_rng(2))
    e = model.expressions
    rate = ca.Function("rate", [e.x, e.u, e.w, e.p, e.g], [e.rate, e.outputs])
    end = 0.02  # before the speeds meet
    reference = solve_ivp(
        lambda _, y: np.array(rate(y, u, w, p, g)[0]).ravel(),
        (0.0, end),
        x,
        rtol=1e-10,
        atol=1e-10,
        method="LSODA",
    )
    start = dict(zip(model.states, x, strict=True)) | dict(zip(model.inputs, u, strict=True))
    states = list(model.states)
    result = fmpy.simulate_fmu(
        str(tmp_path / name),
        stop_time=end,
        start_values=start,
        relative_tolerance=1e-9,
        output_interval=0.005,
        output=[*states, "transmitted_torque"],
    )
    described = fmpy.read_model_description(str(tmp_path / name)).modelVariables
    named = [v for v in described if v.causality in ("input", "output", "parameter")]
    assert len(named) > 30 and all(variable.description for variable in named)
    for i, state in enumerate(states):
        np.testing.assert_allclose(result[state][-1], reference.y[i, -1], rtol=1e-6, atol=1e-6)
    torque = float(rate(reference.y[:, -1], u, w, p, g)[1][0])
    assert abs(torque) > 10.0
    np.testing.assert_allclose(result["transmitted_torque"][-1], torque, rtol=1e-6)


def test_effects_of_the_file_are_in_the_code(tmp_path: Path) -> None:
    *_, data = write_c(truck(friction_speed={"slope": -0.12}), tmp_path)
    text = (tmp_path / data).read_text(encoding="utf-8")
    assert "-0.12, /* friction_speed.slope, s/(100 rad) */" in text
    assert "0.0, /* transmitted_torque, Nm */" in text and "0.0, /* power, W */" in text
    assert "TRUCK_G_COUNT" in text


def test_play_cannot_be_in_a_unit(tmp_path: Path) -> None:
    with pytest.raises(ClutchestError, match="jump at steps"):
        write_fmu(truck(position_hysteresis={"play": 0.1}), tmp_path)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("my truck-2", "my_truck_2"),
        ("4x4", "v_4x4"),
        ("18 t / ü", "v_18_t"),
        ("../x", "x"),
        ("a__b", "a_b"),
        ("ü", "v"),
    ],
)
def test_names_as_casadi_takes_them_in_c(name: str, word: str) -> None:
    assert identifier(name) == word
    x = ca.SX.sym("x")
    code = ca.CodeGenerator(word)
    code.add(ca.Function(f"{word}_rates", [x], [x]))
    assert f"{word}_rates" in code.dump()
