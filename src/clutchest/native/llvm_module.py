"""One LLVM module: a compiled function for given types, with everything that it calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from clutchest.native import engine
from clutchest.native.source import Source
from clutchest.native.statements import FunctionTranslator
from clutchest.native.types import Array, Record, Struct, Tuple, Type, Unsupported
from clutchest.native.writer import Value, Writer

_ALLOCATOR = """@allocator = internal global ptr null
define internal ptr @allocate(i64 %bytes) {
  %f = load ptr, ptr @allocator
  %p = call ptr %f(i64 %bytes)
  ret ptr %p
}"""


@dataclass(frozen=True, slots=True)
class Instance:
    """A function for given types: its ``symbol``, and what it ``returns``."""

    symbol: str
    returns: Type


@dataclass
class LlvmModule:
    """The text of one module as it grows."""

    instances: dict[tuple[int, tuple[Type, ...]], Instance | None] = field(default_factory=dict)
    arrays: dict[int, tuple[np.ndarray, Value]] = field(default_factory=dict)
    declared: set[str] = field(default_factory=lambda: {"llvm.pow.f64", "llvm.fabs.f64"})
    texts: list[str] = field(default_factory=list)
    allocates: bool = False

    def call(self, w: Writer, function: Source, arguments: Sequence[Value]) -> Value:
        """The result of a call."""
        made = self.instance(function, tuple(argument.type for argument in arguments))
        given = ", ".join(
            f"{leaf} {operand}"
            for argument in arguments
            for leaf, operand in zip(argument.type.leaves, argument.leaves, strict=True)
        )
        return called(w, made, given)

    def instance(self, function: Source, types: tuple[Type, ...]) -> Instance:
        """A function for these types, translated where it has not been."""
        key = (id(function), types)
        if key not in self.instances:
            self.instances[key] = None
            self.instances[key] = self._translated(function, types)
        made = self.instances[key]
        if made is None:
            raise Unsupported(f"'{function.name}' calls itself")
        return made

    def _translated(self, function: Source, types: tuple[Type, ...]) -> Instance:
        """Translates until the types of all variables are known."""
        node, names = function.definition(), function.names
        apart = " noalias" if function.apart else ""
        arguments, parameters = [], []
        for i, of in enumerate(types):
            leaves = tuple(f"%a{i}.{k}" for k in range(len(of.leaves)))
            parameters += [
                f"{leaf}{apart if leaf == 'ptr' else ''} {operand}"
                for leaf, operand in zip(of.leaves, leaves, strict=True)
            ]
            arguments.append(Value(of, leaves))
        known: dict[str, Type] = {}
        returns: Type | None = None
        flags = "contract " if function.contract else ""
        while True:
            body = FunctionTranslator(self, names, flags, known, returns)
            try:
                body.function(node, arguments)
            except Unsupported as error:
                raise located(error, function) from None
            if not body.changed:
                break
            known, returns = body.types, body.returns
        assert body.returns is not None
        made = Instance(f"{function.name}.{len(self.texts)}", body.returns)
        attributes = "alwaysinline " if function.inline else ""
        attributes += "noinline noimplicitfloat " if function.straight else ""
        head = f"define internal {returned(made.returns)} @{made.symbol}({', '.join(parameters)})"
        self.texts.append(f"{head} {attributes}nounwind {{\n{body.w.text()}\n}}")
        return made

    def array(self, value: np.ndarray) -> Value:
        """An array that is frozen into the code."""
        if id(value) not in self.arrays:
            data = np.ascontiguousarray(value)
            of = Array(data.dtype.str, data.ndim, True)
            name = f"@constant.{len(self.arrays)}"
            text = "".join(f"\\{byte:02x}" for byte in data.tobytes())
            content = f'[{data.nbytes} x i8] c"{text}"' if text else "[0 x i8] zeroinitializer"
            self.texts.append(f"{name} = internal constant {content}, align 16")
            frozen = Value(of, (name, *map(str, data.shape)))
            self.arrays[id(value)] = (value, frozen)
        return self.arrays[id(value)][1]

    def function(self, name: str) -> str:
        """A function of one float, of LLVM or of the C library."""
        self.declared.add(name)
        return name

    def allocate(self, w: Writer, dtype: str | Struct, sizes: Sequence[str]) -> Value:
        """A new array, of zeros."""
        self.allocates = True
        of = Array(dtype, len(sizes), True)
        bytes_ = str(of.size)
        for size in sizes:
            bytes_ = w.new(f"mul i64 {bytes_}, {size}")
        return Value(of, (w.new(f"call ptr @allocate(i64 {bytes_})"), *sizes))

    def entry(self, function: Source, types: tuple[Type, ...]) -> tuple[str, Type]:
        """The text of the module, with a function ``entry`` that takes a table of 8-byte slots
        (where to get memory, the leaves of all arguments, room for those of the result); and what
        it returns."""
        made, w = self.instance(function, types), Writer()
        slots = [slot for of in types for slot in slots_of(of)]
        handed = [_slot(w, i + 1, slot) for i, slot in enumerate(slots)]
        leaves = [leaf for of in types for leaf in of.leaves]
        operands = [operand for of in types for operand in _unpacked(w, of, handed)]
        if self.allocates:
            w.line(f"store ptr {_slot(w, 0, 'ptr')}, ptr @allocator")
        result = called(w, made, ", ".join(map(" ".join, zip(leaves, operands, strict=True))))
        for i, (leaf, operand) in enumerate(zip(made.returns.leaves, result.leaves, strict=True)):
            at = w.new(f"getelementptr i64, ptr %table, i64 {1 + len(slots) + i}")
            if leaf == "i1":
                leaf, operand = "i64", w.new(f"zext i1 {operand} to i64")
            w.line(f"store {leaf} {operand}, ptr {at}")
        arity = {"llvm.pow.f64": 2}
        declared = [
            f"declare double @{name}({', '.join(['double'] * arity.get(name, 1))}) nounwind"
            for name in sorted(self.declared)
        ]
        body = f"define void @entry(ptr %table) nounwind {{\n{w.text()}\nret void\n}}"
        declared.append("declare void @llvm.assume(i1)")
        parts = [*declared, *([_ALLOCATOR] if self.allocates else []), *self.texts, body]
        return "\n".join(parts), made.returns


def called(w: Writer, made: Instance, given: str) -> Value:
    """A call with arguments that are written out."""
    of, text = made.returns, f"call {returned(made.returns)} @{made.symbol}({given})"
    if not of.leaves:
        w.line(text)
        return Value(of, ())
    result = w.new(text)
    if len(of.leaves) == 1:
        return Value(of, (result,))
    whole = returned(of)
    parts = (w.new(f"extractvalue {whole} {result}, {i}") for i in range(len(of.leaves)))
    return Value(of, tuple(parts))


def returned(of: Type) -> str:
    """The machine type of a result."""
    if not of.leaves:
        return "void"
    return of.leaves[0] if len(of.leaves) == 1 else "{ " + ", ".join(of.leaves) + " }"


def slots_of(of: Type) -> tuple[str, ...]:
    """The slots in which the entry is handed an argument: its leaves, but an array's is the address
    of numpy's object, which is quicker than to ask it for address, shape and strides."""
    if isinstance(of, Array):
        return ("ptr",)
    if isinstance(of, Record | Tuple):
        return tuple(slot for part in of.parts for slot in slots_of(part))
    return of.leaves


