"""The figures of actuations while a drive lasts: each as soon as no later sample can change it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.estimate.drive import Piece
from clutchest.estimate.run import TrackingFigures
from clutchest.estimate.tracking import (
    APART,
    FEWEST,
    PATIENCE,
    Actuation,
    actuations,
    estimated_output,
)
from clutchest.models.declarations import OutputTracking
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle

ESTIMATED = "estimated output"  # in place of a signal that measures it
IDLE = 1.0  # s that are held while nothing is actuated
ASKED = 60.0  # s that a request may precede an actuation by


class LiveTracking:
    """Call :meth:`take` with every piece of a drive of ``vehicle``, :meth:`finish` at its end: the
    figures are those that a replay of the whole drive gives.

    Held are the samples since the last actuation whose figures are final.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._tracking = vehicle.machine.tracking
        self._noise = {name: mapped.noise for name, mapped in vehicle.signals.items()}
        self._parts: dict[str, list[Signal]] = {}

    def take(self, piece: Piece) -> Sequence[TrackingFigures]:
        """The figures that a new piece makes final."""
        tracking = self._tracking
        if tracking is None:
            return ()
        if piece.begins:
            self._parts = {}
        new = {n: piece.signals[n].only_valid() for n in tracking.signals if n in piece.signals}
        estimate = estimated_output(piece.track, tracking)
        if estimate is not None:
            new[ESTIMATED] = estimate
        for name, signal in new.items():
            if len(signal):
                self._parts.setdefault(name, []).append(signal)
        drive = new.get(tracking.drive)
        if drive is None or (np.abs(drive.value) > tracking.least).all():
            return ()  # nothing has ended
        return self._ended(tracking, False)

    def finish(self) -> Sequence[TrackingFigures]:
        """The figures of what is left at the end of the drive."""
        return () if self._tracking is None else self._ended(self._tracking, True)

    def _ended(self, tracking: OutputTracking, last: bool) -> Sequence[TrackingFigures]:
        drive, request = self._held(tracking.drive), self._held(tracking.request)
        sensor = next((name for name in tracking.measured if name in self._parts), ESTIMATED)
        output = self._held(sensor)
        if drive is None or output is None or len(output) < FEWEST:
            return ()
        every, final = actuations(drive, output, request, tracking), []
        for actuation in every:
            figures = actuation.figures(self._noise.get(sensor, 0.0), sensor != ESTIMATED)
            if not (last or _is_final(actuation, figures)):
                break
            final.append(figures)
        if final:
            self._forget(tracking, final[-1].end_s)
        elif not every:
            self._forget(tracking, float(drive.time[-1]) - IDLE)
        return final

    def _held(self, name: str) -> Signal | None:
        """The samples of a signal that are held, None where there are none."""
        if name not in self._parts:
            return None
        whole = Signal.joined(self._parts[name])
        self._parts[name] = [whole]
        return whole

    def _forget(self, tracking: OutputTracking, until: float) -> None:
        """Hold what comes behind ``until`` s, and the request since it began."""
        since, request = until, self._held(tracking.request)
        if request is not None:
            before = request.time <= until
            quiet = request.time[before & (np.abs(request.value) <= tracking.onset)]
            since = max(float(quiet[-1]) if len(quiet) else -np.inf, until - ASKED)
            since = float(np.nextafter(since, -np.inf))
        for name in self._parts:
            signal = self._held(name)
            if signal is not None:
                from_ = until if name == tracking.drive else since
                self._parts[name] = [signal.take(signal.time > from_)]


def _is_final(actuation: Actuation, figures: TrackingFigures) -> bool:
    """Whether no later sample can change the figures of an actuation."""
    known = min(float(actuation.drive.time[-1]), float(actuation.output.time[-1]))
    if known - actuation.stop < APART:
        return False
    if figures.delay_s is None or actuation.following < np.inf:
        return True
    if figures.fall_s is not None:
        return known >= figures.release_s + figures.fall_s
    return known >= figures.release_s + PATIENCE
