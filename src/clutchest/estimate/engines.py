"""The filters that a drive can be estimated with; they agree."""

from __future__ import annotations

from typing import Protocol

from clutchest.compute.records import Belief
from clutchest.errors import ClutchestError, nearest
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import CONSIDERING, Compiled, Filtered, run
from clutchest.patient_loading import in_compiled_code
from clutchest.progress import Progress
from clutchest.signals import Floats

KERNEL, FILTERPY = ENGINES = ("kernel", "filterpy")


class Filter(Protocol):
    """A filter of one timeline, whose gains take the parameters' spreads into account."""

    def __call__(
        self,
        compiled: Compiled,
        timeline: Timeline,
        start: Belief,
        *,
        gained: Floats | None = None,
        progress: Progress | None = None,
    ) -> Filtered:
        """As :func:`clutchest.estimate.whole_log.run`."""
        ...


def run_kernel(
    compiled: Compiled,
    timeline: Timeline,
    start: Belief,
    *,
    gained: Floats | None = None,
    progress: Progress | None = None,
) -> Filtered:
    """The compiled kernel."""
    with in_compiled_code():
        return run(compiled, timeline, start, CONSIDERING, gained=gained, progress=progress)


def filter_of(engine: str) -> Filter:
    """The filter of that name; raises ClutchestError for another than ``ENGINES``."""
    if engine == KERNEL:
        return run_kernel
    if engine == FILTERPY:
        from clutchest.estimate.filterpy_engine import run_filterpy

        return run_filterpy
    raise ClutchestError(f"unknown engine '{engine}'" + nearest(engine, ENGINES))
