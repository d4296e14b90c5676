"""Lowering: CasADi expressions become straight-line Python, ready to be compiled."""

from __future__ import annotations

from collections import Counter

import casadi as ca

from clutchest.errors import ClutchestError

_SCALARS = ("dt",)  # arguments that are plain numbers
_EXACT = "@compiled"
_STRAIGHT = "@compiled(straight=True)"
_APART = "@compiled(apart=True)"
# a product and a sum in one instruction, rounded once instead of twice: no longer the same to the
# last bit beside a term that is zero
CONTRACTED = "@compiled(contract=True, straight=True)"
_APART_CONTRACTED = "@compiled(apart=True, contract=True)"
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
    ca.OP_TAN: "tan({0})",
    ca.OP_ASIN: "asin({0})",
    ca.OP_ACOS: "acos({0})",
    ca.OP_ATAN: "atan({0})",
    ca.OP_ATAN2: "angle({0}, {1})",
    ca.OP_SINH: "sinh({0})",
    ca.OP_COSH: "cosh({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_ASINH: "asinh({0})",
    ca.OP_ACOSH: "acosh({0})",
    ca.OP_ATANH: "atanh({0})",
    ca.OP_LOG1P: "log1p({0})",
    ca.OP_ERF: "erf({0})",
    ca.OP_HYPOT: "sqrt({0} * {0} + {1} * {1})",
    ca.OP_CEIL: "np.ceil({0})",
    ca.OP_FLOOR: "np.floor({0})",
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
    compiled: str = _STRAIGHT,
) -> str:
    """Source of a function ``name(inputs…, outputs…)`` that fills its output arrays.

    Only structurally nonzero entries are written: the caller's arrays start as zeros.  An output
    that is a column vector becomes a one-dimensional array.  ``returned`` names a scalar output
    that is returned instead.  Raises ClutchestError for an operation that has no form here.
    """
    function = ca.Function(name, list(inputs.values()), list(outputs.values()), {"cse": True})
    targets = list(outputs)
    places = [
        list(zip(*function.sparsity_out(i).get_triplet(), strict=True)) for i in range(len(targets))
    ]
    values, written = _values(function, list(inputs))
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
    function: ca.Function, arrays: list[str]
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
            raise ClutchestError(
                f"the equations use CasADi's {_named(op)}, which cannot be compiled; there are "
                f"{', '.join(sorted(map(_named, _CALLS)))}"
            )
        slots[into[0]] = len(values)
        values.append(value)
    return values, written


def _named(op: int) -> str:
    """What CasADi calls an operation."""
    (name,) = (n for n in dir(ca) if n.startswith("OP_") and getattr(ca, n) == op)
    return name.removeprefix("OP_").lower()


def product(name: str, matrix: ca.SX) -> str:
    """A function ``name(F, X, T, columns)``: T ← F X for an F with zeros where ``matrix`` has
    them.  All rows of a column at once, so that columns are loaded once and go in parallel."""
    rows, known = _rows(matrix)
    lines = [
        _APART_CONTRACTED,
        f"def {name}(F, X, T, columns):",
        *known,
        *_columns("X", "columns", rows),
        *(f"        T[{i}, c] = {_sum(i, of)}" for i, of in rows.items()),
    ]
    return "\n".join(lines) + "\n"


def columns_of(first: str, row: str, matrix: ca.SX) -> list[str]:
    """Two constants: where each column of a ``matrix`` begins, and ends, among its places that can
    differ from zero, column by column, and in which row each of these lies."""
    sparsity = matrix.sparsity()
    return [
        f"{first} = np.array({sparsity.colind()}, np.int64)",
        f"{row} = np.array({sparsity.row()}, np.int64)",
    ]


def covariance_step(name: str, matrix: ca.SX) -> str:
    """A function ``name(P, F, Q, T)``: P ← F P Fᵀ + Q, exactly symmetric, for an F with zeros where
    ``matrix`` has them; T is memory."""
    rows, known = _rows(matrix)
    lines = [
        _APART,
        f"def {name}(P, F, Q, T):",
        "    assert P.shape[1] == F.shape[1] == Q.shape[1] == T.shape[1] == STATES",
        *known,
        *_columns("P", "STATES", rows),
        *(f"        T[{i}, c] = {_sum(i, of)}" for i, of in rows.items()),
    ]
    for i in rows:
        lines += [f"    x{k} = T[{i}, {k}]" for k in _used(rows)]
        for j in range(i + 1):
            lines.append(f"    P[{i}, {j}] = Q[{i}, {j}] + {_sum(j, rows[j])}")
            lines += [f"    P[{j}, {i}] = P[{i}, {j}]"] if j < i else []
    return "\n".join(lines) + "\n"


def signature_step(name: str, matrix: ca.SX) -> str:
    """A function ``name(S, F, G)``: S ← F S + G for an F with zeros where ``matrix`` has them."""
    rows, known = _rows(matrix)
    lines = [
        _APART,
        f"def {name}(S, F, G):",
        "    assert F.shape[1] == STATES and S.shape[1] == G.shape[1] == THETAS",
        *known,
        *_columns("S", "THETAS", rows),
        *(f"        S[{i}, c] = G[{i}, c] + {_sum(i, of)}" for i, of in rows.items()),
    ]
    return "\n".join(lines) + "\n"


def _rows(matrix: ca.SX) -> tuple[dict[int, list[int]], list[str]]:
    """The columns of what can differ from zero, by rows; lines that load it."""
    places = list(zip(*matrix.sparsity().get_triplet(), strict=True))
    rows = {i: [k for row, k in places if row == i] for i in range(matrix.rows())}
    return rows, [f"    f{i}_{k} = F[{i}, {k}]" for i, k in places]


def _used(rows: dict[int, list[int]]) -> list[int]:
    """The columns in which there is anything."""
    return sorted({k for of in rows.values() for k in of})


def _columns(matrix: str, count: str, rows: dict[int, list[int]]) -> list[str]:
    """The head of a loop over the columns of a matrix: whole rows lie together in memory, so that
    several columns go in parallel, while each sum keeps its order."""
    return [
        f"    for c in range({count}):",
        *(f"        x{k} = {matrix}[{k}, c]" for k in _used(rows)),
    ]


def _sum(i: int, of: list[int]) -> str:
    """Row i of F times x, from left to right."""
    return " + ".join(f"f{i}_{k} * x{k}" for k in of) or "0.0"


def dispatch(name: str, target: str, suffix: str, sensors: int) -> str:
    """A function that picks a sensor's own function by its index and clears its target first."""
    lines = [_EXACT, f"def {name}(sensor, x, u, w, p, g, {target}):", f"    {target}[:] = 0.0"]
    for i in range(sensors):
        lines.append(f"    if sensor == {i}:")
        lines.append(f"        return reading_{i}{suffix}(x, u, w, p, g, {target})")
    return "\n".join([*lines, "    return 0.0"]) + "\n"
