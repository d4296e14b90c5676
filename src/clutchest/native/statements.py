"""Translating Python statements: the body of one function for given types of its arguments."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Sequence
from typing import Any

from clutchest.native import arithmetic, arrays
from clutchest.native.expressions import ExpressionTranslator, ModuleInProgress, items
from clutchest.native.types import (
    INT,
    NOTHING,
    Array,
    Record,
    Struct,
    Tuple,
    Type,
    Unsupported,
    joined,
)
from clutchest.native.writer import NONE, Value, number


class FunctionTranslator(ExpressionTranslator):
    """Translates one function.

    A variable has one type, which holds everything that is assigned to it.  Where a later
    assignment widens it, ``changed`` says so, and the function has to be translated anew with the
    ``types`` that are known then.
    """

    def __init__(
        self,
        module: ModuleInProgress,
        names: dict[str, Any],
        flags: str,
        types: dict[str, Type],
        returns: Type | None,
    ) -> None:
        super().__init__(module, names, flags)
        self.types, self.returns = dict(types), returns
        self.slots = {name: self.w.memory(of) for name, of in types.items()}
        self.changed = False
        self.once: frozenset[str] = frozenset()
        self.loops: list[tuple[str, str]] = []  # where continue and break go
        self.ended = False  # nothing behind is reached

    def function(self, node: ast.FunctionDef, arguments: Sequence[Value]) -> None:
        """The whole of it."""
        parts = list(ast.walk(node))
        stored = _stored(parts)
        if not any(isinstance(part, (ast.For, ast.While, ast.If)) for part in parts):
            self.once = frozenset(name for name, count in stored.items() if count == 1)
        self.natural = _natural(node, parts, stored, self.names)
        for argument, value in zip(node.args.args, arguments, strict=True):
            if argument.arg in stored:
                self.once -= {argument.arg}
                self.assign(argument.arg, value)
            else:
                self.known[argument.arg] = value
        self.block(node.body)
        if not self.ended:
            self._give(NONE)

    def block(self, body: list[ast.stmt]) -> None:
        """FunctionTranslator, one after the other."""
        for statement in body:
            if self.ended:
                return
            translate = getattr(self, f"_{type(statement).__name__.lower()}", None)
            try:
                if translate is None:
                    raise Unsupported(type(statement).__name__)
                translate(statement)
            except Unsupported as error:
                if not hasattr(error, "line"):
                    error.line = statement.lineno  # type: ignore[attr-defined]
                raise

    # --- assignments ---

    def assign(self, name: str, value: Value) -> None:
        """Give a variable a value."""
        if name in self.once:
            self.known[name] = value
            return
        before = self.types.get(name)
        of = value.type if before is None else joined(before, value.type)
        if of != before:
            self.changed |= before is not None
            self.types[name], self.slots[name] = of, self.w.memory(of)
        self.w.store(self.convert(value, of), self.slots[name])

    def _target(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.assign(target.id, value)
        elif isinstance(target, ast.Tuple):
            for part, item in zip(target.elts, items(value), strict=True):
                self._target(part, item)
        elif isinstance(target, ast.Subscript):
            owner = self.value(target.value)
            if not isinstance(owner.type, Array):
                raise Unsupported(f"an item of {owner.type} is set")
            places = self.indices(target.slice)
            if isinstance(value.type, Tuple):  # into a row, one by one
                row = arrays.element(self.w, owner, places)
                for i, item in enumerate(items(value)):
                    arrays.store(self.w, row, [number(i)], item)
            else:
                arrays.store(self.w, owner, places, value)
        elif isinstance(target, ast.Attribute):
            owner = self.value(target.value)
            if not isinstance(owner.type, Struct):
                raise Unsupported(f"'.{target.attr}' of {owner.type} is set")
            arrays.store_field(self.w, owner, target.attr, value)
        else:
            raise Unsupported(f"{type(target).__name__} is assigned to")

    def _assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self._target(target, value)

    def _annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._target(node.target, self.value(node.value))

    def _augassign(self, node: ast.AugAssign) -> None:
        before = self.value(node.target)
        change = self.value(node.value)
        self._target(node.target, arithmetic.binary(self.w, node.op, before, change, self.flags))

    # --- the rest ---

    def _expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):  # a docstring
            self.value(node.value)

    def _pass(self, node: ast.Pass) -> None:
        pass

    def _assert(self, node: ast.Assert) -> None:
        """Is taken for granted: of rows whose length is known, code is better."""
        self.w.line(f"call void @llvm.assume(i1 {self.condition(node.test).leaves[0]})")

    def _return(self, node: ast.Return) -> None:
        self._give(NONE if node.value is None else self.value(node.value))

    def _give(self, value: Value) -> None:
        if value.constant is None:  # ``return None``
            value = NONE
        of = value.type if self.returns is None else joined(self.returns, value.type)
        self.changed |= self.returns is not None and of != self.returns
        self.returns = of
        value, leaves = self.convert(value, of), of.leaves
        if not leaves:
            self.w.line("ret void")
        elif len(leaves) == 1:
            self.w.line(f"ret {leaves[0]} {value.leaves[0]}")
        else:
            whole, result = "{ " + ", ".join(leaves) + " }", "undef"
            for i, (leaf, operand) in enumerate(zip(leaves, value.leaves, strict=True)):
                result = self.w.new(f"insertvalue {whole} {result}, {leaf} {operand}, {i}")
            self.w.line(f"ret {whole} {result}")
        self.ended = True

    def _continue(self, node: ast.Continue) -> None:
        self.w.jump(self.loops[-1][0])
        self.ended = True

    def _break(self, node: ast.Break) -> None:
        self.w.jump(self.loops[-1][1])
        self.ended = True

    def _if(self, node: ast.If) -> None:
        w, test = self.w, self.condition(node.test)
        if test.is_constant:
            self.block(node.body if test.constant else node.orelse)
            return
        yes, no, end = w.label(), w.label(), w.label()
        w.branch(test.leaves[0], yes, no)
        ends = []
        for label, body in ((yes, node.body), (no, node.orelse)):
            w.begin(label)
            self.block(body)
            if not self.ended:
                w.jump(end)
            ends.append(self.ended)
            self.ended = False
        if all(ends):
            self.ended = True
        else:
            w.begin(end)

    def _while(self, node: ast.While) -> None:
        w = self.w
        head, inside, end = w.label(), w.label(), w.label()
        w.jump(head)
        w.begin(head)
        test = self.condition(node.test)
        w.branch(test.leaves[0], inside, end)
        w.begin(inside)
        self._looped(node.body, head, end)
        w.begin(end)
        breaks = any(isinstance(part, ast.Break) for part in ast.walk(node))
        if test.constant is True and not breaks:  # only a return leaves it
            w.line("unreachable")
            self.ended = True

    def _looped(self, body: list[ast.stmt], on: str, end: str) -> None:
        """The body of a loop, which goes on at ``on``."""
        self.loops.append((on, end))
        self.block(body)
        self.loops.pop()
        if not self.ended:
            self.w.jump(on)
        self.ended = False

    def _for(self, node: ast.For) -> None:
        if node.orelse:
            raise Unsupported("for … else")
        source = node.iter
        if isinstance(source, ast.Call) and isinstance(source.func, ast.Name):
            name = source.func.id
            if name == "range":
                self._counted(node, [self.value(a) for a in source.args])
                return
            if name == "enumerate":
                self._along(node, self.value(source.args[0]), True)
                return
        self._along(node, self.value(source), False)

    def _counted(self, node: ast.For, bounds: list[Value]) -> None:
        """``for i in range(…)``."""
        if not isinstance(node.target, ast.Name):
            raise Unsupported("a range into several names")
        numbers = [self.convert(bound, INT) for bound in bounds]
        start = "0" if len(bounds) == 1 else numbers[0].leaves[0]
        stop = numbers[min(len(bounds) - 1, 1)].leaves[0]
        step = 1 if len(bounds) < 3 else bounds[2].constant
        if type(step) is not int or step == 0:
            raise Unsupported("a range with a step that is not known")
        self._loop(node, start, stop, step, False)

    def _loop(self, node: ast.For, start: str, stop: str, step: int, along: Any) -> None:
        """A loop over integers, or over what stands there in an array."""
        w = self.w
        [counter] = w.memory(INT)
        head, inside, on, end = w.label(), w.label(), w.label(), w.label()
        w.line(f"store i64 {start}, ptr {counter}")
        w.jump(head)
        w.begin(head)
        i = w.new(f"load i64, ptr {counter}")
        w.branch(w.new(f"icmp {'slt' if step > 0 else 'sgt'} i64 {i}, {stop}"), inside, end)
        w.begin(inside)
        place = Value(INT, (i,), natural=True)
        if along is False:
            self._target(node.target, place)
        else:
            array, numbered = along
            item = arrays.element(w, array, [place])
            if numbered:
                assert isinstance(node.target, ast.Tuple)
                first, second = node.target.elts
                self._target(first, place)
                self._target(second, item)
            else:
                self._target(node.target, item)
        self._looped(node.body, on, end)
        w.begin(on)
        w.line(f"store i64 {w.new(f'add i64 {i}, {step}')}, ptr {counter}")
        w.jump(head)
        w.begin(end)

    def _along(self, node: ast.For, source: Value, numbered: bool) -> None:
        """``for x in array``, ``for x in (a, b, c)``."""
        if isinstance(source.type, Array):
            stop = arrays.length(source).leaves[0]
            self._loop(node, "0", stop, 1, (source, numbered))
            return
        if numbered or isinstance(source.type, Record) or source.type == NOTHING:
            raise Unsupported(f"a loop over {source.type}")
        w, end = self.w, self.w.label()
        for item in items(source):
            on = w.label()
            self._target(node.target, item)
            self._looped(node.body, on, end)
            w.begin(on)
        w.jump(end)
        w.begin(end)


def _stored(parts: Sequence[ast.AST]) -> Counter[str]:
    """How often every name is assigned to."""
    return Counter(
        part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
    )


def _natural(
    node: ast.FunctionDef,
    parts: Sequence[ast.AST],
    stored: Counter[str],
    names: dict[str, Any],
) -> frozenset[str]:
    """Names that only loops over rising ranges from 0 or more assign to."""
    counters: Counter[str] = Counter()
    loops = [
        (part.target.id, part.iter.args)
        for part in parts
        if isinstance(part, ast.For)
        and isinstance(part.target, ast.Name)
        and isinstance(part.iter, ast.Call)
        and isinstance(part.iter.func, ast.Name)
        and part.iter.func.id == "range"
    ]
    found: set[str] = set()
    given = {argument.arg for argument in node.args.args}
    for name, bounds in loops:  # outer loops come first
        if name in given:
            continue
        if len(bounds) == 1 or (len(bounds) == 2 and _is_natural(bounds[0], found, names)):
            counters[name] += 1
            if counters[name] == stored[name]:
                found.add(name)
    return frozenset(found)


def _is_natural(node: ast.expr, found: set[str], names: dict[str, Any]) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) is int and node.value >= 0
    if isinstance(node, ast.Name):
        value = names.get(node.id)
        return node.id in found or (type(value) is int and value >= 0)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _is_natural(node.left, found, names) and _is_natural(node.right, found, names)
    return False
