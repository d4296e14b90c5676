"""From what an MDF4 file stores to what it means.

asammdf evaluates a formula that it cannot read as arithmetic as Python, and gives texts for numbers
where a table has texts for some of them; here a formula is arithmetic or an error, and a text among
numbers is no value.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import Any
from warnings import catch_warnings

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Floats

FORMULA, LAST_NUMERIC, _TABLE, _RANGES = 3, 6, 7, 8  # cc_type; those above 6 make texts
_LONGEST = 4096  # characters of a formula
_MOST = 4096  # entries of a table of numbers and texts
_OPERATORS: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "exp": np.exp,
    "ln": np.log,
    "log": np.log,
    "log10": np.log10,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "pow": np.power,
}
_CONSTANTS = {"pi": np.pi, "inf": np.inf, "nan": np.nan}


def physical(raw: NDArray[Any], conversion: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """(values, where there is one), each (n,), of ``raw`` (n,) by a conversion of asammdf's.

    Where all entries of a table are texts, the numbers that these stand for.  Raises ValueError for
    a formula that is no arithmetic of X.
    """
    known = np.ones(len(raw), bool)
    kind = 0 if conversion is None else conversion.conversion_type
    if raw.dtype.kind not in "iufb" or raw.ndim != 1 or conversion is None:
        return raw, known
    with np.errstate(all="ignore"):
        if kind == FORMULA:
            return np.broadcast_to(evaluated(conversion.formula, raw), raw.shape), known
        if kind <= LAST_NUMERIC:
            return np.asarray(conversion.convert(raw)), known
        if kind in (_TABLE, _RANGES) and _numeric(conversion):
            return _of_table(raw, conversion, kind)
    return raw, known


def unit_of(channel: Any) -> str:
    """The unit that a channel states, or the conversion of its numbers."""
    conversion = channel.conversion
    if channel.unit or conversion is None:
        return str(channel.unit or "")
    if conversion.conversion_type in (_TABLE, _RANGES) and not conversion.unit:
        return next((str(each.unit) for each in _numeric(conversion) if each.unit), "")
    return str(conversion.unit or "")


def _numeric(conversion: Any) -> list[Any]:
    """The conversions that a table refers to, which make numbers of some of its entries."""
    blocks = conversion.referenced_blocks or {}
    return [block for block in blocks.values() if hasattr(block, "conversion_type")]


def _of_table(
    raw: NDArray[Any], conversion: Any, kind: int
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Values of a table some of whose entries are conversions, and the others texts."""
    blocks = conversion.referenced_blocks
    count = sum(name.startswith("text_") for name in blocks)
    if count > _MOST:
        raise ValueError(f"a conversion of more than {_MOST} entries")
    value, known, left = (
        np.full(len(raw), np.nan),
        np.zeros(len(raw), bool),
        np.ones(len(raw), bool),
    )
    for k in [*range(count), None]:
        here = left if k is None else left & _entry(raw, conversion, kind, k)
        block = blocks["default_addr" if k is None else f"text_{k}"]
        if hasattr(block, "conversion_type") and here.any():
            value[here], known[here] = physical(raw[here], block)
        left = left & ~here
    return value, known


def _entry(raw: NDArray[Any], conversion: Any, kind: int, k: int) -> NDArray[np.bool_]:
    """Where (n,) an entry of a table holds."""
    if kind == _TABLE:
        return np.asarray(raw == conversion[f"val_{k}"])
    above = raw <= conversion[f"upper_{k}"]
    if raw.dtype.kind == "f":
        above = raw < conversion[f"upper_{k}"]
    return np.asarray((raw >= conversion[f"lower_{k}"]) & above)


def evaluated(formula: str, x: NDArray[Any]) -> Floats:
    """The value of an arithmetic ``formula`` of X at ``x`` (n,).  Raises ValueError for another."""
    problem = ValueError(f"the formula {formula[:60]!r} is no arithmetic of X")
    if len(formula) > _LONGEST:
        raise problem
    try:
        with catch_warnings(action="ignore"):  # of its syntax
            tree = ast.parse(formula.replace("^", "**").strip(), mode="eval")
        return np.asarray(_value(tree.body, x.astype(np.float64)), np.float64)
    except (SyntaxError, TypeError, LookupError, RecursionError, MemoryError, OverflowError):
        raise problem from None
    except ValueError:
        raise problem from None


def _value(node: ast.expr, x: Floats) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.Name(id="X" | "X1" | "x" | "x1"):
            return x
        case ast.Name(id=name):
            return _CONSTANTS[name.lower()]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, x)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _value(operand, x)
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_value(left, x), _value(right, x))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _FUNCTIONS[name.lower()](*(_value(each, x) for each in arguments))
        case _:
            raise ValueError
