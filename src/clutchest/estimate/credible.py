"""Whether signals can be believed before a model is fitted to them."""

from __future__ import annotations

from dataclasses import replace

from clutchest.errors import ClutchestError
from clutchest.estimate.replay import replay
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle


def require_credible(
    signals: Signals, vehicle: Vehicle, verb: str, progress: Progress | None = None
) -> None:
    """Raises ClutchestError, in the name of a ``verb``, for signals that contradict the model where
    a single sign, swap, unit, dead sensor or another bench explains it: a fit would take that for
    an error of the model.  What the signals lack is left for the verb to say."""
    for number, drive in enumerate(signals.drives):
        try:
            (track,) = replay(replace(drive, later=()), vehicle, progress=progress).tracks
        except ClutchestError:
            continue
        if (found := track.contradiction) is not None and found.is_explained:
            where = f" of drive {number}" if signals.later else ""
            raise ClutchestError(
                f"{verb}: signals{where} and model contradict each other: {found.explanation} "
                f"({found.words})"
            )
