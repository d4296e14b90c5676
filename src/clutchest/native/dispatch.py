"""Functions that are compiled when they are called: numbers, arrays, tuples and records in and out.

A function is translated for the types of its arguments at the first call, with all that it calls.
Its machine code is kept on disk under a name that is a hash of everything it depends on: the code
of these functions, the constants that are frozen into them, types, processor, and this compiler.
"""

from __future__ import annotations

import ast
import ctypes
import hashlib
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, update_wrapper
from pathlib import Path
from types import ModuleType
from typing import Any, overload

import numpy as np

from clutchest.cache import recalled, remember
from clutchest.native import direct, engine
from clutchest.native.llvm_module import LlvmModule, slots_of
from clutchest.native.source import Source
from clutchest.native.types import (
    BOOL,
    UINT,
    Array,
    Record,
    Struct,
    Tuple,
    Type,
    Unsupported,
    decoded,
    encoded,
    type_of,
)

_FORMATS = {"double": "d", "i64": "q", "i1": "q", "ptr": "Q"}
_LAYOUT = 0x101  # numpy's flags for C order and alignment
_memory = threading.local()  # arrays that the call at hand has asked for


@ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_int64)
def _allocate(size: int) -> int:
    """Memory for an array: numpy's, which lives until the call has ended."""
    made = np.zeros(max(size, 1), np.uint8)
    _memory.arrays.append(made)
    return int(made.ctypes.data)


_ALLOCATOR = ctypes.cast(_allocate, ctypes.c_void_p).value


class CompiledFunction:
    """A function that is compiled for the types it is called with.

    ``py_func`` is the function in Python.  Calls release Python's lock.
    """

    __name__: str

    def __init__(self, source: Source) -> None:
        update_wrapper(self, source.function)
        self.py_func, self.source = source.function, source
        self._entries: dict[Any, tuple[_Entry, Callable[..., Any] | None]] = {}
        self._direct: Callable[..., Any] = _no_call  # as it was called last

    def __call__(self, *arguments: Any) -> Any:
        """Raises Unsupported for types that this compiler does not know."""
        result = self._direct(*arguments)
        return self._sought(arguments) if result is NotImplemented else result

    def _sought(self, arguments: tuple[Any, ...]) -> Any:
        """The result of the machine code for the types of these arguments."""
        key = tuple([_key(argument) for argument in arguments])
        found = self._entries.get(key)
        if found is None:
            entry = _Entry.of(self, tuple(map(type_of, arguments)))
            found = self._entries[key] = entry, entry.direct(arguments)
        entry, call = found
        self._direct = call or self._direct
        return entry(arguments)

    def __reduce__(self) -> str:
        return str(self.py_func.__qualname__)  # pickled by its name, like any function

    def __repr__(self) -> str:
        return f"<compiled {self.__name__}>"


def _no_call(*arguments: Any) -> Any:
    """What stands in where there is no direct call."""
    return NotImplemented


@overload
def compiled(function: Callable[..., Any]) -> Any: ...
@overload
def compiled(
    *, contract: bool = ..., inline: bool = ..., apart: bool = ..., straight: bool = ...
) -> Callable[..., Any]: ...
def compiled(
    function: Callable[..., Any] | None = None,
    *,
    contract: bool = False,
    inline: bool = False,
    apart: bool = False,
    straight: bool = False,
) -> Any:
    """Have a function compiled; docs/architecture.md says what it may hold."""

    def made(function: Callable[..., Any]) -> CompiledFunction:
        return CompiledFunction(Source(function, contract, inline, apart, straight))

    return made(function) if function else made


def _key(value: Any) -> Any:
    """Equal for values of the same type."""
    if isinstance(value, np.ndarray):
        return (value.dtype, value.ndim, value.flags.num & _LAYOUT)
    if isinstance(value, tuple):
        return (type(value), *[_key(item) for item in value])
    return value.dtype if isinstance(value, np.void) else type(value)


def _handed(value: Any, of: Type, into: list[Any]) -> None:
    """What the entry is handed of a Python value; arrays as objects, see ``slots_of``."""
    if isinstance(of, Array):
        into.append(id(value))
    elif isinstance(of, Record | Tuple):
        for item, kind in zip(value, of.parts, strict=True):
            _handed(item, kind, into)
    elif isinstance(of, Struct):
        into.append(value.__array_interface__["data"][0])
    else:
        into.append(_signed(int(value)) if of == UINT else value)


