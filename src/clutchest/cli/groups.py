"""Options of a verb in groups: frozen dataclasses whose fields are options of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def grouped(verb: Callable[..., None]) -> Callable[..., None]:
    """The same verb for the command line, where each field of its groups is an option.

    Options are listed in the order of parameters and fields.
    """
    hints = get_type_hints(verb, include_extras=True)
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    options: list[Parameter] = []
    for parameter in signature(verb).parameters.values():
        if parameter.name in groups:
            options += _options(groups[parameter.name])
        else:
            own = parameter.replace(annotation=hints[parameter.name], kind=Parameter.KEYWORD_ONLY)
            options.append(own)

    @wraps(verb)
    def command(**given: Any) -> None:
        verb(**_gathered(given, groups))

    command.__signature__ = Signature(options)  # type: ignore[attr-defined]
    command.__annotations__ = {option.name: option.annotation for option in options}
    return command


def _options(group: Any) -> list[Parameter]:
    """Each field of a group as a parameter of its own."""
    hints = get_type_hints(group, include_extras=True)
    return [
        Parameter(f.name, Parameter.KEYWORD_ONLY, default=_default(f), annotation=hints[f.name])
        for f in fields(group)
    ]


def _default(field: Field) -> Any:
    return Parameter.empty if field.default is MISSING else field.default


def _gathered(given: Mapping[str, Any], groups: Mapping[str, Any]) -> dict[str, Any]:
    """The values ``given`` for options as the arguments of a verb."""
    members = {name: [f.name for f in fields(group)] for name, group in groups.items()}
    inside = {member for names in members.values() for member in names}
    values = {name: value for name, value in given.items() if name not in inside}
    for name, group in groups.items():
        values[name] = group(**{member: given[member] for member in members[name]})
    return values
