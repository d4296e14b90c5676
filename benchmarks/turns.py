"""Two ways of doing the same, timed in turns."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from statistics import median


def with_byte_code() -> dict[str, str]:
    """The environment in which Python keeps its byte code, as a user has it."""
    return {name: v for name, v in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def in_turns(what: str, ways: Mapping[str, Callable[[], float]], turns: int, unit: str) -> str:
    """A line: the median cost of the two ``ways``, and the first over the second, formed within
    each turn, with its range."""
    names = list(ways)
    pairs = [[way() for way in ways.values()] for _ in range(turns)]
    ratios = sorted(first / second for first, second in pairs)
    costs = (
        f"{n} {median(c):.2f}{unit}" for n, c in zip(names, zip(*pairs, strict=True), strict=True)
    )
    return (
        f"{what}: {', '.join(costs)}; {names[0]} / {names[1]} {median(ratios):.2f} "
        f"({ratios[0]:.2f} … {ratios[-1]:.2f})"
    )
