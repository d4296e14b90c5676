"""What makes a drive's estimates doubtful though signals and model do not contradict each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.estimate.explanation import SUSPICIOUS, rms_of
from clutchest.estimate.run import Track
from clutchest.estimate.tracking import unmeasured_band
from clutchest.models.declarations import OutputTracking
from clutchest.models.model import Model
from clutchest.models.symbols import Sensor
from clutchest.shown import with_unit
from clutchest.signals import Signals

LONG_S = 1.0  # s in a mode, in which a sensor that is read in it has readings


def doubts(
    drive: Signals, track: Track, model: Model, tracking: OutputTracking | None
) -> Iterator[str]:
    """In words: an output that is a band without its sensor, sensors that the model predicts worse
    than a right one does, and those of which not one sample was used though the clutch was long in
    the mode in which they are read."""
    if band := unmeasured_band(tracking, drive, track, tuple(model.unobservable)):
        yield band
    if track.contradiction is not None:
        return
    off = {
        sensor.column or sensor.name: rms
        for sensor in model.sensors
        if sensor.name in model.predicted
        and (rms := rms_of(track, frozenset({sensor.name}))) >= SUSPICIOUS
    }
    if off:
        which = ", ".join(f"{name} ({rms:.1f})" for name, rms in off.items())
        yield (
            f"{which}: readings differ from what the model predicts by so many standard deviations "
            "(root mean square, none counted as more than 5): the model, the vehicle file or a "
            "signal is not right; `clutchest discover` searches for the cause"
        )
    for sensor in model.sensors:
        if unread := _unread(sensor, drive, track):
            yield unread


def _unread(sensor: Sensor, drive: Signals, track: Track) -> str:
    """That none of a sensor's samples was used; empty where some were, or the mode was short."""
    name = sensor.column or sensor.name
    if not sensor.mode or name not in drive or len(track.innovations.of(sensor.name)[0]):
        return ""
    sampled = drive[name].only_valid()
    spent = np.diff(track.time, append=track.time[-1:])
    in_mode = float(spent[track.mode == track.mode_names.index(sensor.mode)].sum())
    if in_mode < LONG_S or not len(sampled):
        return ""
    most = with_unit(f"{np.abs(sampled.value).max():.3g}", sensor.unit)
    return (
        f"{name}: none of its {len(sampled)} samples is used, although the clutch was "
        f"{sensor.mode} for {in_mode:.1f} s; it reads {most} at most: a wrong unit, or a dead "
        "sensor?"
    )
