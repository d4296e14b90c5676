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
) -> list[str]:
    """In words, where signals contradict the model and nothing explains it: the reason may be an
    error of the model, or another vehicle.

    Raises ClutchestError, in the name of a ``verb``, where a single sign, swap, unit, dead sensor
    or another bench does: a fit would take that for an error of the model.  What the signals lack
    is left for the verb to say.
    """
    doubts = []
    for number, drive in enumerate(signals.drives):
        try:
            (track,) = replay(replace(drive, later=()), vehicle, progress=progress).tracks
        except ClutchestError:
            continue
        if (found := track.contradiction) is None:
            continue
        where = f" of drive {number}" if signals.later else ""
        words = (
            f"signals{where} and model contradict each other: {found.explanation} ({found.words})"
        )
        if found.is_explained:
            raise ClutchestError(f"{verb}: {words}")
        doubts.append(words)
    return doubts
