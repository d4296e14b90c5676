"""``identify noise``: how noisy and how late every signal of a healthy log is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.identify.delay_identification import anchor_of, delays
from clutchest.identify.fit import Fit, Fitted
from clutchest.identify.sensor_noise import (
    BELOW_STEP,
    WINDOW,
    SensorNoise,
    bus_step,
    estimate,
    windows_of,
)
from clutchest.progress import Progress
from clutchest.signals import Signal, Signals
from clutchest.vehicle import SignalMap, Vehicle

LOOSEST = 0.35  # standard deviation of log noise: within a factor of two at 95 %
LOOSEST_AR = 0.35  # standard deviation of artanh of the AR(1) coefficient
SLOW = 0.5  # AR(1) coefficient that only quiet readings can show
SLOWEST = 0.99  # AR(1) coefficient beyond which noise cannot be separated from a drift
Z = 1.96
LEAVES = ("noise", "noise_ar", "delay")


def identify_noise(signals: Signals, vehicle: Vehicle, progress: Progress) -> Fit:
    """Noise, AR(1) coefficient and delay of every signal that ``vehicle`` maps.

    All drives count alike.  Delays are counted from the anchor of the machine's equations, whose
    own stays what the vehicle file says.
    """
    units = vehicle.machine.units
    parameters: dict[str, Fitted] = {}
    sensors: dict[str, SensorNoise] = {}
    for done, (name, mapped) in enumerate(vehicle.signals.items()):
        progress(f"noise of {name}", done / len(vehicle.signals))
        readings = [d[name].only_valid() for d in signals.drives if name in d]
        result = _noise(readings, mapped, units[name])
        parameters[f"signals.{name}.noise"] = result.noise
        parameters[f"signals.{name}.noise_ar"] = result.ar
        if result.sensor is not None:
            sensors[name] = result.sensor
    progress("delays", None)
    for name, late in delays(signals, vehicle).items():
        parameters[f"signals.{name}.delay"] = late
    # one signal's numbers together, in the order of the file
    keys = [f"signals.{n}.{leaf}" for n in vehicle.signals for leaf in LEAVES]
    parameters = {key: parameters[key] for key in keys}
    return Fit(
        procedure="noise",
        vehicle=_with(vehicle, parameters),
        sources=tuple(dict.fromkeys(s for drive in signals.drives for s in drive.sources)),
        parameters=parameters,
        notes=(f"delays are counted from {anchor_of(vehicle)}, whose own cannot be determined",),
        warnings=tuple(dict.fromkeys(w for drive in signals.drives for w in drive.warnings)),
        draw=partial(_draw, sensors, units),
    )


def _draw(sensors: dict[str, SensorNoise], units: dict[str, str], folder: Path) -> None:
    from clutchest.identify.noise_pictures import draw_noise

    draw_noise(sensors, units, folder)


def _with(vehicle: Vehicle, parameters: dict[str, Fitted]) -> Vehicle:
    """``vehicle`` with every number that was determined."""
    signals = dict(vehicle.signals)
    for key, fitted in parameters.items():
        if fitted.determined:
            _, name, leaf = key.split(".")
            change: dict[str, Any] = {leaf: fitted.value}
            if leaf == "noise":
                change["noise_source"] = "identified"
            signals[name] = replace(signals[name], **change)
    return replace(vehicle, signals=signals)


@dataclass(frozen=True, slots=True)
class _Result:
    """Of one signal: its ``sensor``'s noise, None where nothing can be said of it, and what is
    written of the ``noise``'s standard deviation and AR(1) coefficient ``ar``."""

    sensor: SensorNoise | None
    noise: Fitted
    ar: Fitted