@dataclass(frozen=True, slots=True)
class _Entry:
    """Machine code for one set of types."""

    address: int
    function: Callable[[Any], None]
    types: tuple[Type, ...]
    returns: Type
    allocates: bool
    packing: struct.Struct
    unpacking: struct.Struct

    @classmethod
    def of(cls, function: CompiledFunction, types: tuple[Type, ...]) -> _Entry:
        """Recalled from disk, or compiled."""
        key = _digest(function, types)
        kept = recalled(f"{function.__name__}_{key}")
        if kept is None:
            module = LlvmModule()
            text, returns = module.entry(function.source, types)
            code, allocates = engine.machine_code(text), module.allocates
            head = repr((encoded(returns), allocates)).encode()
            remember(f"{function.__name__}_{key}", head + b"\n" + code)
        else:
            head, code = kept.split(b"\n", 1)
            form, allocates = ast.literal_eval(head.decode())
            returns = decoded(form)
        address = engine.address(code)
        given = "".join(_FORMATS[slot] for of in types for slot in slots_of(of))
        return cls(
            address,
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address),
            types,
            returns,
            allocates,
            struct.Struct(f"=Q{given}"),
            struct.Struct("=" + "".join(_FORMATS[leaf] for leaf in returns.leaves)),
        )

    def direct(self, arguments: tuple[Any, ...]) -> Callable[..., Any] | None:
        """The quick call for arguments like these, if there is one."""
        if self.allocates or not direct.lies_as_believed():
            return None
        return direct.directly(arguments, self.types, self.returns, self.address)

    def __call__(self, arguments: tuple[Any, ...]) -> Any:
        handed: list[Any] = [_ALLOCATOR]
        for argument, of in zip(arguments, self.types, strict=True):
            _handed(argument, of, handed)
        size = self.packing.size
        table = ctypes.create_string_buffer(size + self.unpacking.size)
        self.packing.pack_into(table, 0, *handed)
        _memory.arrays = []
        self.function(ctypes.addressof(table))
        results = list(self.unpacking.unpack_from(table, size))
        result = _result(self.returns, results) if results else None
        _memory.arrays = []
        return result


def _result(of: Type, leaves: list[Any]) -> Any:
    """The Python value of the next leaves, which are taken off the list."""
    if isinstance(of, Tuple):
        return tuple([_result(item, leaves) for item in of.items])
    if isinstance(of, Array):
        data, *rest = [leaves.pop(0) for _ in of.leaves]
        for owner in _memory.arrays:
            offset = data - owner.ctypes.data
            if 0 <= offset < len(owner):
                strides = None if of.packed else rest[of.ndim :]
                assert isinstance(of.dtype, str)
                return np.ndarray(rest[: of.ndim], of.dtype, owner, offset, strides)
        raise Unsupported("a result that is part of an argument")
    value = leaves.pop(0)
    if of == UINT:
        return int(value) % 2**64
    return bool(value) if of == BOOL else value


def _signed(value: int) -> int:
    """The integer of the same 64 bits."""
    return value - 2**64 if value >= 2**63 else value


def _digest(function: CompiledFunction, types: tuple[Type, ...]) -> str:
    """A hash of all that the machine code depends on."""
    parts = hashlib.sha256(f"{_compiler()}\n{types}".encode())
    seen: set[int] = set()
    waiting = [function]
    while waiting:
        of = waiting.pop()
        if id(of) in seen:
            continue
        seen.add(id(of))
        code, how = of.source.code, of.source.how
        parts.update(f"{of.source.name} {how} {code.co_consts!r}".encode())
        parts.update(code.co_code + repr(code.co_varnames).encode())
        for name in code.co_names:
            value = of.source.names.get(name)
            if isinstance(value, CompiledFunction):
                waiting.append(value)
                parts.update(name.encode())
            elif isinstance(value, np.ndarray):
                parts.update(f"{name} {value.dtype} {value.shape}".encode() + value.tobytes())
            else:
                parts.update(f"{name} {_told(value)}".encode())
    return parts.hexdigest()[:32]


def _told(value: Any) -> str:
    """What a name stands for, as a text that is the same in every process."""
    if isinstance(value, ModuleType):
        return value.__name__
    if callable(value):
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', '')}"
    return repr(value)


@lru_cache(maxsize=1)
def _compiler() -> str:
    """A hash of this compiler, and the platform."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    return hashlib.sha256(text.encode()).hexdigest() + engine.platform()
