"""What is lowered says what CasADi says, and its derivatives are derivatives."""

from __future__ import annotations

import linecache
import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest

from bench import BENCHES, Bench
from clutchest.compute import build, choices
from clutchest.compute.lower import (
    _CALLS,
    columns_of,
    covariance_step,
    lower,
    signature_step,
)
from clutchest.compute.lower import (
    product as matrix_product,
)
from clutchest.compute.step import heun
from clutchest.errors import ClutchestError
from clutchest.models.model import Model
from equations import argument_names, draw, vector

BenchOf = Callable[[str], Bench]


# --- operation by operation ---


def runnable(text: str) -> Callable[..., Any]:
    """The one function in ``text``, compiled."""
    names: dict[str, Any] = {}
    exec(build._HEADER, names)
    names |= {**vars(choices), "__name__": "lowered"}
    file = f"<{hash(text)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    exec(compile(text, file, "exec"), names)
    return names["lowered"]


OPERATIONS: dict[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "sum": lambda a, b: a + b,
    "difference": lambda a, b: a - b,
    "product": lambda a, b: a * b,
    "quotient": lambda a, b: a / b,
    "negative": lambda a, b: -a,
    "twice": lambda a, b: a + a,
    "square": lambda a, b: a * a,
    "inverse": lambda a, b: 1 / a,
    "root": lambda a, b: ca.sqrt(a),
    "power": lambda a, b: a**b,
    "constant power": lambda a, b: a**2.5,
    "power of a negative number": lambda a, b: ca.SX(-2.0) ** b,
    "exponential": lambda a, b: ca.exp(a),
    "exponential less one": lambda a, b: ca.expm1(a),
    "logarithm": lambda a, b: ca.log(a),
    "sine": lambda a, b: ca.sin(a),
    "cosine": lambda a, b: ca.cos(a),
    "hyperbolic tangent": lambda a, b: ca.tanh(a),
    "tangent": lambda a, b: ca.tan(a),
    "arcs": lambda a, b: ca.asin(a / 4.0) + ca.acos(b / 4.0) + ca.atan(a),
    "angle": lambda a, b: ca.atan2(a, b),
    "hyperbolic functions": lambda a, b: ca.sinh(a) + ca.cosh(b),
    "their inverses": lambda a, b: ca.asinh(a) + ca.acosh(a**2 + 1.0) + ca.atanh(b / 4.0),
    "logarithm of one more": lambda a, b: ca.log1p(a**2),
    "error function": lambda a, b: ca.erf(a),
    "hypotenuse": lambda a, b: ca.hypot(a, b),
    "next higher whole number": lambda a, b: ca.ceil(3.0 * a),
    "next lower whole number": lambda a, b: ca.floor(3.0 * a),
    "absolute": lambda a, b: ca.fabs(a),
    "sign": lambda a, b: ca.sign(a),
    "less": lambda a, b: a < b,
    "at most": lambda a, b: a <= b,
    "equal": lambda a, b: a == b,
    "different": lambda a, b: a != b,
    "not": lambda a, b: ca.logic_not(a),
    "and": lambda a, b: ca.logic_and(a, b),
    "or": lambda a, b: ca.logic_or(a, b),
    "smaller": lambda a, b: ca.fmin(a, b),
    "larger": lambda a, b: ca.fmax(a, b),
    "branch": lambda a, b: ca.if_else(a < b, a, 3.0),
    "dead branch": lambda a, b: ca.if_else(a > 0, ca.log(a) / a, b),
    "nested": lambda a, b: -(a - (b - (a - 2.0))) / (a / (b / 3.0)) ** 2,
    "infinite": lambda a, b: ca.fmin(a, ca.SX(math.inf)),
}
ENDS = [-3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0]


def test_every_operation_is_casadis() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    x = ca.vertcat(a, b)
    y = ca.vertcat(*(make(a, b) for make in OPERATIONS.values()))
    theirs, ours = ca.Function("y", [x], [y]), runnable(lower("lowered", {"x": x}, {"y": y}))
    used = {theirs.instruction_id(k) for k in range(theirs.n_instructions())}
    assert set(_CALLS) - used <= {ca.OP_ASSIGN}, "an operation that no case here has"
    rng = np.random.default_rng(0)
    for point in [*product(ENDS, ENDS), *rng.normal(0.0, 2.0, (300, 2))]:
        got = np.zeros(len(OPERATIONS))
        ours(np.array(point), got)
        wanted = np.array(theirs(list(point))).ravel()
        np.testing.assert_allclose(got, wanted, rtol=1e-14, atol=0.0, err_msg=str(point))


