"""Calls from Python at the cost of a function in C.

One small function in machine code, the same for every compiled function, is what Python calls.
It follows a *program*: for every argument the type that it must have, and the slot of the table
(see ``LlvmModule.entry``) that its value belongs in.  Where an argument is of another type it does
nothing and answers ``NotImplemented``, so that the caller takes the longer way of ``dispatch``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import lru_cache
from hashlib import sha256
from itertools import count
from typing import Any

import numpy as np

from clutchest.cache import recalled, remember
from clutchest.native import engine
from clutchest.native.types import BOOL, FLOAT, INT, UINT, Array, Record, Scalar, Tuple, Type

_API = (  # of CPython, in the order of the program's words from FIRST on
    "PyEval_SaveThread",
    "PyEval_RestoreThread",
    "Py_IncRef",
    "PyErr_Occurred",
    "PyLong_AsLongLong",
    "PyFloat_FromDouble",
    "PyLong_FromLongLong",
    "PyLong_FromUnsignedLongLong",
    "PyBool_FromLong",
    "PyTuple_New",
    "PyTuple_SetItem",
)
_HEAD = ("code", "arguments", "objects", "slots", "operations", "results", "form", "other", "none")
_WORD = {name: i for i, name in enumerate((*_HEAD, *_API))}
_ARRAY, _TUPLE, _NUMBER, _INTEGER, _TRUTH = range(5)  # what an operation does with an argument
_NOTHING, _ONE, _SEVERAL = range(3)  # forms of a result
_NUMBERS = {FLOAT: 5, INT: 6, UINT: 7, BOOL: 8}  # of a result: which of _API makes the object
_AS_THEY_LIE = (float, np.float64, np.int64, np.uint64)  # objects whose value is their first word
_OBJECT = engine.OBJECT_HEAD  # bytes before what is an object's own
_ITEMS, _BYTES = tuple.__basicsize__, bytes.__basicsize__ - 1  # before its content
_FASTCALL = 0x80
_MOST = 4096  # objects and slots of a call; more would ask for too much of the stack


class _Method(ctypes.Structure):
    """CPython's PyMethodDef."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("text", ctypes.c_char_p),
    ]


_kept: list[Any] = []  # what builtin functions and their programs point to


def directly(
    arguments: Sequence[Any], types: Sequence[Type], returns: Type, code: int
) -> Callable[..., Any] | None:
    """A builtin that calls the machine code at ``code`` with arguments like these; None where some
    of them, or what it returns, take the longer way."""
    made = _program(arguments, types, returns, code)
    if made is None:
        return None
    words, pointed = made
    program = np.array(words, np.uint64).tobytes()  # is kept alive as the builtin's ``__self__``
    method = _Method(b"compiled", _caller(), _FASTCALL, None)
    _kept.append((method, pointed))
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.restype, new.argtypes = (
        ctypes.py_object,
        [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p],
    )
    found: Callable[..., Any] = new(ctypes.addressof(method), program, None)
    return found


def _program(
    arguments: Sequence[Any], types: Sequence[Type], returns: Type, code: int
) -> tuple[list[int], list[Any]] | None:
    """The words that ``_TEXT`` reads, and the objects that they point to."""
    results = returns.items if isinstance(returns, Tuple) else (returns,)
    if not all(isinstance(of, Scalar) for of in results):
        return None
    objects, slots = _flat(arguments, types)
    operations: list[int] = []
    for at, (value, of) in enumerate(objects):
        done = _operation(value, of)
        if done is None:
            return None
        kind, *words = done
        operations += [kind, at, id(type(value)), *words, slots.get(at, 0)]
    used = 1 + len(slots)
    if len(objects) + used + len(results) > _MOST:
        return None
    form = _ONE if isinstance(returns, Scalar) else _SEVERAL if results else _NOTHING
    head = [code, len(arguments), len(objects), used, len(objects), len(results), form]
    api = [
        ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0 for name in _API
    ]
    kinds = [_NUMBERS[of] for of in results if isinstance(of, Scalar)]
    pointed = [(type(value), getattr(value, "dtype", None)) for value, _ in objects]
    return [*head, id(NotImplemented), id(None), *api, *kinds, *operations], pointed


def _flat(
    arguments: Sequence[Any], types: Sequence[Type]
) -> tuple[list[tuple[Any, Type]], dict[int, int]]:
    """The arguments followed by the parts of tuples, in the order in which ``_TEXT`` meets these;
    and the slot of each that is no tuple, numbered as ``dispatch`` does: a tuple's parts one after
    the other in its place."""
    objects = list(zip(arguments, types, strict=True))
    parts: dict[int, range] = {}
    for at, (value, of) in enumerate(objects):  # which grows meanwhile
        if isinstance(of, Record | Tuple):
            parts[at] = range(len(objects), len(objects) + len(of.parts))
            objects += zip(value, of.parts, strict=True)

    def leaves(at: int) -> list[int]:
        if at not in parts:
            return [at]
        return [leaf for part in parts[at] for leaf in leaves(part)]

    order = [leaf for at in range(len(arguments)) for leaf in leaves(at)]
    return objects, {leaf: slot for slot, leaf in enumerate(order, 1)}


