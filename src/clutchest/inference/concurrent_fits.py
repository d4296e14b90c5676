"""Fits that do not depend on one another, on as many cores as memory allows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from clutchest.inference.cores import fits_at_once
from clutchest.inference.problem import Problem

Task = TypeVar("Task")
Result = TypeVar("Result")


def concurrently(
    problem: Problem, fit: Callable[[Task], Result], tasks: Iterable[Task]
) -> list[Result]:
    """``fit`` of every task, in the order of the tasks."""
    readings = sum(len(drive.readings.t) for drive in problem.drives)
    if (count := fits_at_once(readings * len(problem.thetas))) == 1:
        return [fit(task) for task in tasks]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(fit, tasks))
