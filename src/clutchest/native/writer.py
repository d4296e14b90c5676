"""Writing the text of one LLVM function: values, blocks, memory for variables."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

from clutchest.native.types import BOOL, FLOAT, INT, NOTHING, Type


class _Nothing:
    """Stands for "no constant", since None may be one."""


UNKNOWN = _Nothing()


@dataclass(frozen=True, slots=True)
class Value:
    """A value while a function is translated: its ``leaves`` as LLVM operands.

    ``constant``: the Python object, where it is known already (a number, an array, a function;
    what is no number has no leaves).  ``natural``: an integer that cannot be negative.
    """

    type: Type
    leaves: tuple[str, ...]
    constant: Any = UNKNOWN
    natural: bool = False

    @property
    def is_constant(self) -> bool:
        """Whether it is a number that is known already."""
        return isinstance(self.constant, (int, float))


NONE = Value(NOTHING, ())


def number(value: Any) -> Value:
    """A constant number."""
    if isinstance(value, bool):
        return Value(BOOL, ("true" if value else "false",), value)
    if isinstance(value, int):
        return Value(INT, (str(value),), value, value >= 0)
    return Value(FLOAT, (float_text(value),), value)


def float_text(value: float) -> str:
    """A float as LLVM reads it, to the last bit."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


@dataclass
class Writer:
    """The blocks of one function; lines go to the ``block`` at hand."""

    count: int = 0
    allocas: list[str] = field(default_factory=list)
    blocks: list[list[str]] = field(default_factory=lambda: [[]])
    block: list[str] = field(init=False)

    def __post_init__(self) -> None:
        self.block = self.blocks[0]

    def line(self, text: str) -> None:
        """One instruction without a result."""
        self.block.append(text)

    def new(self, text: str) -> str:
        """One instruction; its result."""
        self.count += 1
        name = f"%v{self.count}"
        self.block.append(f"{name} = {text}")
        return name

    def label(self) -> str:
        """A name for a block to come."""
        self.count += 1
        return f"b{self.count}"

    def begin(self, label: str) -> None:
        """Begin the block ``label``."""
        self.block = [f"{label}:"]
        self.blocks.append(self.block)

    def jump(self, label: str) -> None:
        """Go on at ``label``."""
        self.line(f"br label %{label}")

    def branch(self, condition: str, yes: str, no: str) -> None:
        """Go on at one of two labels."""
        self.line(f"br i1 {condition}, label %{yes}, label %{no}")

    def memory(self, of: Type) -> tuple[str, ...]:
        """Memory for a variable, one address a leaf."""
        slots = []
        for leaf in of.leaves:
            self.count += 1
            self.allocas.append(f"%m{self.count} = alloca {leaf}")
            slots.append(f"%m{self.count}")
        return tuple(slots)

    def store(self, value: Value, slots: tuple[str, ...]) -> None:
        """A value into a variable's memory."""
        for leaf, operand, slot in zip(value.type.leaves, value.leaves, slots, strict=True):
            self.line(f"store {leaf} {operand}, ptr {slot}")

    def load(self, of: Type, slots: tuple[str, ...], natural: bool = False) -> Value:
        """A variable's value."""
        leaves = (
            self.new(f"load {leaf}, ptr {slot}")
            for leaf, slot in zip(of.leaves, slots, strict=True)
        )
        return Value(of, tuple(leaves), natural=natural)

    def text(self) -> str:
        """The body of the function."""
        lines = [*self.allocas]
        for block in self.blocks:
            lines.extend(block)
        return "\n".join(lines)
