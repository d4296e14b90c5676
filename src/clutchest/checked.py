"""What a public function is given, compared with its own annotations before it runs."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from functools import cache, wraps
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin

from clutchest.errors import ClutchestError, nearest

P = ParamSpec("P")
T = TypeVar("T")

_WORDS = {  # type → what people call it; others are called by their name
    NoneType: "None",
    str: "a text",
    Path: "a path",
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    slice: "a slice",
    Mapping: "a mapping",
    Callable: "a function",
}
_LISTS = (tuple, list, Sequence, Iterable)
_SHORT = 40  # characters of a value that is quoted


def checked(function: Callable[P, T], *, own: tuple[str, ...] = ()) -> Callable[P, T]:
    """``function``, with a ClutchestError for what its signature does not allow.

    That is a name that no parameter has, a parameter too few or too many, and a value that is of no
    type in the parameter's annotation; each is said with what was expected.  Lists stand for tuples
    and for numbers in a row.  Not compared are ``own`` parameters, about which the function itself
    says more, and annotations with names that exist for the type checker alone.
    """

    @wraps(function)
    def call(*given: P.args, **named: P.kwargs) -> T:
        for name, value, hint in _pairs(function, given, named):
            if name not in own:
                check(name, value, hint)
        return function(*given, **named)

    return call


def check(name: str, value: Any, hint: Any) -> None:
    """Raises ClutchestError for a value of a ``name`` that is of no type in the annotation."""
    if _fits(value, hint):
        return
    for each in (hint, *get_args(hint)):
        if isinstance(value, list | tuple) and get_origin(each) in _LISTS:
            of = get_args(each)[0]
            for part in (part for part in value if not _fits(part, of)):
                words = f"expected {_words(of)} in the list, not {_shown(part, of)}"
                raise ClutchestError(f"{name}: {words}")
    raise ClutchestError(f"{name}: expected {_words(hint)}, not {_shown(value, hint)}")


def checked_fields(kind: type[T]) -> type[T]:
    """The same for what a class is made of."""
    setattr(kind, "__init__", checked(kind.__init__))  # noqa: B010 (mypy)
    return kind


def _pairs(
    function: Callable[..., Any], given: tuple[Any, ...], named: Mapping[str, Any]
) -> list[tuple[str, Any, Any]]:
    """Name, value and annotation of every argument.  Raises ClutchestError where the call does not
    fit the signature."""
    signature, hints = _signature(function)
    try:
        bound = signature.bind(*given, **named).arguments
    except TypeError as problem:
        raise ClutchestError(_misfit(function, signature, given, named, problem)) from None
    pairs = []
    for name, value in bound.items():
        kind = signature.parameters[name].kind
        if kind is inspect.Parameter.VAR_POSITIONAL:
            pairs += [(name, each, hints[name]) for each in value]
        elif kind is not inspect.Parameter.VAR_KEYWORD:
            pairs.append((name, value, hints[name]))
    return pairs


@cache
def _signature(function: Callable[..., Any]) -> tuple[inspect.Signature, dict[str, Any]]:
    """The signature, and parameter → annotation; Any where it cannot be known."""
    signature, hints = inspect.signature(function), {}
    names = getattr(inspect.unwrap(function), "__globals__", {})
    for name, parameter in signature.parameters.items():
        text = parameter.annotation
        try:
            hints[name] = eval(text, names) if isinstance(text, str) else text
        except (NameError, AttributeError):
            hints[name] = Any
        if hints[name] is inspect.Parameter.empty:
            hints[name] = Any
    return signature, hints


def _misfit(
    function: Callable[..., Any],
    signature: inspect.Signature,
    given: tuple[Any, ...],
    named: Mapping[str, Any],
    problem: TypeError,
) -> str:
    """Why a call does not fit the signature, in words."""
    of = function.__qualname__.removesuffix(".__init__").split(".")[-1]
    some = list(signature.parameters.values())
    fixed = [p for p in some if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    open_ended = any(p.kind is p.VAR_KEYWORD for p in some)
    known = [p.name for p in fixed if p.name != "self"]
    for name in named:
        if name not in known and not open_ended:
            return f"{of} has no option '{name}'{nearest(name, known[len(given) :] or known)}"
    placed = [p.name for p in fixed if p.kind is not p.KEYWORD_ONLY]
    reached = {*placed[: len(given)], *named}
    missing = [p.name for p in fixed if p.default is p.empty and p.name not in reached]
    if missing:
        return f"{of}: expected {', '.join(missing)}"
    return f"{of}: {problem}; it takes {', '.join(known)}"


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of a type that an annotation allows."""
    origin = get_origin(hint) or hint
    if origin in (Union, UnionType):
        return any(_fits(value, each) for each in get_args(hint))
    if origin in (None, NoneType):
        return value is None
    if origin in (float, int):
        number = isinstance(value, Real if origin is float else Integral)
        return number and not isinstance(value, bool)
    if origin is bool:
        return type(value).__name__ in ("bool", "bool_")  # numpy's own too
    if _is_array(origin):
        return _numeric(value)
    if origin in _LISTS:
        return _list_fits(value, origin, [each for each in get_args(hint) if each is not Ellipsis])
    return not isinstance(origin, type) or origin is Any or isinstance(value, origin)


def _list_fits(value: Any, kind: type, of: list[Any]) -> bool:
    """Whether it is a list, not one text, and of what ``of`` allows; numbers are not looked at."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        return False
    if kind is not Iterable and isinstance(value, Mapping | Set):
        return False
    if hasattr(value, "columns") or len(set(of)) != 1 or of[0] in (float, int):
        return not hasattr(value, "columns")  # a table is no list
    return not isinstance(value, list | tuple) or all(_fits(each, of[0]) for each in value)


def _is_array(origin: Any) -> bool:
    """Whether it is numpy's array, which a program that asks for help does not load."""
    return getattr(origin, "__name__", "") == "ndarray"


def _numeric(value: Any) -> bool:
    """Whether it is numbers in a row."""
    import numpy as np

    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        return False
    return array.ndim == 1 and array.dtype.kind in "biuf"


def _words(hint: Any) -> str:
    """What an annotation allows, as people call it."""
    origin = get_origin(hint) or hint
    if origin in (Union, UnionType):
        some = get_args(hint)
        words = [_words(each) for each in some if not (each is str and Path in some)]
        words = list(dict.fromkeys(words))
        return ", ".join(words[:-1]) + " or " * (len(words) > 1) + words[-1]
    if origin in _LISTS:
        return "a list"
    if _is_array(origin):
        return "numbers in a row"
    name = getattr(origin, "__name__", str(origin))
    return _WORDS.get(origin) or _one(name)


def _shown(value: Any, hint: Any) -> str:
    """What was given instead: itself if it is short, else its kind; and where in it lies what was
    expected."""
    if value is None or isinstance(value, str | bool | int | float | list | tuple | dict):
        text = repr(value)
        if len(text) <= _SHORT:
            return text
    some = (each for each in (get_args(hint) or (hint,)) if isinstance(each, type))
    kinds = tuple(each for each in some if each is not NoneType)
    inside = [
        field.name
        for field in (fields(value) if is_dataclass(value) else ())
        if kinds and isinstance(getattr(value, field.name, None), kinds)
    ]
    name = type(value).__name__
    hint_at = f", whose .{inside[0]} is one" if inside else ""
    return f"{_one(name)}{hint_at}"


def _one(name: str) -> str:
    """The name of a class with its article; a plural has none."""
    if name.endswith("s"):
        return name
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
