"""Two steps of a sequence at once: the next items are made while one is used."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")


@contextmanager
def made_ahead(items: Iterator[Item], many: int = 1) -> Iterator[Iterator[Item]]:
    """The same ``items`` in the same order, to be used within: the first is begun at once, and
    further ones are made in a thread, as long as no more than ``many`` wait.  What making one
    raises is raised when it is asked for."""
    thread = ThreadPoolExecutor(1)
    try:
        coming = deque(thread.submit(next, items, None) for _ in range(many))
        yield _handed_on(items, thread, coming)
    finally:
        thread.shutdown(cancel_futures=True)


def _handed_on(
    items: Iterator[Item], thread: ThreadPoolExecutor, coming: deque[Future[Item | None]]
) -> Iterator[Item]:
    while (item := coming.popleft().result()) is not None:
        coming.append(thread.submit(next, items, None))
        yield item
