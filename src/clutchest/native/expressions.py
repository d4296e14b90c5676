"""Translating Python expressions."""

from __future__ import annotations

import ast
import builtins
import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from clutchest.native import arithmetic, arrays, library
from clutchest.native.arrays import Index, Slice
from clutchest.native.source import Source
from clutchest.native.types import (
    BOOL,
    FLOAT,
    INT,
    NOTHING,
    UINT,
    Array,
    Record,
    Struct,
    Tuple,
    Type,
    Unsupported,
    joined,
)
from clutchest.native.writer import NONE, UNKNOWN, Value, Writer, number

_CASTS: dict[Any, Type] = {
    int: INT,
    float: FLOAT,
    bool: BOOL,
    np.int64: INT,
    np.intp: INT,
    np.uint64: UINT,
    np.float64: FLOAT,
}


class ModuleInProgress(Protocol):
    """What a function needs of the module that it becomes part of."""

    def call(self, w: Writer, function: Source, arguments: Sequence[Value]) -> Value:
        """The result of a call."""

    def array(self, value: np.ndarray) -> Value:
        """An array that is frozen into the code."""

    def function(self, name: str) -> str:
        """A function of one float, of LLVM or of the C library."""

    def allocate(self, w: Writer, dtype: str | Struct, sizes: Sequence[str]) -> Value:
        """A new array, of zeros."""


