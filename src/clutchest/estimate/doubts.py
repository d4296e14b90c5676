"""What makes a drive's estimates doubtful though signals and model do not contradict each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.estimate.explanation import SUSPICIOUS, rms_of
from clutchest.estimate.run import Track
from clutchest.estimate.tracking import unmeasured_band
from clutchest.models.model import Model
from clutchest.models.symbols import Column, Sensor, State
from clutchest.quantity import Quantity
from clutchest.shown import plus_minus, with_unit
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import prior_std

FAR = 4.0  # standard deviations of a state's start, as `identify` names parameters
STILL_S = 10.0  # s of slip against a shaft that stands: no launch takes as long
LONG_S = 1.0  # s in a mode, in which a sensor that is read in it has readings


def doubts(drive: Signals, track: Track, model: Model, vehicle: Vehicle) -> Iterator[str]:
    """In words: an output that is a band without its sensor, sensors that the model predicts worse
    than a right one does, those of which not one sample was used though the clutch was long in
    the mode in which they are read, a speed that stands still, and states far from where the
    vehicle file starts them."""
    tracking = vehicle.machine.tracking
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
    for column in vehicle.machine.columns:
        if still := _still(column, drive, track, vehicle):
            yield still
    for state, std in zip(model.states, prior_std(vehicle, model), strict=True):
        if far := _far(state, float(std), track, vehicle):
            yield far


def _unread(sensor: Sensor, drive: Signals, track: Track) -> str:
    """That none of a sensor's samples was used; empty where some were, or the mode was short."""
    name = sensor.column or sensor.name
    if not sensor.mode or name not in drive or len(track.innovations.of(sensor.name)[0]):
        return ""
    sampled = drive[name].only_valid()
    in_mode = _time_in(sensor.mode, track)
    if in_mode < LONG_S or not len(sampled):
        return ""
    most = with_unit(f"{np.abs(sampled.value).max():.3g}", sensor.unit)
    return (
        f"{name}: none of its {len(sampled)} samples is used, although the clutch was "
        f"{sensor.mode} for {in_mode:.1f} s; it reads {most} at most: a wrong unit, or a dead "
        "sensor?"
    )


def _still(column: Column, drive: Signals, track: Track, vehicle: Vehicle) -> str:
    """That a speed behind the clutch never changes though it would have slipped for long, with the
    other speed changing; empty where it does, or the clutch did not."""
    event = vehicle.machine.regimes.event
    if not column.geared_by or not {column.name, column.geared_by} <= set(drive.available):
        return ""
    still, other = (drive[n].only_valid().value for n in (column.name, column.geared_by))
    if np.ptp(still) > 0.0 or np.ptp(other) == 0.0 or event not in track.mode_names:
        return ""
    slipping = _time_in(event, track)
    if slipping < STILL_S:
        return ""
    return (
        f"{column.name} does not change in {drive.end:.0f} s, in which the clutch would have been "
        f"{event} for {slipping:.0f} s: a dead sensor?"
    )


def _time_in(mode: str, track: Track) -> float:
    """How long a drive was in a mode, s."""
    spent = np.diff(track.time, append=track.time[-1:])
    return float(spent[track.mode == track.mode_names.index(mode)].sum())


def _far(state: State, std: float, track: Track, vehicle: Vehicle) -> str:
    """That a state that scatters about a nominal value from one healthy machine to the next, by
    ``std`` (its unit), ended far from it and not as wear would have it; empty where it did not."""
    if not (state.prior or state.healthy_std) or not len(track.time):
        return ""
    nominal = 1.0 if state.unit == "1" else 0.0
    if state.prior and state.unit != "1":
        nominal = vehicle.parameters[state.prior].value
    end = track.states[state.name]
    away, wear = float(end.value[-1]) - nominal, vehicle.machine.wear
    allowed, limit = FAR * std, vehicle.limits.get("wear")
    if wear is not None and wear.state == state.name and wear.sign * away > 0.0 and limit:
        allowed = max(allowed, limit.value)
    if not abs(away) > allowed:
        return ""
    stated = f" ({state.prior})" if state.prior and state.unit != "1" else ""
    shown = Quantity(state.name, state.unit)
    now, new = (
        plus_minus(float(shown.read(value)), float(shown.read_spread(of)), shown.shown)
        for value, of in ((end.value[-1], end.std[-1]), (np.array(nominal), np.array(std)))
    )
    return (
        f"{state.name} {now} is {abs(away) / std:.0f} standard deviations from where the vehicle "
        f"file starts it, {new}{stated}: another vehicle, a fault, or a wrong zero, sign, unit or "
        "swap of signals; `clutchest diagnose` tests for faults"
    )
