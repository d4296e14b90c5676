"""Curves of which derivatives are held in memory at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol, TypeVar

from clutchest.inference.cores import cores
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

ENTRIES = 8e6  # of derivatives, held at a time


class Knotted(Protocol):
    """A curve with knots ``at`` (c)."""

    @property
    def at(self) -> Floats:
        """Where it may bend."""


Table = TypeVar("Table", bound=Knotted)


def held(fit: Linearisation) -> int:
    """How many derivatives of all readings memory holds at a time."""
    return max(int(ENTRIES / max(len(fit.r), 1)), cores())


def portions(tables: Sequence[Table], most: int) -> Iterator[list[Table]]:
    """As many curves at a time as have no more than ``most`` columns, one at least."""
    some: list[Table] = []
    for table in tables:
        if some and sum(len(t.at) for t in some) + len(table.at) > most:
            yield some
            some = []
        some.append(table)
    if some:
        yield some
