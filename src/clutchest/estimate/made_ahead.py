"""Two steps of a sequence at once: the next item is made while one is used."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from clutchest.patient_loading import at_work

Item = TypeVar("Item")


@contextmanager
def made_ahead(items: Iterator[Item]) -> Iterator[Iterator[Item]]:
    """The same ``items`` in the same order, to be used within: the first is begun at once, each
    further one is made in a thread while the one before it is used.  What making one raises is
    raised when it is asked for."""
    with ThreadPoolExecutor(1) as thread, at_work():
        yield _handed_on(items, thread, thread.submit(_made, items))


def _handed_on(
    items: Iterator[Item], thread: ThreadPoolExecutor, coming: Future[Item | None]
) -> Iterator[Item]:
    while (item := coming.result()) is not None:
        coming = thread.submit(_made, items)
        yield item


def _made(items: Iterator[Item]) -> Item | None:
    with at_work():
        return next(items, None)
