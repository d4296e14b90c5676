"""What the verbs do alike that estimate over recorded drives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.cli.options import SourceOptions, WindowOptions
from clutchest.cli.terminal import meanwhile
from clutchest.extras import installed
from clutchest.progress import Progress

if TYPE_CHECKING:
    from clutchest.estimate.run import Run


def estimated(
    source: SourceOptions,
    window: WindowOptions,
    show: Progress,
    *,
    rate: float = 10.0,
    smooth: bool = False,
    engine: str = "kernel",
    traffic: bool = False,
) -> Run:
    """The estimates over the logs of a ``source`` within a time window.

    Raises ClutchestError that names the file in which something is wrong.
    """
    from clutchest.can.read_ahead import read_ahead
    from clutchest.errors import ClutchestError

    show("reading", None)
    with read_ahead(source.logs[0]) as begun:
        from clutchest.reading import read_log
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(source.vehicle, trust=source.trust)
        before = None if source.state is None else _state(source.state)
        meanwhile("casadi", "clutchest.estimate.replay")
        signals = read_log(source.logs, car, window.parse(), traffic=traffic, begun=begun)
    from clutchest.estimate.initial_state import StateError
    from clutchest.estimate.replay import replay

    recording = ["clutchest.record.rerun"] if installed("rerun") else []
    writers = ["pyarrow.parquet", *recording, "clutchest.record.terminal"]

    def filtering(text: str, share: float | None) -> None:
        show(text, share)
        if share is not None and writers:  # not earlier: until the filter runs, two take turns
            meanwhile(*writers)
            writers.clear()

    try:
        return replay(
            signals,
            car,
            rate=rate,
            state=before,
            smooth=smooth,
            engine=engine,
            progress=filtering,
        )
    except StateError as problem:
        raise ClutchestError(f"{source.state}: {problem}") from None


def _state(path: Path) -> dict[str, Any]:
    """What an earlier run left."""
    from clutchest.record.files import read_state

    return read_state(path)
