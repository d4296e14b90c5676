"""Fits that do not depend on one another, on as many cores as memory allows."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from clutchest.inference.cores import Result, Task, fits_at_once, shared
from clutchest.inference.problem import Problem


def concurrently(
    problem: Problem, fit: Callable[[Task], Result], tasks: Iterable[Task]
) -> list[Result]:
    """``fit`` of every task, in the order of the tasks."""
    readings = sum(len(drive.readings.t) for drive in problem.drives)
    return shared(fit, tasks, fits_at_once(readings * len(problem.thetas)))