def test_a_dead_branch_does_no_harm_in_the_derivative() -> None:
    x = ca.SX.sym("x", 1)
    y = ca.if_else(x > 0, ca.log(x), 5.0)
    ours = runnable(lower("lowered", {"x": x}, {"y": y, "d": ca.jacobian(y, x)}))
    y, d = np.zeros(1), np.zeros(1)
    ours(np.array([-1.0]), y, d)
    assert (y[0], d[0]) == (5.0, 0.0)


def test_matrices_vectors_and_a_returned_number() -> None:
    x, dt = ca.SX.sym("x", 3), ca.SX.sym("dt")
    matrix = ca.SX(2, 3)
    matrix[1, 2] = x[0] * dt
    ours = runnable(
        lower("lowered", {"x": x, "dt": dt}, {"m": matrix, "v": 2 * x, "s": x[1] - dt}, "s")
    )
    m, v = np.full((2, 3), 9.0), np.zeros(3)
    assert ours(np.array([1.0, 2.0, 3.0]), 0.5, m, v) == 1.5
    assert v.tolist() == [2.0, 4.0, 6.0]
    assert m[1, 2] == 0.5
    assert (m == 9.0).sum() == 5, "structural zeros are the caller's"


def test_an_operation_without_a_name_is_refused() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(ClutchestError, match=r"CasADi's fmod, which .* there are .*, atan2, "):
        lower("slope", {"x": x}, {"y": ca.fmod(x, 2.0)})


# --- a whole model ---


class Lowered:
    """One model's compiled functions under one signature: arrays in, named arrays out."""

    def __init__(self, b: Bench) -> None:
        self.f, self.b, self.model = b.full.functions, b, b.full.model
        n, nu, no, m = self.f.STATES, self.f.INPUTS, self.f.OUTPUTS, self.f.THETAS
        self.shapes = {
            "xn": n,
            "F": (n, n),
            "Q": (n, n),
            "e": n,
            "G": (n, m),
            "eG": m,
            "f": n,
            "A": (n, n),
            "B": (n, nu),
            "mapped": n,
            "J": (n, n),
            "y": no,
            "Y": (no, n),
            "Yu": (no, nu),
            "Ym": (no, m),
            "xi": n,
            "Si": (n, m),
            "h": self.f.SENSORS,
            "H": (self.f.SENSORS, n),
            "Hm": (self.f.SENSORS, m),
            "energy": 1,
        }

    def point(self, rng: np.random.Generator) -> dict[str, Any]:
        """Anywhere plausible; ``dt`` about the longest step, 10–50 ms for the truck."""
        names, plausible = argument_names(self.model), self.b.plausible
        gains = {
            f"{e.name}.{n.key}": (n.lower, n.upper)
            for e in self.model.effects
            for n in e.parameters
        }
        inputs = {name: plausible.inputs[name] for name in names[1]}
        states = {name: plausible.states[name] for name in names[0]}
        return {
            "x": vector(names[0], draw(rng, states)),
            "u0": vector(names[1], draw(rng, inputs)),
            "u1": vector(names[1], draw(rng, inputs)),
            "dt": rng.uniform(0.5, 2.5) * self.model.longest[0],
            "w": rng.integers(0, 2, len(names[2])).astype(float),
            "p": self.b.full.p,
            "g": vector(names[4], draw(rng, gains)),
            "q": rng.uniform(0.0, 1.0, 2 * len(names[0])),
            "noise": rng.uniform(0.0, 1.0, len(names[1])),
        }

    def __call__(self, at: dict[str, Any]) -> dict[str, np.ndarray]:
        """Everything at one point: ``u0`` and ``u1`` are a step's inputs, ``u1`` one moment's."""
        out = {name: np.zeros(shape) for name, shape in self.shapes.items()}
        over = [at[k] for k in ("x", "u0", "u1", "dt", "w", "p", "g")]
        one = [at[k] for k in ("x", "u1", "w", "p", "g")]
        out["energy"][0] = self.f.step(
            *over, at["q"], at["noise"], out["xn"], out["F"], out["Q"], out["e"]
        )
        slope = (at["u1"] - at["u0"]) / at["dt"]
        self.f.step_signature(*over, slope, out["G"], out["eG"])
        self.f.dynamics(*one, out["f"], out["A"], out["B"])
        self.f.step_map(*(at[k] for k in ("x", "u0", "u1", "w", "p", "g")), out["mapped"], out["J"])
        self.f.outputs(*one, out["y"], out["Y"], out["Yu"])
        self.f.outputs_signature(*one, out["Ym"])
        self.f.initial(at["x"], at["p"], at["g"], out["xi"], out["Si"])
        for i in range(self.f.SENSORS):
            out["h"][i] = self.f.reading(i, *one, out["H"][i])
            self.f.reading_signature(i, *one, out["Hm"][i])
        return out


