"""CasADi, loaded when it is first asked for something: who only reads logs does not wait for it.

``from clutchest.casadi_later import ca`` stands for ``import casadi as ca`` in what a vehicle file
loads, its machine's equations and effects.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from threading import RLock
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    import casadi as ca
else:

    class _Later:
        """Stands for the library: what is asked for once is an attribute from then on."""

        def __getattr__(self, name: str) -> Any:
            value = getattr(import_module("casadi"), name)
            setattr(self, name, value)
            return value

    ca = _Later()

Given = ParamSpec("Given")
Result = TypeVar("Result")
_working = RLock()


def one_at_a_time(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """A ``function`` that works on expressions, called by one thread at a time.

    CasADi keeps a constant once for all expressions: one thread may drop the last expression that
    has it when another has just found it, and the program ends with a segmentation fault.  Hence
    what such a function makes of numbers, by ``substitute`` say, does not leave it.
    """

    @wraps(function)
    def alone(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        with _working:
            return function(*args, **kwargs)

    return alone


__all__ = ["ca", "one_at_a_time"]