class ExpressionTranslator:
    """Translates the expressions of one function."""

    def __init__(self, module: ModuleInProgress, names: dict[str, Any], flags: str) -> None:
        self.module, self.names, self.flags = module, names, flags
        self.w = Writer()
        self.known: dict[str, Value] = {}  # assigned once, so that they need no memory
        self.types: dict[str, Type] = {}
        self.slots: dict[str, tuple[str, ...]] = {}
        self.natural: frozenset[str] = frozenset()

    def value(self, node: ast.expr) -> Value:
        """What an expression gives."""
        translate: Callable[[Any], Value] | None
        translate = getattr(self, f"_{type(node).__name__.lower()}", None)
        if translate is None:
            raise Unsupported(type(node).__name__)
        return translate(node)

    def condition(self, node: ast.expr) -> Value:
        """Whether an expression is true."""
        return arithmetic.truth(self.w, self.value(node))

    def convert(self, value: Value, to: Type) -> Value:
        """A value as another type."""
        if value.type == to:
            return value
        if isinstance(to, Array) and isinstance(value.type, Array):
            return arrays.unpacked(self.w, value)
        if isinstance(to, Tuple) and isinstance(value.type, Tuple):
            return together([*map(self.convert, items(value), to.items)])
        return arithmetic.converted(self.w, value, to)

    # --- names and constants ---

    def _constant(self, node: ast.Constant) -> Value:
        return self.constant(node.value)

    def constant(self, value: Any) -> Value:
        """A Python object that is known already."""
        if isinstance(value, (bool, np.bool_)):
            return number(bool(value))
        if isinstance(value, np.uint64):
            return Value(UINT, (str(value),), UNKNOWN, True)
        if isinstance(value, (int, np.integer)):
            return number(int(value))
        if isinstance(value, (float, np.floating)):
            return number(float(value))
        if isinstance(value, np.ndarray):
            return self.module.array(value)
        if isinstance(value, tuple):
            return together([*map(self.constant, value)])
        return Value(NOTHING, (), value)

    def _name(self, node: ast.Name) -> Value:
        name = node.id
        if name in self.known:
            return self.known[name]
        if name in self.types:
            return self.w.load(self.types[name], self.slots[name], name in self.natural)
        if name in self.names:
            return self.constant(self.names[name])
        if hasattr(builtins, name):
            return self.constant(getattr(builtins, name))
        raise Unsupported(f"'{name}' is used before it has a value")

    def _attribute(self, node: ast.Attribute) -> Value:
        owner = self.value(node.value)
        if isinstance(owner.type, Record):
            first = 0
            for name, of in owner.type.fields:
                if name == node.attr:
                    return Value(of, owner.leaves[first : first + len(of.leaves)])
                first += len(of.leaves)
        elif isinstance(owner.type, Struct):
            return arrays.field(self.w, owner, node.attr)
        elif isinstance(owner.type, Array) and node.attr == "shape":
            return together([Value(INT, (n,), natural=True) for n in arrays.shape(owner)])
        elif owner.constant is not UNKNOWN and hasattr(owner.constant, node.attr):
            return self.constant(getattr(owner.constant, node.attr))
        raise Unsupported(f"'.{node.attr}' of {owner.type}")

    # --- operations ---

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        return arithmetic.binary(self.w, node.op, left, right, self.flags)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            value = self.condition(node.operand)
            if value.is_constant:
                return number(not value.constant)
            return Value(BOOL, (self.w.new(f"xor i1 {value.leaves[0]}, true"),))
        value = self.value(node.operand)
        if isinstance(node.op, ast.USub):
            return arithmetic.negative(self.w, value, self.flags)
        if isinstance(node.op, ast.Invert) and value.type in (INT, UINT):
            return Value(value.type, (self.w.new(f"xor i64 {value.leaves[0]}, -1"),))
        raise Unsupported(type(node.op).__name__)

    def _compare(self, node: ast.Compare) -> Value:
        left, result = self.value(node.left), None
        for op, comparator in zip(node.ops, node.comparators, strict=True):
            right = self.value(comparator)
            if isinstance(op, (ast.In, ast.NotIn)):
                tests = [arithmetic.compared(self.w, ast.Eq(), left, item) for item in items(right)]
                test = self._all(tests, "or")
                if isinstance(op, ast.NotIn):
                    test = Value(BOOL, (self.w.new(f"xor i1 {test.leaves[0]}, true"),))
            else:
                test = arithmetic.compared(self.w, op, left, right)
            result = test if result is None else self._all([result, test], "and")
            left = right
        assert result is not None
        return result

    def _all(self, tests: list[Value], how: str) -> Value:
        """Several conditions, all of which may be looked at."""
        result = tests[0]
        for test in tests[1:]:
            result = Value(BOOL, (self.w.new(f"{how} i1 {result.leaves[0]}, {test.leaves[0]}"),))
        return result

    def _boolop(self, node: ast.BoolOp) -> Value:
        """What stands behind is looked at only where it matters."""
        w, stops = self.w, isinstance(node.op, ast.Or)
        [slot], end = w.memory(BOOL), w.label()
        for i, part in enumerate(node.values):
            value = self.condition(part)
            if value.is_constant and i == 0:
                rest = node.values[1:]
                if value.constant == stops:
                    return value
                return self.condition(rest[0] if len(rest) == 1 else ast.BoolOp(node.op, rest))
            w.store(value, (slot,))
            if i + 1 < len(node.values):
                on = w.label()
                w.branch(value.leaves[0], *((end, on) if stops else (on, end)))
                w.begin(on)
        w.jump(end)
        w.begin(end)
        return w.load(BOOL, (slot,))

    def _ifexp(self, node: ast.IfExp) -> Value:
        w, test = self.w, self.condition(node.test)
        if test.is_constant:
            return self.value(node.body if test.constant else node.orelse)
        yes, no, end = w.label(), w.label(), w.label()
        w.branch(test.leaves[0], yes, no)
        w.begin(yes)
        a, after_a = self.value(node.body), w.block
        w.begin(no)
        b, after_b = self.value(node.orelse), w.block
        of = joined(a.type, b.type)
        slots = w.memory(of)
        for value, block in ((a, after_a), (b, after_b)):
            w.block = block
            w.store(self.convert(value, of), slots)
            w.jump(end)
        w.begin(end)
        return w.load(of, slots, a.natural and b.natural)

    def _tuple(self, node: ast.Tuple) -> Value:
        return together([*map(self.value, node.elts)])

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.value(node.value)
        if isinstance(owner.type, Tuple):
            place = self.value(node.slice)
            if type(place.constant) is not int:
                raise Unsupported("an index of a tuple that is not known")
            return items(owner)[place.constant]
        if not isinstance(owner.type, Array):
            raise Unsupported(f"an index of {owner.type}")
        return arrays.element(self.w, owner, self.indices(node.slice))

    def indices(self, node: ast.expr) -> list[Index]:
        """What stands in brackets behind an array."""
        result: list[Index] = []
        for part in node.elts if isinstance(node, ast.Tuple) else [node]:
            if isinstance(part, ast.Slice):
                if part.step is not None:
                    raise Unsupported("a slice with a step")
                bounds = (part.lower, part.upper)
                result.append(Slice(*(None if b is None else self.value(b) for b in bounds)))
            else:
                result.append(self.value(part))
        return result

    # --- calls ---

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "copy" and not node.args:
            return self._copy(self.value(node.func.value))
        function = self.value(node.func).constant
        arguments = [self.value(a) for a in node.args]
        if source := getattr(function, "source", None):
            if node.keywords:
                raise Unsupported("arguments by name")
            return self.module.call(self.w, source, arguments)
        if function in (np.zeros, np.empty, np.full):
            return self._new_array(function, arguments)
        if function is np.empty_like:
            of = arguments[0].type
            assert isinstance(of, Array)
            return self.module.allocate(self.w, of.dtype, arrays.shape(arguments[0]))
        if function is np.searchsorted:
            sides = [
                word.value.value for word in node.keywords if isinstance(word.value, ast.Constant)
            ]
            name = "searchsorted_right" if sides == ["right"] else "searchsorted"
            return self.module.call(self.w, library.SOURCES[name], arguments)
        if node.keywords:
            raise Unsupported("arguments by name")
        return self._builtin(function, arguments)

    def _builtin(self, function: Any, given: list[Value]) -> Value:
        """A function of Python or numpy."""
        if function in arithmetic.FUNCTIONS:
            name = self.module.function(arithmetic.FUNCTIONS[function])
            return arithmetic.function(self.w, name, *given)
        if function in _CASTS:
            return self.convert(given[0], _CASTS[function])
        if function is math.ceil:
            up = arithmetic.function(self.w, self.module.function("llvm.ceil.f64"), *given)
            return self.convert(up, INT)
        if function is len:
            if isinstance(given[0].type, Tuple):
                return number(len(given[0].type.items))
            return arrays.length(given[0])
        if function is abs:
            return arithmetic.absolute(self.w, given[0])
        if function in (min, max):
            best, op = given[0], ast.Gt() if function is max else ast.Lt()
            for other in given[1:]:
                best = arithmetic.chosen(self.w, op, best, other)
            return best
        raise Unsupported(f"a call of {getattr(function, '__name__', function)}")

    def _new_array(self, function: Any, given: list[Value]) -> Value:
        """``np.zeros``, ``np.empty`` (zeros as well) or ``np.full``."""
        sizes = items(given[0]) if isinstance(given[0].type, Tuple) else [given[0]]
        filling = given[1] if function is np.full else None
        kind = given[2 if filling else 1].constant if len(given) > (2 if filling else 1) else None
        dtype = np.dtype(kind if kind else np.float64).str
        if filling and not kind and filling.type != FLOAT:
            dtype = {INT: "<i8", BOOL: "|b1"}[filling.type]  # type: ignore[index]
        made = self.module.allocate(self.w, dtype, [size.leaves[0] for size in sizes])
        if filling:
            arrays.store(self.w, made, [Slice(None, None)], filling)
        return made

    def _copy(self, array: Value) -> Value:
        if not isinstance(array.type, Array):
            raise Unsupported(f"a copy of {array.type}")
        made = self.module.allocate(self.w, array.type.dtype, arrays.shape(array))
        arrays.store(self.w, made, [Slice(None, None)], array)
        return made


def items(value: Value) -> list[Value]:
    """The items of a tuple."""
    if not isinstance(value.type, Tuple):
        raise Unsupported(f"items of {value.type}")
    if isinstance(value.constant, tuple):
        return list(value.constant)
    result, first = [], 0
    for of in value.type.items:
        result.append(Value(of, value.leaves[first : first + len(of.leaves)]))
        first += len(of.leaves)
    return result


def together(values: list[Value]) -> Value:
    """A tuple of values; its ``constant`` keeps what is known of each."""
    if not values:
        return NONE
    leaves = tuple(leaf for value in values for leaf in value.leaves)
    return Value(Tuple(tuple(value.type for value in values)), leaves, tuple(values))
