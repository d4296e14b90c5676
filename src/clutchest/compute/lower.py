"""Lowering: CasADi expressions become straight-line Python that numba compiles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import casadi as ca

from clutchest.compute.step import Step, decays, heun
from clutchest.models.effects.effect import INPUT_NOISE, PARAMETER, START
from clutchest.models.model import Expressions, Model

_SCALARS = ("dt",)  # arguments that are plain numbers
_EXACT = "@njit(cache=True, error_model='numpy')"
# a product and a sum in one instruction, rounded once instead of twice: no longer the same to the
# last bit beside a term that is nought
_CONTRACTED = "@njit(cache=True, error_model='numpy', fastmath={'contract'})"
_LONGEST = 160  # characters, beyond which an expression gets a name of its own

# What each operation of CasADi is in Python; see compute.choices for the named ones.
_CALLS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_EXP: "exp({0})",
    ca.OP_EXPM1: "expm1({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_POW: "{0} ** {1}",
    ca.OP_CONSTPOW: "{0} ** {1}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_FABS: "abs({0})",
    ca.OP_LT: "less({0}, {1})",
    ca.OP_LE: "at_most({0}, {1})",
    ca.OP_EQ: "same({0}, {1})",
    ca.OP_NE: "(1.0 - same({0}, {1}))",
    ca.OP_NOT: "same({0}, 0.0)",
    ca.OP_AND: "both({0}, {1})",
    ca.OP_OR: "either({0}, {1})",
    ca.OP_SIGN: "sign({0})",
    ca.OP_FMIN: "smaller({0}, {1})",
    ca.OP_FMAX: "larger({0}, {1})",
    ca.OP_IF_ELSE_ZERO: "when({0}, {1})",
}


def lower(
    name: str,
    inputs: dict[str, ca.SX],
    outputs: dict[str, ca.SX],
    returned: str = "",
    compiled: str = _EXACT,
) -> str:
    """Source of a function ``name(inputs…, outputs…)`` that fills its output arrays.

    Only structurally nonzero entries are written: the caller's arrays start as zeros.  An output
    that is a column vector becomes a one-dimensional array.  ``returned`` names a scalar output
    that is returned instead.  Raises NotImplementedError for an operation numba has no name for.
    """
    function = ca.Function(name, list(inputs.values()), list(outputs.values()), {"cse": True})
    targets = list(outputs)
    places = [
        list(zip(*function.sparsity_out(i).get_triplet(), strict=True)) for i in range(len(targets))
    ]
    values, written = _values(name, function, list(inputs))
    uses = Counter(of for _, _, of in written)
    for template, operands in values:
        for i, of in enumerate(operands):
            uses[of] += template.count(f"{{{i}}}")
    lines, texts = [], [""] * len(values)
    for k, (template, operands) in enumerate(values):
        text = template.format(*(texts[of] for of in operands))
        if operands and (uses[k] > 1 or len(text) > _LONGEST):
            lines.append(f"v{k} = {text}")
            text = f"v{k}"
        elif operands:
            text = f"({text})"  # used once: stands where it is used, which compiles faster
        texts[k] = text
    result = "0.0"
    for output, place, of in written:
        target, (row, column) = targets[output], places[output][place]
        if target == returned:
            result = texts[of]
        elif outputs[target].is_column():
            lines.append(f"{target}[{row}] = {texts[of]}")
        else:
            lines.append(f"{target}[{row}, {column}] = {texts[of]}")
    lines.append(f"return {result}")
    arguments = ", ".join([*inputs, *(t for t in targets if t != returned)])
    head = f"{compiled}\ndef {name}({arguments}):\n"
    return head + "\n".join("    " + line for line in lines) + "\n"


def _values(
    name: str, function: ca.Function, arrays: list[str]
) -> tuple[list[tuple[str, tuple[int, ...]]], list[tuple[int, int, int]]]:
    """Every value the function makes, as (template, numbers of its operands), and what is written:
    (output, place in it, number of the value).  CasADi re-uses work slots; here each value has
    its own number."""
    values: list[tuple[str, tuple[int, ...]]] = []
    written: list[tuple[int, int, int]] = []
    slots: dict[int, int] = {}
    reciprocals: dict[int, int] = {}
    value: tuple[str, tuple[int, ...]]
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        into, of = function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            written.append((into[0], into[1], slots[of[0]]))
            continue
        if op == ca.OP_CONST:
            value = (f"({function.instruction_constant(k)!r})", ())  # may be negative
        elif op == ca.OP_INPUT:
            scalar = arrays[of[0]] in _SCALARS
            value = (arrays[of[0]] + ("" if scalar else f"[{of[1]}]"), ())
        elif op == ca.OP_DIV:  # one division per divisor: it costs as much as a dozen products
            top, bottom = slots[of[0]], slots[of[1]]
            if bottom not in reciprocals:
                reciprocals[bottom] = len(values)
                values.append((_CALLS[ca.OP_INV], (bottom,)))
            value = (_CALLS[ca.OP_MUL], (top, reciprocals[bottom]))
        elif op in _CALLS:
            value = (_CALLS[op], tuple(slots[i] for i in of))
        else:
            raise NotImplementedError(f"{name}: CasADi operation {op} has no numba form here")
        slots[into[0]] = len(values)
        values.append(value)
    return values, written


def module_text(model: Model, thetas: Sequence[tuple[str, str]]) -> str:
    """Source of all functions that kernel and online filter call, for one model.

    ``thetas`` are what signatures are taken of: (``"parameter"``, key), (effect name, number),
    (``"start"``, state), the value with which a state begins, or (``"input_noise"``, input), what
    an input is off by in the rates of all states but those that readings renew: only fits that
    track the latter (``transition``) ask for it.
    """
    e = model.expressions()
    taken = heun(model, e)
    theta = ca.vertcat(ca.SX(0, 1), *(_symbol(model, e, *names) for names in thetas))
    at = {"x": e.x, "u": e.u, "w": e.w, "p": e.p, "g": e.g}
    over = {"x": e.x, "u0": e.u, "u1": taken.u1, "dt": taken.dt, "w": e.w, "p": e.p, "g": e.g}

    # a delay shifts a signal in time: its response is that signal's slope over the step, times the
    # most that a delay is which varies
    late = ca.SX(len(model.inputs), len(thetas))
    slope = ca.SX.sym("slope", len(model.inputs))
    for k, (owner, key) in enumerate(thetas):
        for effect in model.effects:
            for signal, number in effect.delays.items():
                if effect.name == owner and number == key:
                    varies, j = effect.lateness.get(signal), model.input(signal)
                    late[j, k] = slope[j] * (varies.reach if varies else 1.0)

    moves = ca.SX.sym("moves", len(model.inputs))
    calm = heun(model, e, moves) if e.dragging else taken
    calmly = over | {"u1": calm.u1, "dt": calm.dt, "moves": moves}

    def by_theta(of: ca.SX, taken: Step = taken) -> ca.SX:
        by_inputs = ca.jacobian(of, e.u) + ca.jacobian(of, taken.u1)
        return ca.jacobian(of, theta) + ca.mtimes(by_inputs, late)

    # too small to matter within a step: the first order will do
    taken_in = ca.SX(len(model.states), len(thetas))
    kept = [i for i, state in enumerate(model.states) if state.name not in model.renewed]
    for k, (owner, name) in enumerate(thetas):
        if owner == INPUT_NOISE:
            taken_in[kept, k] = calm.dt * ca.jacobian(e.rate, e.u)[kept, model.input(name)]

    decay = ca.SX(len(model.states), 1)
    for i, rate in decays(model, e).items():
        decay[i] = rate

    started = ca.SX(e.initial.numel(), len(thetas))
    for k, (owner, name) in enumerate(thetas):
        if owner == START:
            started[:, k] = ca.jacobian(e.initial, e.x[model.state(name)])

    parts = [
        f"STATES, INPUTS, OUTPUTS, SENSORS, THETAS = {len(model.states)}, {len(model.inputs)}, "
        f"{len(model.outputs)}, {len(model.sensors)}, {len(thetas)}",
        f"HAS_MAP = {not ca.is_equal(e.mapped, e.x)}",
        f"SCALES = np.array({[i for i, s in enumerate(model.states) if s.factor]}, np.int64)",
        f"DOUBTED = np.array({[model.state(name) for name in model.doubted]}, np.int64)",
        lower(
            "step",
            over | {"q": taken.q, "noise": taken.noise},
            {
                "xn": taken.x,
                "F": ca.jacobian(taken.x, e.x),
                "Q": taken.Q,
                "energy": taken.energy,
                "e": ca.jacobian(taken.energy, e.x).T,
            },
            "energy",
        ),
        lower(
            "step_signature",
            over | {"slope": slope},
            {"G": by_theta(taken.x), "eG": by_theta(taken.energy).T},
        ),
        lower("follow", calmly, {"xn": calm.x}),
        lower(
            "transition",
            calmly | {"slope": slope},
            {"F": ca.jacobian(calm.x, e.x), "G": by_theta(calm.x, calm) + taken_in},
            compiled=_CONTRACTED,
        ),
        _product("carry", ca.jacobian(calm.x, e.x)),
        lower("gathered", calmly | {"q": calm.q, "noise": calm.noise}, {"Q": calm.Q}),
        lower("implied", at, {"v": e.implied}),
        lower("decays", at, {"decay": decay, "D": ca.jacobian(decay, e.x)}),
        lower(
            "dynamics",
            at,
            {"f": e.rate, "A": ca.jacobian(e.rate, e.x), "B": ca.jacobian(e.rate, e.u)},
        ),
        lower(
            "step_map",
            {"x": e.x, "u0": e.u0, "u": e.u, "w": e.w, "p": e.p, "g": e.g},
            {"mapped": e.mapped, "J": ca.jacobian(e.mapped, e.x)},
        ),
        lower(
            "outputs",
            at,
            {"y": e.outputs, "Y": ca.jacobian(e.outputs, e.x), "Yu": ca.jacobian(e.outputs, e.u)},
        ),
        lower("outputs_signature", at, {"Ym": ca.jacobian(e.outputs, theta)}),
        lower(
            "initial",
            {"x": e.x, "p": e.p, "g": e.g},
            {"xi": e.initial, "Si": ca.jacobian(e.initial, theta) + started},
        ),
    ]
    for i, _ in enumerate(model.sensors):
        h = e.readings[i]
        parts.append(lower(f"reading_{i}", at, {"h": h, "H": ca.jacobian(h, e.x).T}, "h"))
        parts.append(lower(f"reading_{i}_signature", at, {"Hm": ca.jacobian(h, theta).T}))
    parts.append(_dispatch("reading", "H", "", len(model.sensors)))
    parts.append(_dispatch("reading_signature", "Hm", "_signature", len(model.sensors)))
    return "\n\n".join(parts)


def forward_text(model: Model, watched: Sequence[str]) -> str:
    """Source of the functions that run a model by itself: a step, and ``watched`` quantities."""
    e = model.expressions()
    taken = heun(model, e)
    shown = ca.vertcat(*(getattr(e.quantities, name) for name in watched))
    over = {"x": e.x, "u0": e.u, "u1": taken.u1, "dt": taken.dt, "w": e.w, "p": e.p, "g": e.g}
    at = {"x": e.x, "u": e.u, "w": e.w, "p": e.p, "g": e.g}
    return "\n\n".join([lower("advance", over, {"xn": taken.x}), lower("watch", at, {"y": shown})])


def _product(name: str, matrix: ca.SX) -> str:
    """A function ``name(F, X, T, columns)``: T ← T + F X for an F with zeros where ``matrix`` has
    them.  All rows of a column at once, so that columns are loaded once and go in parallel."""
    places = list(zip(*matrix.sparsity().get_triplet(), strict=True))
    rows = {i: [k for row, k in places if row == i] for i, _ in places}
    lines = [
        _CONTRACTED,
        f"def {name}(F, X, T, columns):",
        *(f"    f{i}_{k} = F[{i}, {k}]" for i, k in places),
        "    for c in range(columns):",
        *(f"        x{k} = X[{k}, c]" for k in sorted({k for _, k in places})),
        *(
            f"        T[{i}, c] += {' + '.join(f'f{i}_{k} * x{k}' for k in of)}"
            for i, of in rows.items()
        ),
    ]
    return "\n".join(lines) + "\n"


def _dispatch(name: str, target: str, suffix: str, sensors: int) -> str:
    """A function that picks a sensor's own function by its index and clears its target first."""
    lines = [_EXACT, f"def {name}(sensor, x, u, w, p, g, {target}):", f"    {target}[:] = 0.0"]
    for i in range(sensors):
        lines.append(f"    if sensor == {i}:")
        lines.append(f"        return reading_{i}{suffix}(x, u, w, p, g, {target})")
    return "\n".join([*lines, "    return 0.0"]) + "\n"


def _symbol(model: Model, e: Expressions, owner: str, key: str) -> ca.SX:
    if owner in (START, INPUT_NOISE):
        return ca.SX.sym(key)  # the equations know it by what it leads to only
    if owner == PARAMETER:
        return e.p[[p.key for p in model.parameters].index(key)]
    return e.g[[(effect.name, number) for effect, number in model.numbers].index((owner, key))]
