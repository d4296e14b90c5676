"""The settings of a live session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.checked import checked_fields
from clutchest.errors import ClutchestError
from clutchest.monitor.events import Watcher
from clutchest.progress import Progress

if TYPE_CHECKING:
    import can

SLOWEST, FASTEST = 0.1, 100.0  # Hz, of the estimates


@checked_fields
@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """How a :class:`~clutchest.monitor.monitor.Monitor` runs.

    ``out`` is the folder for ``received.log``, ``estimates.parquet``, ``events.jsonl``,
    ``recording.rrd`` and ``state.json``; nothing is written without.  ``rate`` Hz of the estimates;
    ``state`` as an earlier run left it; ``serve`` the ports of data and page of a live viewer,
    reachable from this machine only; ``reopen`` opens a new bus where an interface has disappeared;
    ``watchers`` receive all data of every drive.
    """

    out: str | Path | None = None
    rate: float = 10.0
    state: Mapping[str, Any] | None = None
    serve: tuple[int, int] | None = None
    reopen: Callable[[], can.BusABC] | None = None
    watchers: tuple[Watcher, ...] = ()
    progress: Progress | None = None

    def __post_init__(self) -> None:
        if not SLOWEST <= self.rate <= FASTEST:
            raise ClutchestError(f"rate {self.rate:g} Hz: expected {SLOWEST:g} to {FASTEST:g}")