@pytest.fixture(scope="module", params=list(BENCHES))
def lowered(request: pytest.FixtureRequest, bench: BenchOf) -> Lowered:
    return Lowered(bench(request.param))


def test_every_lowered_function_is_casadis(lowered: Lowered) -> None:
    """Delays aside, whose signature is no derivative by a symbol: see the next test."""
    e = lowered.model.expressions()
    s = heun(lowered.model, e)
    numbers = [(effect.name, key) for effect, key in lowered.model.numbers]
    g = ca.vertcat(*(e.g[numbers.index(theta)] for theta in lowered.b.full.thetas))
    over = [e.x, e.u, s.u1, s.dt, e.w, e.p, e.g, s.q, s.noise]

    def now(*expressions: ca.SX) -> list[ca.SX]:
        """Of one moment: its inputs are called u1 here."""
        return ca.substitute(list(expressions), [e.u], [s.u1])

    mapped = ca.substitute([e.mapped], [ca.vertcat(e.u0, e.u)], [ca.vertcat(e.u, s.u1)])[0]
    j = ca.jacobian
    theirs = {
        "xn": s.x,
        "F": j(s.x, e.x),
        "Q": s.Q,
        "energy": s.energy,
        "e": j(s.energy, e.x).T,
        "G": j(s.x, g),
        "eG": j(s.energy, g).T,
        **dict(zip(("f", "A", "B"), now(e.rate, j(e.rate, e.x), j(e.rate, e.u)), strict=True)),
        "mapped": mapped,
        "J": j(mapped, e.x),
        **dict(
            zip(
                ("y", "Y", "Yu", "Ym"),
                now(e.outputs, j(e.outputs, e.x), j(e.outputs, e.u), j(e.outputs, g)),
                strict=True,
            )
        ),
        "xi": e.initial,
        "Si": j(e.initial, g),
        **dict(
            zip(
                ("h", "H", "Hm"), now(e.readings, j(e.readings, e.x), j(e.readings, g)), strict=True
            )
        ),
    }
    assert set(theirs) == set(lowered.shapes)
    reference = ca.Function("reference", over, list(theirs.values()))
    late = [
        k
        for k, theta in enumerate(lowered.b.full.thetas)
        if _delayed(lowered.model, *theta) is not None
    ]
    rng = np.random.default_rng(5)
    for _ in range(200):
        at = lowered.point(rng)
        got = lowered(at)
        made = reference(*(at[k] for k in ("x", "u0", "u1", "dt", "w", "p", "g", "q", "noise")))
        for name, value in zip(theirs, made, strict=True):
            wanted, found = np.array(value).reshape(got[name].shape), got[name]
            if name in ("G", "eG"):
                wanted, found = np.delete(wanted, late, -1), np.delete(found, late, -1)
            np.testing.assert_allclose(
                found, wanted, rtol=1e-11, atol=1e-13 * np.abs(wanted).max(), err_msg=name
            )


# derivative: (of what, by what)
BY_STATE = {"F": "xn", "e": "energy", "A": "f", "J": "mapped", "Y": "y", "H": "h"}
BY_INPUT = {"B": "f", "Yu": "y"}
BY_THETA = {"G": "xn", "eG": "energy", "Ym": "y", "Si": "xi", "Hm": "h"}


def test_derivatives_are_the_slopes_of_the_functions(lowered: Lowered) -> None:
    """Central differences, of two widths to know a kink when one lies between."""
    rng, compared, kinks = np.random.default_rng(6), 0, 0
    for _ in range(40):
        at = lowered.point(rng)
        stated = lowered(at)
        for derivatives, column, size, along in _moves(lowered, at):
            wide, narrow = (_slope(lowered, at, along, h) for h in (2e-5, 1e-5))
            for name, of in derivatives.items():
                scale = np.abs(narrow[of]).max() + 1e-6 * np.abs(stated[of]).max()
                if np.abs(wide[of] - narrow[of]).max() > 1e-4 * scale:
                    kinks += 1
                    continue
                compared += 1
                exact = size * np.atleast_1d(stated[name][..., column])
                assert np.abs(exact - narrow[of]).max() <= 3e-4 * scale, (name, column)
    assert compared > 20 * kinks, (compared, kinks)


