"""What is shared among the cores of a machine: whole fits, portions of curves, or the two halves
of a run; what is shared already is shared no further.

Compiled kernels and linear algebra let go of the interpreter, so threads serve: nothing is copied,
and results are those of one after another.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

MOST = 4  # threads: beyond, what holds the interpreter decides
ENTRIES = 9e6  # of derivatives that a problem and its fits may hold together
FEWEST = 4000  # events of a run that is worth two threads
_thread = threading.local()  # ``shares``: whether it is one of several that share work


def shared(
    function: Callable[[Task], Result], tasks: Iterable[Task], most: int = MOST
) -> list[Result]:
    """``function`` of every task, in the order of the tasks, ``most`` at once; a single one may
    share its own work."""
    tasks = list(tasks)
    if (count := min(cores(), most, len(tasks))) <= 1 or getattr(_thread, "shares", False):
        return [function(task) for task in tasks]
    with ThreadPoolExecutor(count, initializer=_mark) as pool:
        return list(pool.map(function, tasks))


def _mark() -> None:
    _thread.shares = True


def fits_at_once(entries: int, held: int) -> int:
    """How many fits may run at the same time that hold so many ``entries`` of derivatives each,
    beside what is ``held`` anyway."""
    return min(cores(), max(int((ENTRIES - held) / max(entries, 1)), 1))


def halved(events: int) -> bool:
    """Whether a run of so many events, with derivatives, is made in two halves side by side."""
    return events >= FEWEST and cores() > 1 and not getattr(_thread, "shares", False)


def cores() -> int:
    """Those that this process may use, as far as they serve."""
    known = hasattr(os, "sched_getaffinity")
    return min(len(os.sched_getaffinity(0)) if known else os.cpu_count() or 1, MOST)
