"""Types of compiled values, each a fixed number of machine values (*leaves*).

A number is one leaf.  An array is its data's address and its shape, followed by strides in bytes
unless it is packed (C order, no gaps); a record or tuple is the leaves of its parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np


class Unsupported(TypeError):
    """Something that this compiler does not translate; says what and where."""


@dataclass(frozen=True)
class Scalar:
    """A number: ``float`` (64 bits), ``int`` and ``uint`` (64 bits), ``bool``."""

    name: str

    @property
    def leaves(self) -> tuple[str, ...]:
        """Machine types, as LLVM names them."""
        return (_LLVM[self.name],)


_LLVM = {"float": "double", "int": "i64", "uint": "i64", "bool": "i1"}
FLOAT, INT, UINT, BOOL = (Scalar(name) for name in _LLVM)
_RANK = {BOOL: 0, INT: 1, FLOAT: 2}


@dataclass(frozen=True)
class Array:
    """An array of ``ndim`` dimensions; ``dtype`` as numpy writes it, ``<f8``, or a structure."""

    dtype: str | Struct
    ndim: int
    packed: bool

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Machine types, as LLVM names them."""
        return ("ptr", *("i64",) * (self.ndim if self.packed else 2 * self.ndim))

    @property
    def stored(self) -> str:
        """How LLVM calls one element in memory."""
        of = self.dtype
        return ELEMENTS[of].stored if isinstance(of, str) else f"[{of.size} x i8]"

    @property
    def size(self) -> int:
        """Bytes of one element."""
        return ELEMENTS[self.dtype].size if isinstance(self.dtype, str) else self.dtype.size


@dataclass(frozen=True)
class Element:
    """How a number lies in memory: its LLVM type ``stored``, ``size`` in bytes, the ``type`` that
    it is computed with, and the instructions that ``widen`` and ``narrow`` it, "" for none."""

    stored: str
    size: int
    type: Scalar
    widen: str = ""
    narrow: str = ""


ELEMENTS = {
    "<f8": Element("double", 8, FLOAT),
    "<f4": Element("float", 4, FLOAT, "fpext", "fptrunc"),
    "<i8": Element("i64", 8, INT),
    "<u8": Element("i64", 8, UINT),
    "|b1": Element("i8", 1, BOOL, "trunc", "zext"),
    "|u1": Element("i8", 1, INT, "zext", "trunc"),
    "<u2": Element("i16", 2, INT, "zext", "trunc"),
    "<u4": Element("i32", 4, INT, "zext", "trunc"),
    "|i1": Element("i8", 1, INT, "sext", "trunc"),
    "<i2": Element("i16", 2, INT, "sext", "trunc"),
    "<i4": Element("i32", 4, INT, "sext", "trunc"),
}


@dataclass(frozen=True)
class Record:
    """A NamedTuple: (name, type) of every field."""

    fields: tuple[tuple[str, Type], ...]

    @cached_property
    def parts(self) -> tuple[Type, ...]:
        """The types of the fields."""
        return tuple(of for _, of in self.fields)

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Machine types, as LLVM names them."""
        return tuple(leaf for _, of in self.fields for leaf in of.leaves)


@dataclass(frozen=True)
class Tuple:
    """A tuple; without items, what a function returns that returns nothing."""

    items: tuple[Type, ...]

    @property
    def parts(self) -> tuple[Type, ...]:
        """The types of the items."""
        return self.items

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Machine types, as LLVM names them."""
        return tuple(leaf for of in self.items for leaf in of.leaves)


@dataclass(frozen=True)
class Struct:
    """One element of a structured array, by address, ``size`` bytes: (name, dtype, offset, shape)
    of every field."""

    fields: tuple[tuple[str, str, int, tuple[int, ...]], ...]
    size: int
    leaves = ("ptr",)


Type = Scalar | Array | Record | Tuple | Struct
NOTHING = Tuple(())


def type_of(value: Any) -> Type:
    """The type of a Python value.  Raises Unsupported where there is none."""
    if isinstance(value, (bool, np.bool_)):
        return BOOL
    if isinstance(value, np.uint64):
        return UINT
    if isinstance(value, (int, np.integer)):
        return INT
    if isinstance(value, (float, np.floating)):
        return FLOAT
    if isinstance(value, np.ndarray):
        of = _structure(value.dtype) if value.dtype.fields else value.dtype.str
        if (value.dtype.fields or of in ELEMENTS) and value.flags.aligned:
            return Array(of, value.ndim, value.flags.c_contiguous)
        raise Unsupported(f"an array of {value.dtype}, {value.ndim}-dimensional")
    if isinstance(value, np.void) and value.dtype.fields:
        return _structure(value.dtype)
    if isinstance(value, tuple):
        if names := getattr(value, "_fields", None):
            return Record(tuple(zip(names, map(type_of, value), strict=True)))
        return Tuple(tuple(map(type_of, value)))
    raise Unsupported(f"a value of {type(value).__name__}")


def _structure(dtype: np.dtype[Any]) -> Struct:
    """A structure of numbers and arrays of numbers."""
    fields = []
    for name in dtype.names or ():
        of, offset = dtype.fields[name][:2]  # type: ignore[index]
        if of.base.str not in ELEMENTS or offset % of.base.itemsize:
            raise Unsupported(f"field '{name}', {of}, {offset} bytes from the beginning")
        fields.append((name, of.base.str, offset, of.shape))
    return Struct(tuple(fields), dtype.itemsize)


def joined(a: Type, b: Type) -> Type:
    """The type that holds both.  Raises Unsupported where there is none."""
    if a == b:
        return a
    if isinstance(a, Scalar) and isinstance(b, Scalar) and a in _RANK and b in _RANK:
        return max(a, b, key=_RANK.__getitem__)
    if isinstance(a, Array) and isinstance(b, Array) and (a.dtype, a.ndim) == (b.dtype, b.ndim):
        return Array(a.dtype, a.ndim, False)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return Tuple(tuple(map(joined, a.items, b.items)))
    raise Unsupported(f"either {a} or {b}")


def encoded(of: Type) -> Any:
    """A type of results as plain tuples, which :func:`decoded` reads again."""
    if isinstance(of, Scalar):
        return of.name
    if isinstance(of, Array):
        return ("array", of.dtype, of.ndim, of.packed)
    if isinstance(of, Tuple):
        return ("tuple", *map(encoded, of.items))
    raise Unsupported(f"a result {of}")


def decoded(text: Any) -> Type:
    """The type that :func:`encoded` has written."""
    if isinstance(text, str):
        return Scalar(text)
    kind, *rest = text
    return Array(*rest) if kind == "array" else Tuple(tuple(map(decoded, rest)))
