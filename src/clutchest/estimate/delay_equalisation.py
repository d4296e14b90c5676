"""Signals that come later at one time than at another, as if they always came at their latest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from clutchest.estimate.whole_log import present_effects
from clutchest.models.effects.effect import TIME, Lateness
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle


class Clocks:
    """Puts samples off until their delay is the signal's largest, which is then the same for all
    (:func:`clutchest.estimate.whole_log.delays`).  Feed :meth:`take` in order of time."""

    def __init__(self, vehicle: Vehicle) -> None:
        numbers = vehicle.effect_numbers
        self.late: list[tuple[str, float, Lateness]] = [
            (signal, numbers[effect.name].get(effect.delays[signal], 0.0), lateness)
            for effect in present_effects(vehicle)
            for signal, lateness in effect.lateness.items()
        ]
        self._value: dict[str, float] = {}  # the last one of what delays go with
        self._put_off: dict[int, float] = {}  # until when the samples of each of them have been

    def take(self, new: Mapping[str, Signal]) -> Mapping[str, Signal]:
        """The ``new`` samples of every signal; what would overtake the one before it is left out,
        having been used already."""
        equalised = dict(new)
        for i, (name, size, lateness) in enumerate(self.late):
            if name not in equalised or not len(signal := equalised[name]):
                continue
            value = self._at(lateness.covariate, signal.time, new)
            late = np.interp(value, lateness.at, lateness.seconds)
            most = lateness.most
            time = signal.time + size * (most - np.where(np.isfinite(value), late, most))
            ahead = np.concatenate([[self._put_off.get(i, -np.inf)], time[:-1]])
            keep = time > np.maximum.accumulate(ahead)
            self._put_off[i] = float(max(time.max(), ahead[0]))
            equalised[name] = replace(signal, time=time).take(keep)
        for _, _, lateness in self.late:
            of = lateness.covariate
            if of in new and len(valid := new[of].only_valid()):
                self._value[of] = float(valid.value[-1])
        return equalised

    def _at(self, of: str, time: Floats, new: Mapping[str, Signal]) -> Floats:
        """What was last known, at each ``time`` (n), of what a delay goes with; NaN: nothing."""
        if of == TIME:
            return time
        before = np.full(len(time), self._value.get(of, np.nan))
        if of not in new or not len(known := new[of].only_valid()):
            return before
        last = np.searchsorted(known.time, time, side="right") - 1
        return np.where(last >= 0, known.value[np.maximum(last, 0)], before)


def evenly_late(signals: Signals, vehicle: Vehicle) -> Signals:
    """A whole drive, as :meth:`Clocks.take` has it."""
    clocks = Clocks(vehicle)
    return replace(signals, signals=clocks.take(signals.signals)) if clocks.late else signals