def _operation(value: Any, of: Type) -> tuple[int, int, int] | None:
    """What is done with an argument: kind, and two words of what it must be beside its type."""
    if isinstance(of, Array):
        return _ARRAY, id(value.dtype), value.ndim | (0x101 if of.packed else 0x100) << 32
    if isinstance(of, Record | Tuple):
        return _TUPLE, len(of.parts), 0
    if type(value) in _AS_THEY_LIE:
        return _NUMBER, 0, 0
    if type(value) is int and of == INT:
        return _INTEGER, 0, 0
    return (_TRUTH, id(True), 0) if type(value) is bool else None


@lru_cache(maxsize=1)
def _caller() -> int:
    """The address of the function that follows programs."""
    name = f"direct_{sha256((_TEXT + engine.platform()).encode()).hexdigest()[:32]}"
    code = recalled(name)
    if code is None:
        code = engine.machine_code(_TEXT)
        remember(name, code)
    return engine.address(code)


@lru_cache(maxsize=1)
def lies_as_believed() -> bool:
    """Whether tuples, numbers and arrays lie in memory as ``_TEXT`` reads them."""
    pair, array = (1.5, object()), np.zeros((2, 3))
    word = ctypes.c_uint64.from_address
    return (
        [word(id(pair) + _ITEMS + 8 * i).value for i in range(2)] == [id(item) for item in pair]
        and word(id(pair) + _OBJECT - 8).value == id(tuple)
        and word(id(pair) + _OBJECT).value == 2
        and all(
            type(of).from_address(id(value) + _OBJECT).value == value
            for value, of in ((1.5, ctypes.c_double()), (np.float64(2.5), ctypes.c_double()))
        )
        and word(id(array) + _OBJECT + 40).value == id(array.dtype)
        and ctypes.c_int32.from_address(id(array) + _OBJECT + 8).value == 2
        and ctypes.c_int32.from_address(id(array) + _OBJECT + 48).value & 0x101 == 0x101
        and ctypes.string_at(id(b"program") + _BYTES, 7) == b"program"
    )


_addresses = count()  # every address in the text has a number of its own


def _load(of: str, base: str, offset: int, into: str) -> str:
    """Two instructions: ``into`` = what lies ``offset`` bytes behind ``base``."""
    at = f"%p{next(_addresses)}"
    return f"{at} = getelementptr i8, ptr {base}, i64 {offset}\n{into} = load {of}, ptr {at}"


def _word(name: str, of: str, into: str) -> str:
    """The same for a word of the program."""
    return _load(of, "%program", 8 * _WORD[name], into)