def _noise(readings: list[Signal], mapped: SignalMap, unit: str) -> _Result:
    """The noise of one signal."""

    def undetermined(why: str, sensor: SensorNoise | None = None) -> _Result:
        noise = Fitted.unknown(mapped.noise, unit, why)
        return _Result(sensor, noise, Fitted.unknown(mapped.noise_ar, "1", why))

    count = sum(len(signal) for signal in readings)
    if not count:
        return undetermined("no valid sample in this log")
    values = [signal.value for signal in readings]
    low, high = min(v.min() for v in values if len(v)), max(v.max() for v in values if len(v))
    if low == high:
        return undetermined(f"always reads {low:.6g} {unit}: any noise is below one step")
    windows = windows_of(readings)
    if not len(windows):
        return undetermined(
            f"no {WINDOW} consecutive samples without a gap and not cut off at zero "
            f"({count} samples)"
        )
    sensor = estimate(windows, bus_step(values))
    if sensor is None or sensor.total == 0.0:
        return undetermined("moves in straight lines only: no noise is visible")
    loose, loose_ar = np.sqrt(np.diag(sensor.covariance))
    if sensor.noise <= BELOW_STEP * sensor.step:
        if not sensor.quiet:
            return undetermined(
                "moves too much of the time: too little of the log is quiet to separate noise from "
                "rounding and from what the signal itself does",
                sensor,
            )
        return _below_step(sensor, mapped, unit)
    if sensor.ar > SLOWEST or loose > LOOSEST:
        return undetermined(
            f"{len(windows)} windows of {WINDOW} samples do not separate noise from the signal's "
            "own drift",
            sensor,
        )
    if not sensor.quiet and np.tanh(np.arctanh(sensor.ar) - Z * loose_ar) > SLOW:
        return undetermined(
            "too little of the log is quiet to separate slow noise from the signal's own drift",
            sensor,
        )
    noise = _deviation(sensor, unit, loose)
    if loose_ar > LOOSEST_AR:
        ar = Fitted.unknown(mapped.noise_ar, "1", "not identifiable from so few samples")
        return _Result(sensor, noise, ar)
    return _Result(sensor, noise, _coefficient(sensor, loose_ar))


def _below_step(sensor: SensorNoise, mapped: SignalMap, unit: str) -> _Result:
    """Of noise that rounding hides."""
    high = float(np.hypot(BELOW_STEP * sensor.step, sensor.rounding))
    step = f"{sensor.step:.3g} {unit}"
    noise = Fitted(
        _short(sensor.total),
        unit,
        std=_short((high - sensor.rounding) / Z),
        low=_short(sensor.rounding),
        high=_short(high),
        note=f"rounding to steps of {step} hides the rest",
    )
    why = f"noise below the step of {step} shows no autocorrelation"
    return _Result(sensor, noise, Fitted.unknown(mapped.noise_ar, "1", why))


def _deviation(sensor: SensorNoise, unit: str, loose: float) -> Fitted:
    """The standard deviation, rounding in it; ``loose``: that of its logarithm."""
    low, high = sensor.noise * np.exp(np.array([-Z, Z]) * loose)  # of what is not rounding
    share = sensor.rounding**2 / sensor.total**2
    return Fitted(
        _short(sensor.total),
        unit,
        std=_short(sensor.noise**2 / sensor.total * loose),
        low=_short(np.hypot(low, sensor.rounding)),
        high=_short(np.hypot(high, sensor.rounding)),
        note=f"{_short(sensor.rounding, 2):g} of it rounding" if share > 0.02 else None,
    )


def _coefficient(sensor: SensorNoise, loose: float) -> Fitted:
    """The AR(1) coefficient; ``loose``: the standard deviation of its artanh."""
    low, high = np.tanh(np.arctanh(sensor.ar) + np.array([-Z, Z]) * loose)
    return Fitted(
        _short(sensor.ar),
        "1",
        std=_short((1 - sensor.ar**2) * loose),
        low=_short(low),
        high=_short(high),
    )


def _short(value: float, digits: int = 5) -> float:
    """``value`` to so many significant digits."""
    return float(f"{value:.{digits}g}")
