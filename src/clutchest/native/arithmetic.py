"""Operations on numbers, as Python and numpy have them.

A division by zero gives what numpy gives: infinity or nan, for integers 0.  Nothing is reordered.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from clutchest.native.types import BOOL, FLOAT, INT, UINT, Scalar, Type, Unsupported, joined
from clutchest.native.writer import Value, Writer, number

_FLOATS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_INTEGERS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
_BITS = {
    ast.BitOr: "or",
    ast.BitAnd: "and",
    ast.BitXor: "xor",
    ast.LShift: "shl",
    ast.RShift: "ashr",
}
_FOLDED: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
}
_COMPARED: dict[type, tuple[str, str, Callable[[Any, Any], bool]]] = {
    ast.Eq: ("oeq", "eq", operator.eq),
    ast.NotEq: ("une", "ne", operator.ne),
    ast.Lt: ("olt", "slt", operator.lt),
    ast.LtE: ("ole", "sle", operator.le),
    ast.Gt: ("ogt", "sgt", operator.gt),
    ast.GtE: ("oge", "sge", operator.ge),
}
OF_C = (
    *("tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("expm1", "log1p", "erf"),
)
# functions of one float: of LLVM, or of the C library
FUNCTIONS: dict[Any, str] = {
    math.exp: "llvm.exp.f64",
    math.log: "llvm.log.f64",
    math.sin: "llvm.sin.f64",
    math.cos: "llvm.cos.f64",
    math.sqrt: "llvm.sqrt.f64",
    **{getattr(math, name): name for name in OF_C},
    np.exp: "llvm.exp.f64",
    np.log: "llvm.log.f64",
    np.sqrt: "llvm.sqrt.f64",
    np.floor: "llvm.floor.f64",
    np.ceil: "llvm.ceil.f64",
}


def converted(w: Writer, value: Value, to: Type) -> Value:
    """A number as another type; from float to integer it is cut off."""
    source = value.type
    if source == to:
        return value
    if not isinstance(source, Scalar) or not isinstance(to, Scalar):
        raise Unsupported(f"{source} as {to}")
    if value.is_constant and to == FLOAT:
        return number(float(value.constant))
    [operand] = value.leaves
    if to == BOOL:
        return truth(w, value)
    if source == FLOAT:
        return Value(to, (w.new(f"fpto{'u' if to == UINT else 's'}i double {operand} to i64"),))
    if to == FLOAT:
        wide = "i1" if source == BOOL else "i64"
        sign = "s" if source == INT else "u"
        return Value(FLOAT, (w.new(f"{sign}itofp {wide} {operand} to double"),))
    if source == BOOL:
        return Value(to, (w.new(f"zext i1 {operand} to i64"),), natural=True)
    return Value(to, value.leaves)  # the same bits


def truth(w: Writer, value: Value) -> Value:
    """Whether a number is not zero."""
    if value.type == BOOL:
        return value
    if value.is_constant:
        return number(bool(value.constant))
    if not isinstance(value.type, Scalar):
        raise Unsupported(f"the truth of {value.type}")
    test = "fcmp une double" if value.type == FLOAT else "icmp ne i64"
    zero = "0.0" if value.type == FLOAT else "0"
    return Value(BOOL, (w.new(f"{test} {value.leaves[0]}, {zero}"),))


def binary(w: Writer, op: ast.operator, a: Value, b: Value, flags: str = "") -> Value:
    """a op b; ``flags`` of LLVM for operations on floats."""
    kind = type(op)
    if kind in _FOLDED and a.is_constant and b.is_constant:
        folded = _FOLDED[kind](a.constant, b.constant)
        if not isinstance(folded, int) or abs(folded) < 2**63:
            return number(folded)
    if kind is ast.Pow:
        return _power(w, a, b, flags)
    of = FLOAT if kind is ast.Div else joined(a.type, b.type)
    if of == BOOL:
        of = BOOL if kind in (ast.BitOr, ast.BitAnd, ast.BitXor) else INT
    natural = a.natural and b.natural and kind in (ast.Add, ast.Mult, ast.FloorDiv, ast.RShift)
    natural |= (a.natural or b.natural) and kind is ast.BitAnd
    [x], [y] = converted(w, a, of).leaves, converted(w, b, of).leaves
    if of == FLOAT and kind in _FLOATS:
        return Value(of, (w.new(f"{_FLOATS[kind]} {flags}double {x}, {y}"),))
    if of == FLOAT or not isinstance(of, Scalar):
        raise Unsupported(f"{kind.__name__} of {a.type} and {b.type}")
    if kind in _BITS:
        name = "lshr" if kind is ast.RShift and of == UINT else _BITS[kind]
        return Value(of, (w.new(f"{name} {of.leaves[0]} {x}, {y}"),), natural=natural)
    if kind in _INTEGERS:
        return Value(of, (w.new(f"{_INTEGERS[kind]} i64 {x}, {y}"),), natural=natural)
    if kind in (ast.FloorDiv, ast.Mod) and of == INT:
        return Value(of, (_divided(w, x, y, kind is ast.Mod),), natural=natural)
    raise Unsupported(f"{kind.__name__} of {a.type} and {b.type}")


def _divided(w: Writer, x: str, y: str, remainder: bool) -> str:
    """Floor division of integers and its remainder, both 0 for a division by 0."""
    none = w.new(f"icmp eq i64 {y}, 0")
    safe = w.new(f"select i1 {none}, i64 1, i64 {y}")
    quotient, rest = w.new(f"sdiv i64 {x}, {safe}"), w.new(f"srem i64 {x}, {safe}")
    signs = w.new(f"xor i64 {rest}, {safe}")
    apart, uneven = w.new(f"icmp slt i64 {signs}, 0"), w.new(f"icmp ne i64 {rest}, 0")
    down = w.new(f"and i1 {apart}, {uneven}")
    if remainder:
        moved = w.new(f"add i64 {rest}, {safe}")
        result = w.new(f"select i1 {down}, i64 {moved}, i64 {rest}")
    else:
        moved = w.new(f"sub i64 {quotient}, 1")
        result = w.new(f"select i1 {down}, i64 {moved}, i64 {quotient}")
    return w.new(f"select i1 {none}, i64 0, i64 {result}")


def _power(w: Writer, a: Value, b: Value, flags: str) -> Value:
    """a ** b for a float; small whole powers are products."""
    if a.type == FLOAT and b.is_constant and type(b.constant) is int and 0 < b.constant < 5:
        base, power = a, a
        for _ in range(b.constant.bit_length() - 1):
            power = binary(w, ast.Mult(), power, power, flags)
        return binary(w, ast.Mult(), power, base, flags) if b.constant == 3 else power
    if FLOAT not in (a.type, b.type):
        raise Unsupported("a power of integers")
    x, y = (converted(w, value, FLOAT).leaves[0] for value in (a, b))
    return Value(FLOAT, (w.new(f"call double @llvm.pow.f64(double {x}, double {y})"),))


def compared(w: Writer, op: ast.cmpop, a: Value, b: Value) -> Value:
    """a op b: true or false."""
    ordered, signed, plain = _COMPARED[type(op)]
    if a.is_constant and b.is_constant:
        return number(bool(plain(a.constant, b.constant)))
    of = joined(a.type, b.type)
    [x], [y] = converted(w, a, of).leaves, converted(w, b, of).leaves
    if of == FLOAT:
        return Value(BOOL, (w.new(f"fcmp {ordered} double {x}, {y}"),))
    unsigned = of in (UINT, BOOL) and signed[0] == "s"
    test = "u" + signed[1:] if unsigned else signed
    return Value(BOOL, (w.new(f"icmp {test} {of.leaves[0]} {x}, {y}"),))


def negative(w: Writer, value: Value, flags: str = "") -> Value:
    """−value."""
    if value.is_constant and not isinstance(value.constant, bool):
        return number(-value.constant)
    if value.type == FLOAT:
        return Value(FLOAT, (w.new(f"fneg {flags}double {value.leaves[0]}"),))
    [operand] = converted(w, value, INT).leaves
    return Value(INT, (w.new(f"sub i64 0, {operand}"),))


def absolute(w: Writer, value: Value) -> Value:
    """|value|."""
    if value.type == FLOAT:
        return function(w, "llvm.fabs.f64", value)
    [x], [minus] = value.leaves, negative(w, value).leaves
    below = w.new(f"icmp slt i64 {x}, 0")
    return Value(INT, (w.new(f"select i1 {below}, i64 {minus}, i64 {x}"),), natural=True)


def function(w: Writer, name: str, value: Value) -> Value:
    """A function of one float."""
    [operand] = converted(w, value, FLOAT).leaves
    return Value(FLOAT, (w.new(f"call double @{name}(double {operand})"),))


def chosen(w: Writer, op: ast.cmpop, a: Value, b: Value) -> Value:
    """``max`` (with ``>``) or ``min`` (with ``<``): b where it is the one, else a."""
    of = joined(a.type, b.type)
    a, b = converted(w, a, of), converted(w, b, of)
    [take] = compared(w, op, b, a).leaves
    [leaf] = of.leaves
    natural = (a.natural and b.natural) or (isinstance(op, ast.Gt) and (a.natural or b.natural))
    text = f"select i1 {take}, {leaf} {b.leaves[0]}, {leaf} {a.leaves[0]}"
    return Value(of, (w.new(text),), natural=natural)