_TEXT = f"""
define ptr @entry(ptr %self, ptr %args, i64 %given) nounwind {{
start:
%program = getelementptr i8, ptr %self, i64 {_BYTES}
{_word("arguments", "i64", "%arguments")}
%fits = icmp eq i64 %given, %arguments
br i1 %fits, label %begin, label %other
begin:
{_word("objects", "i64", "%many")}
{_word("slots", "i64", "%slots")}
{_word("operations", "i64", "%operations")}
{_word("results", "i64", "%results")}
%objects = alloca ptr, i64 %many
%size = add i64 %slots, %results
%table = alloca i64, i64 %size
%bytes = mul i64 %arguments, 8
call void @llvm.memcpy.p0.p0.i64(ptr %objects, ptr %args, i64 %bytes, i1 false)
%kinds = getelementptr i64, ptr %program, i64 {len(_WORD)}
%first = getelementptr i64, ptr %kinds, i64 %results
%seen = alloca i64
store i64 %arguments, ptr %seen
br label %next
next:
%i = phi i64 [0, %begin], [%after, %done]
%more = icmp ult i64 %i, %operations
br i1 %more, label %one, label %call
one:
%at = mul i64 %i, 6
%operation = getelementptr i64, ptr %first, i64 %at
{_load("i64", "%operation", 0, "%kind")}
{_load("i64", "%operation", 8, "%which")}
{_load("i64", "%operation", 16, "%type")}
{_load("i64", "%operation", 24, "%first_word")}
{_load("i64", "%operation", 32, "%second_word")}
{_load("i64", "%operation", 40, "%slot")}
%place = getelementptr ptr, ptr %objects, i64 %which
%object = load ptr, ptr %place
%to = getelementptr i64, ptr %table, i64 %slot
{_load("i64", "%object", _OBJECT - 8, "%its")}
%same = icmp eq i64 %its, %type
br i1 %same, label %typed, label %other
typed:
switch i64 %kind, label %other [
i64 {_ARRAY}, label %array
i64 {_TUPLE}, label %tuple
i64 {_NUMBER}, label %number
i64 {_INTEGER}, label %integer
i64 {_TRUTH}, label %truth ]
array:
{_load("i64", "%object", _OBJECT + 40, "%description")}
{_load("i32", "%object", _OBJECT + 8, "%dimensions")}
{_load("i32", "%object", _OBJECT + 48, "%flags")}
%described = icmp eq i64 %description, %first_word
%layout = and i32 %flags, 257
%wide = zext i32 %layout to i64
%high = shl i64 %wide, 32
%low = zext i32 %dimensions to i64
%both = or i64 %high, %low
%laid = icmp eq i64 %both, %second_word
%good = and i1 %described, %laid
%address = ptrtoint ptr %object to i64
store i64 %address, ptr %to
br i1 %good, label %done, label %other
tuple:
{_load("i64", "%object", _OBJECT, "%length")}
%long = icmp eq i64 %length, %first_word
br i1 %long, label %append, label %other
append:
%parts = getelementptr i8, ptr %object, i64 {_ITEMS}
%end = load i64, ptr %seen
%tail = getelementptr ptr, ptr %objects, i64 %end
%room = mul i64 %length, 8
call void @llvm.memcpy.p0.p0.i64(ptr %tail, ptr %parts, i64 %room, i1 false)
%longer = add i64 %end, %length
store i64 %longer, ptr %seen
br label %done
number:
{_load("i64", "%object", _OBJECT, "%value")}
store i64 %value, ptr %to
br label %done
integer:
{_word("PyLong_AsLongLong", "ptr", "%asked")}
%integral = call i64 %asked(ptr %object)
store i64 %integral, ptr %to
%suspect = icmp eq i64 %integral, -1
br i1 %suspect, label %ask, label %done
ask:
{_word("PyErr_Occurred", "ptr", "%occurred")}
%error = call ptr %occurred()
%failed = icmp ne ptr %error, null
br i1 %failed, label %raise, label %done
raise:
ret ptr null
truth:
%whether = ptrtoint ptr %object to i64
%true = icmp eq i64 %whether, %first_word
%bit = zext i1 %true to i64
store i64 %bit, ptr %to
br label %done
done:
%after = add i64 %i, 1
br label %next
call:
{_word("PyEval_SaveThread", "ptr", "%save")}
{_word("PyEval_RestoreThread", "ptr", "%restore")}
{_word("code", "ptr", "%code")}
%thread = call ptr %save()
call void %code(ptr %table)
call void %restore(ptr %thread)
%answers = getelementptr i64, ptr %table, i64 %slots
{_word("form", "i64", "%form")}
switch i64 %form, label %single [
i64 {_NOTHING}, label %nothing
i64 {_SEVERAL}, label %several ]
nothing:
{_word("none", "ptr", "%none")}
br label %singleton
other:
%programs = getelementptr i8, ptr %self, i64 {_BYTES}
{_load("ptr", "%programs", 8 * _WORD["other"], "%unlike")}
br label %singleton
singleton:
%known = phi ptr [%none, %nothing], [%unlike, %other]
%api = getelementptr i8, ptr %self, i64 {_BYTES}
{_load("ptr", "%api", 8 * _WORD["Py_IncRef"], "%increase")}
call void %increase(ptr %known)
ret ptr %known
single:
%only = call ptr @made(ptr %program, ptr %kinds, ptr %answers)
ret ptr %only
several:
{_word("PyTuple_New", "ptr", "%new")}
{_word("PyTuple_SetItem", "ptr", "%set")}
%all = call ptr %new(i64 %results)
%lacking = icmp eq ptr %all, null
br i1 %lacking, label %raise, label %fill
fill:
%k = phi i64 [0, %several], [%then, %filled]
%left = icmp ult i64 %k, %results
br i1 %left, label %filled, label %whole
filled:
%sort = getelementptr i64, ptr %kinds, i64 %k
%answer = getelementptr i64, ptr %answers, i64 %k
%item = call ptr @made(ptr %program, ptr %sort, ptr %answer)
%status = call i32 %set(ptr %all, i64 %k, ptr %item)
%then = add i64 %k, 1
br label %fill
whole:
ret ptr %all
}}
define internal ptr @made(ptr %program, ptr %kind, ptr %answer) nounwind {{
%which = load i64, ptr %kind
%offset = add i64 %which, {len(_HEAD)}
%place = getelementptr ptr, ptr %program, i64 %offset
%maker = load ptr, ptr %place
%fraction = icmp eq i64 %which, {_NUMBERS[FLOAT]}
%truth = icmp eq i64 %which, {_NUMBERS[BOOL]}
br i1 %fraction, label %real, label %whole
real:
%number = load double, ptr %answer
%float = call ptr %maker(double %number)
ret ptr %float
whole:
%integer = load i64, ptr %answer
br i1 %truth, label %bool, label %int
int:
%long = call ptr %maker(i64 %integer)
ret ptr %long
bool:
%short = trunc i64 %integer to i32
%bit = call ptr %maker(i32 %short)
ret ptr %bit
}}
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
"""
