"""What the verbs do alike that estimate over recorded drives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clutchest.cli.terminal import meanwhile
from clutchest.progress import Progress

if TYPE_CHECKING:
    from clutchest.estimate.run import Run


def estimated(
    logs: list[str],
    vehicle: str,
    start: str | None,
    stop: str | None,
    state: Path | None,
    show: Progress,
    *,
    rate: float = 10.0,
    smooth: bool = False,
    engine: str = "kernel",
    traffic: bool = False,
) -> Run:
    """The estimates over ``logs`` from ``start`` to ``stop``, carried on from ``state``.

    Raises ClutchestError that names the file in which something is wrong.
    """
    from clutchest.errors import ClutchestError
    from clutchest.estimate.initial_state import StateError
    from clutchest.estimate.replay import replay
    from clutchest.reading import read_log
    from clutchest.reading.window import TimeWindow
    from clutchest.record.files import read_state
    from clutchest.vehicle import load_vehicle

    car = load_vehicle(vehicle)
    before = None if state is None else read_state(state)
    show("reading", None)
    signals = read_log(logs, car, TimeWindow.parse(start, stop), traffic=traffic)
    meanwhile("clutchest.record.rerun")  # not earlier: two that import only take turns
    try:
        return replay(
            signals,
            car,
            rate=rate,
            state=before,
            smooth=smooth,
            engine=engine,
            progress=show,
        )
    except StateError as problem:
        raise ClutchestError(f"{state}: {problem}") from None
