"""Checking the units of equations: dimensions carried through CasADi's list of instructions."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from clutchest.units import Dimensions, parse

NONE: Dimensions = (0, 0, 0, 0, 0)
SECOND: Dimensions = (0, 0, 1, 0, 0)

# What an instruction does with dimensions.
_SAME = {ca.OP_ADD, ca.OP_SUB, ca.OP_FMIN, ca.OP_FMAX}
_COMPARISONS = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
_KEPT = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_FABS, ca.OP_TWICE}
_LOGICAL = {ca.OP_NOT, ca.OP_AND, ca.OP_OR}
_TRANSCENDENTAL = {ca.OP_EXP, ca.OP_LOG, ca.OP_TANH, ca.OP_SIN, ca.OP_COS}


class Plain(float):
    """A number written into an equation: it takes the dimension of its place."""


Carried = Dimensions | Plain


class UnitsError(AssertionError):
    """Quantities of different kinds are added, compared, or put into an exponential."""


def dimensions_of(unit: str) -> Dimensions:
    """Exponents of kg, m, s, K, A."""
    return parse(unit).dimensions


def per_second(dimensions: Dimensions) -> Dimensions:
    """Those of a rate of change."""
    return _times(dimensions, SECOND, -1)


def carried(function: ca.Function, given: Mapping[int, list[Dimensions]]) -> list[list[Carried]]:
    """Dimensions of every output entry of a scalar-expanded CasADi function.

    ``given``: number of the input → dimensions of its entries.  Raises UnitsError where the
    expressions do not balance, NotImplementedError for an operation without a rule.
    """
    slots: dict[int, Carried] = {}
    outputs: list[list[Carried]] = [
        [Plain(0.0)] * function.nnz_out(i) for i in range(function.n_out())
    ]
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        into, of = function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            outputs[into[0]][into[1]] = slots[of[0]]
        elif op == ca.OP_INPUT:
            slots[into[0]] = given[of[0]][of[1]]
        elif op == ca.OP_CONST:
            slots[into[0]] = Plain(function.instruction_constant(k))
        else:
            slots[into[0]] = _applied(op, [slots[i] for i in of])
    return outputs


def balances(result: Carried, wanted: Dimensions) -> bool:
    """Whether a value may stand where ``wanted`` is expected."""
    return isinstance(result, Plain) or result == wanted


def _applied(op: int, of: list[Carried]) -> Carried:
    if op in _SAME:
        return _common(*of)
    if op in _COMPARISONS:
        _common(*of)
        return NONE
    if op in _KEPT:
        return of[0]
    if op in _LOGICAL or op in _TRANSCENDENTAL:
        for operand in of:
            _common(operand, NONE)
        return NONE
    if op == ca.OP_SIGN:
        return NONE
    if op == ca.OP_IF_ELSE_ZERO:
        _common(of[0], NONE)
        return of[1]
    if op == ca.OP_MUL:
        return _product(of[0], of[1], 1)
    if op == ca.OP_DIV:
        return _product(of[0], of[1], -1)
    if op == ca.OP_INV:
        return _product(Plain(1.0), of[0], -1)
    if op == ca.OP_SQ:
        return _product(of[0], of[0], 1)
    if op == ca.OP_SQRT:
        return _power(of[0], Plain(0.5))
    if op in (ca.OP_POW, ca.OP_CONSTPOW):
        return _power(of[0], of[1])
    raise NotImplementedError(f"CasADi operation {op} has no rule for dimensions")


def _common(a: Carried, b: Carried) -> Carried:
    if isinstance(a, Plain):
        return b
    if not balances(b, a):
        raise UnitsError(f"{a} and {b} (kg, m, s, K, A) are added or compared")
    return a


def _product(a: Carried, b: Carried, sign: int) -> Carried:
    if isinstance(a, Plain) and isinstance(b, Plain):
        return Plain(a * b**sign) if b or sign > 0 else Plain(float("nan"))
    return _times(NONE if isinstance(a, Plain) else a, NONE if isinstance(b, Plain) else b, sign)


def _times(a: Dimensions, b: Dimensions, power: float) -> Dimensions:
    raised = [m + power * n for m, n in zip(a, b, strict=True)]
    if any(exponent != int(exponent) for exponent in raised):
        raise UnitsError(f"{b} (kg, m, s, K, A) is raised to {power}")
    return tuple(int(exponent) for exponent in raised)  # type: ignore[return-value]


def _power(base: Carried, exponent: Carried) -> Carried:
    if isinstance(base, Plain) and isinstance(exponent, Plain):
        return Plain(base**exponent)
    if isinstance(exponent, Plain):
        return _times(NONE, base, exponent)  # type: ignore[arg-type]
    _common(base, NONE)
    _common(exponent, NONE)
    return NONE
