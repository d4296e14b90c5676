"""Fits that do not depend on one another, on as many cores as memory allows."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from clutchest.inference.cores import Result, Task, fits_at_once, shared
from clutchest.inference.problem import Problem
from clutchest.memory import give_back


def concurrently(
    problem: Problem, unknowns: int, fit: Callable[[Task], Result], tasks: Iterable[Task]
) -> list[Result]:
    """``fit`` of every task, in the order of the tasks; each holds derivatives by so many
    ``unknowns``."""
    give_back()  # of an hour, what is free in between is 100 MiB
    readings = sum(len(drive.readings.t) for drive in problem.drives)
    return shared(fit, tasks, fits_at_once(readings * unknowns, problem.entries))