def _unpacked(w: Writer, of: Type, handed: list[str]) -> list[str]:
    """The leaves of an argument from what was handed over, which is taken off the list."""
    if isinstance(of, Record | Tuple):
        return [leaf for part in of.parts for leaf in _unpacked(w, part, handed)]
    first = handed.pop(0)
    if not isinstance(of, Array):
        return [first]
    begin = engine.OBJECT_HEAD
    data, sizes, steps = (_pointer(w, first, begin + at) for at in (0, 16, 24))
    numbers = [(sizes, i) for i in range(of.ndim)]
    numbers += [] if of.packed else [(steps, i) for i in range(of.ndim)]
    return [data, *(w.new(f"load i64, ptr {_at(w, of_, 8 * i)}") for of_, i in numbers)]


def _at(w: Writer, address: str, offset: int) -> str:
    return w.new(f"getelementptr i8, ptr {address}, i64 {offset}")


def _pointer(w: Writer, address: str, offset: int) -> str:
    return w.new(f"load ptr, ptr {_at(w, address, offset)}")


def _slot(w: Writer, i: int, leaf: str) -> str:
    at = w.new(f"getelementptr i64, ptr %table, i64 {i}")
    if leaf == "i1":
        return w.new(f"trunc i64 {w.new(f'load i64, ptr {at}')} to i1")
    return w.new(f"load {leaf}, ptr {at}")


def located(error: Unsupported, function: Source) -> Unsupported:
    """The error with the function and line in which it was met first."""
    if getattr(error, "placed", False):
        return error
    line, code = getattr(error, "line", 0), function.code
    refusal = Unsupported(f"{code.co_filename}:{line}: in '{function.name}': {error}")
    refusal.placed = True  # type: ignore[attr-defined]
    return refusal
