"""A compiled function by numba, which knows nothing of our compiler: the reference."""

from __future__ import annotations

from collections.abc import Callable
from dis import get_instructions
from functools import cache
from types import FunctionType
from typing import Any

from numba import njit

from clutchest.native.dispatch import CompiledFunction


@cache
def by_numba(function: CompiledFunction) -> Callable[..., Any]:
    """The same function, and all that it calls, compiled by numba."""
    source = function.source
    used = {i.argval for i in get_instructions(source.code) if i.opname == "LOAD_GLOBAL"}
    names = {
        name: by_numba(value) if isinstance(value, CompiledFunction) else value
        for name, value in source.names.items()
        if name in used
    }
    plain = FunctionType(source.code, names, source.name)
    fast = {"contract"} if source.contract else False
    return njit(error_model="numpy", fastmath=fast, nogil=True)(plain)
