"""How long work says what it does."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float | None], None]  # (what is done now, share of it so far or None)


def silent(text: str, share: float | None) -> None:
    """Says nothing."""
