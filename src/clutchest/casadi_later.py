"""CasADi, loaded when it is first asked for something: who only reads logs does not wait for it.

``from clutchest.casadi_later import ca`` stands for ``import casadi as ca`` in what a vehicle file
loads, its machine's equations and effects.
"""

from __future__ import annotations

from importlib import import_module
from threading import RLock
from typing import TYPE_CHECKING, Any

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

symbolic = RLock()  # held by a thread that works on expressions which others may work on, too

__all__ = ["ca", "symbolic"]