Move = tuple[dict[str, str], int, float, dict[str, np.ndarray]]


def _moves(lowered: Lowered, at: dict[str, Any]) -> Iterator[Move]:
    """What is differentiated, by which column, how far the column moves, and what moves along."""

    def unit(like: np.ndarray, i: int) -> np.ndarray:
        return np.eye(len(like))[i]

    for i, value in enumerate(at["x"]):
        size = max(abs(value), 0.1)
        yield BY_STATE, i, size, {"x": size * unit(at["x"], i)}
    for i, value in enumerate(at["u1"]):
        size = max(abs(value), 0.1)
        yield BY_INPUT, i, size, {"u1": size * unit(at["u1"], i)}
    numbers = [(effect.name, key) for effect, key in lowered.model.numbers]
    for k, (name, key) in enumerate(lowered.b.full.thetas):
        late = _delayed(lowered.model, name, key)
        if late is None:
            yield BY_THETA, k, 1.0, {"g": unit(at["g"], numbers.index((name, key)))}
        else:  # acts over a step, by moving the signal along its own slope
            shift = 1e-3 * unit(at["u1"], late) * (at["u1"] - at["u0"]) / at["dt"]
            yield {"G": "xn", "eG": "energy"}, k, 1e-3, {"u0": shift, "u1": shift}


def _delayed(model: Model, name: str, key: str) -> int | None:
    """The input that this number of an effect delays, None if it delays none."""
    effect = next(effect for effect in model.effects if effect.name == name)
    return next((model.input(s) for s, number in effect.delays.items() if number == key), None)


def _slope(
    lowered: Lowered, at: dict[str, Any], along: dict[str, np.ndarray], h: float
) -> dict[str, np.ndarray]:
    up, down = (
        lowered({**at, **{name: at[name] + step * way for name, way in along.items()}})
        for step in (h, -h)
    )
    return {name: (up[name] - down[name]) / (2.0 * h) for name in up}


# --- a step of a covariance and of responses ---


@pytest.mark.parametrize("make", [covariance_step, signature_step])
def test_products_with_the_zeros_of_a_step(make: Callable[[str, ca.SX], str]) -> None:
    """Beside numpy's, for a transition with zeros, an empty row and an empty column."""
    rng = np.random.default_rng(3)
    pattern = np.array([[1, 1, 0, 0], [0, 1, 0, 1], [0, 0, 0, 0], [1, 0, 0, 1]])
    text = f"STATES, THETAS = 4, 3\n{make('lowered', ca.sparsify(ca.SX(pattern)))}"
    function = runnable(text)
    F, G = pattern * rng.normal(size=(4, 4)), rng.normal(size=(4, 3))
    root = rng.normal(size=(4, 4))
    P, Q, S = root @ root.T, np.diag(rng.uniform(size=4)), rng.normal(size=(4, 3))
    if make is signature_step:
        wanted = F @ S + G
        function(S, F, G)
        assert pytest.approx(wanted, rel=1e-13) == S
    else:
        wanted = F @ P @ F.T + Q
        function(P, F, Q, np.zeros((4, 4)))
        assert pytest.approx(wanted, rel=1e-13) == P
        assert np.array_equal(P, P.T)


def test_a_product_overwrites_and_its_columns_are_named():
    """Beside numpy's, for a matrix with zeros, an empty row and an empty column."""
    rng = np.random.default_rng(4)
    pattern = np.array([[1, 1, 0, 0], [0, 1, 0, 1], [0, 0, 0, 0], [1, 1, 0, 1]])
    matrix = ca.sparsify(ca.SX(pattern))
    text = "\n".join([matrix_product("lowered", matrix), *columns_of("FIRST", "ROW", matrix)])
    function = runnable(text)
    F, X, T = pattern * rng.normal(size=(4, 4)), rng.normal(size=(4, 5)), np.full((4, 5), np.nan)
    function(F, X, T, 5)
    assert pytest.approx(F @ X, rel=1e-13) == T
    named: dict[str, np.ndarray] = {}
    exec("\n".join(columns_of("FIRST", "ROW", matrix)), {"np": np}, named)
    for k in range(4):
        rows = named["ROW"][named["FIRST"][k] : named["FIRST"][k + 1]]
        np.testing.assert_array_equal(rows, np.flatnonzero(pattern[:, k]))
