"""Fits that do not depend on one another, on as many cores as memory allows.

Compiled kernels and linear algebra let go of the interpreter, so threads serve: nothing is copied,
and results are those of one after another.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from clutchest.inference.problem import Problem

Task = TypeVar("Task")
Result = TypeVar("Result")

MOST = 4  # threads: beyond, what holds the interpreter decides
ENTRIES = 7e6  # of derivatives that fits may hold together


def threads(problem: Problem) -> int:
    """How many fits of this size may run at the same time."""
    readings = sum(len(drive.readings.t) for drive in problem.drives)
    held = max(int(ENTRIES / max(readings * len(problem.thetas), 1)), 1)
    return min(_cores(), MOST, held)


def concurrently(
    problem: Problem, fit: Callable[[Task], Result], tasks: Iterable[Task]
) -> list[Result]:
    """``fit`` of every task, in the order of the tasks."""
    if (count := threads(problem)) == 1:
        return [fit(task) for task in tasks]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(fit, tasks))


def _cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
