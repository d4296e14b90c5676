"""The same decorator by numba: for other platforms, and to be compared with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from clutchest.native.source import GENERATED


def compiled(
    function: Callable[..., Any] | None = None,
    *,
    contract: bool = False,
    inline: bool = False,
    apart: bool = False,
    straight: bool = False,
) -> Any:
    """As :func:`clutchest.native.dispatch.compiled`; numba finds out itself what lies apart, and
    searches everything."""
    from numba import njit

    def made(function: Callable[..., Any]) -> Any:
        # numba keeps an old answer when a function in another file changes: only what lies in one
        # generated file is kept on disk
        kept = function.__module__.startswith(GENERATED)
        return njit(
            cache=kept,
            error_model="numpy",
            nogil=True,
            fastmath={"contract"} if contract else False,
            inline="always" if inline else "never",
        )(function)

    return made(function) if function else made
