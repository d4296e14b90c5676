"""Whether a user's class declares what an effect is made of."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from pathlib import Path

from clutchest.errors import ClutchestError
from clutchest.models.effects.effect import Effect, Number

_KINDS: Mapping[str, tuple[type, str]] = {
    "name": (str, "a text"),
    "model": (str, "a text"),
    "equation": (str, "a text"),
    "parameters": (tuple, "a tuple of clutchest.machine.Number"),
    "states": (tuple, "a tuple of clutchest.machine.State"),
    "scales": (Mapping, "a mapping of a quantity to a parameter"),
    "delays": (Mapping, "a mapping of a signal to a parameter"),
    "lateness": (Mapping, "a mapping of a signal to a Lateness"),
    "wording": (Mapping, "a mapping of a parameter to a Wording"),
}
_NUMBERS = ("lower", "upper", "default", "healthy")


def made(kind: type[Effect], path: Path) -> Effect:
    """The effect of a class in the file at ``path``.

    Raises ClutchestError naming file, class and what is not declared as it must be.
    """
    try:
        effect = kind()
    except Exception as error:  # the user's code may raise anything
        raise ClutchestError(f"{path}: class {kind.__name__} cannot be made: {error}") from None
    for name, (expected, words) in _KINDS.items():
        if not isinstance(getattr(effect, name, None), expected):
            raise ClutchestError(f"{path}: class {kind.__name__}: expected {words} as '{name}'")
    for number in effect.parameters:
        if not _sound(number):
            raise ClutchestError(
                f"{path}: class {kind.__name__}: expected every parameter as "
                "Number(key, unit, lower, upper), with numbers as bounds"
            )
    keys = [number.key for number in effect.parameters]
    for use in ("scales", "delays"):
        for key in getattr(effect, use).values():
            if key not in keys:
                raise ClutchestError(
                    f"{path}: class {kind.__name__}: '{use}' names the parameter {key!r}, "
                    f"expected one of {', '.join(keys)}"
                )
    return effect


def _sound(number: object) -> bool:
    if not isinstance(number, Number):
        return False
    values = [getattr(number, name) for name in _NUMBERS]
    return (
        isinstance(number.key, str)
        and isinstance(number.unit, str)
        and all(isinstance(v, int | float) and not isnan(v) for v in values)
    )
