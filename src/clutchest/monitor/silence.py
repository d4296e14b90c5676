"""Gaps of a drive's signals and of its bus: reported when they are noticed, and when they end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from clutchest.can.frames import Frames
from clutchest.estimate.drive import Piece
from clutchest.models.thresholds import Thresholds
from clutchest.signals import LOST
from clutchest.vehicle import Vehicle


class Silence:
    """Detects gaps of signals that can be bridged for a short time only, and of the whole bus."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._gap = Thresholds.of(vehicle.modes).gap
        fast = {i.name for i in vehicle.machine.inputs if i.gap <= self._gap}
        fast.add(vehicle.machine.equations(vehicle.signals).anchor)
        self._names = [name for name in vehicle.signals if name in fast]
        self._last: dict[str, float] = {}
        self._bus = 0.0
        self._silent = False

    def of(
        self, frames: Frames, piece: Piece | None, now: float
    ) -> Iterator[tuple[float, str, Mapping[str, Any]]]:
        """(time, name, data) of every gap that begins to matter or ends."""
        if len(frames):
            if self._silent:
                yield now, "bus", {"over": True, "duration_s": now - self._bus}
            self._bus, self._silent = now, False
        elif not self._silent and now - self._bus > self._gap:
            self._silent = True
            yield now, "bus", {"over": False, "since_s": self._bus}
        for name in self._names if piece else ():
            signal = piece.signals.get(name) if piece else None
            if signal is None or not len(times := signal.time[signal.valid]):
                continue
            edges = [self._last.get(name, float(times[0])), *times.tolist()]
            for a, b in pairwise(edges):
                if b - a > self._gap:
                    yield (
                        b,
                        name,
                        {"over": True, "since_s": a, "duration_s": b - a, "bridged": b - a <= LOST},
                    )
            self._last[name] = float(times[-1])
