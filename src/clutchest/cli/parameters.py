"""Arguments and options of a verb: its annotated parameters as those of a Click command."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from inspect import Parameter, signature
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints

import click


@dataclass(frozen=True, slots=True)
class Argument:
    """What stands in ``Annotated`` beside the type of a positional argument, or of several."""

    metavar: str
    help: str


@dataclass(frozen=True, slots=True)
class Option:
    """The same of an option, named like its parameter unless ``names`` are given.

    ``check`` sees the value before the verb runs, and gives back what the verb is handed.
    """

    help: str
    names: tuple[str, ...] = ()
    metavar: str | None = None
    check: Callable[[Any], Any] | None = None
    least: int | None = None
    most: int | None = None


class Positional(click.Argument):
    """An argument, and the ``words`` that the help has for it."""

    def __init__(self, name: str, words: str, **how: Any) -> None:
        super().__init__([name], **how)
        self.words = words

    def make_metavar(self, ctx: click.Context) -> str:
        """See :meth:`click.Parameter.make_metavar`."""
        return f"{self.metavar}..." if self.nargs == -1 else str(self.metavar)


class Number(click.types.FloatParamType):
    """A number, called so where the value is none."""

    name = "number"


class WholeNumber(click.IntRange):
    """A whole number, likewise."""

    name = "whole number"


def parameters_of(verb: Callable[..., None]) -> list[click.Parameter]:
    """The parameters of a verb, in their order, for a command."""
    hints = get_type_hints(verb, include_extras=True)
    return [_parameter(p, hints[p.name]) for p in signature(verb).parameters.values()]


def _parameter(parameter: Parameter, hint: Any) -> click.Parameter:
    """A parameter with its ``hint``, ``Annotated`` with an Argument or an Option."""
    kind, declared = get_args(hint)
    if NoneType in get_args(kind):
        (kind,) = (one for one in get_args(kind) if one is not NoneType)
    several = get_origin(kind) is list
    each = get_args(kind)[0] if several else kind
    if isinstance(declared, Argument):
        return Positional(
            parameter.name,
            declared.help,
            type=_type(each),
            metavar=declared.metavar,
            nargs=-1 if several else 1,
            required=True,
            callback=_handed(list if several else None),
        )
    assert isinstance(declared, Option)
    default = None if several else parameter.default
    how = {"required": True} if default is Parameter.empty else {"default": default}
    return click.Option(
        [parameter.name, *(declared.names or [f"--{parameter.name.replace('_', '-')}"])],
        type=None if each is bool else _type(each, declared.least, declared.most),
        is_flag=each is bool or None,
        multiple=several,
        show_default=default not in (Parameter.empty, None, ""),
        metavar=declared.metavar,
        help=declared.help,
        callback=_handed(_some if several else declared.check),
        **how,
    )


def _type(kind: Any, least: int | None = None, most: int | None = None) -> Any:
    """Click's type for values of a ``kind``."""
    if kind is Path:
        return click.Path(path_type=Path)
    if issubclass(kind, Enum):
        return click.Choice(kind)
    if kind is float:
        return Number()
    return kind if least is None else WholeNumber(least, most)


def _some(values: tuple[Any, ...]) -> list[Any] | None:
    """None where the option was not given."""
    return list(values) or None


def _handed(check: Callable[[Any], Any] | None) -> Callable[..., Any] | None:
    """A ``check`` as Click calls it."""
    return None if check is None else lambda context, parameter, value: check(value)
