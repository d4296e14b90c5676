"""``identify noise``: how noisy and how late every signal of a healthy log is."""

from __future__ import annotations

from dataclasses import replace
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
SLOWEST = 0.99  # AR(1) coefficient beyond which noise cannot be told from a drift
Z = 1.96
LEAVES = ("noise", "noise_ar", "delay")


def identify_noise(signals: Signals, vehicle: Vehicle, progress: Progress) -> Fit:
    """Noise, AR(1) coefficient and delay of every signal that ``vehicle`` maps.

    All drives count alike.  Delays are counted from the anchor of the machine's equations, whose
    own stays what the vehicle file says.
    """
    units = vehicle.machine.units
    parameters: dict[str, Fitted] = {}
    found: dict[str, SensorNoise] = {}
    for done, (name, mapped) in enumerate(vehicle.signals.items()):
        progress(f"noise of {name}", done / len(vehicle.signals))
        readings = [d[name].only_valid() for d in signals.drives if name in d]
        sensor, noise, ar = _noise(readings, mapped, units[name])
        parameters[f"signals.{name}.noise"] = noise
        parameters[f"signals.{name}.noise_ar"] = ar
        if sensor is not None:
            found[name] = sensor
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
        draw=partial(_draw, found, units),
    )


def _draw(found: dict[str, SensorNoise], units: dict[str, str], folder: Path) -> None:
    from clutchest.identify.noise_pictures import draw_noise

    draw_noise(found, units, folder)


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


def _noise(
    readings: list[Signal], mapped: SignalMap, unit: str
) -> tuple[SensorNoise | None, Fitted, Fitted]:
    """The sensor's noise, and what it says as standard deviation and AR(1) coefficient."""

    def unknown(why: str) -> tuple[None, Fitted, Fitted]:
        return (
            None,
            Fitted.unknown(mapped.noise, unit, why),
            Fitted.unknown(mapped.noise_ar, "1", why),
        )

    count = sum(len(signal) for signal in readings)
    if not count:
        return unknown("no valid sample in this log")
    values = [signal.value for signal in readings]
    low, high = min(v.min() for v in values if len(v)), max(v.max() for v in values if len(v))
    if low == high:
        return unknown(f"always reads {low:.6g} {unit}: whatever noise there is stays in one step")
    windows = windows_of(readings)
    if not len(windows):
        return unknown(
            f"no stretch of {WINDOW} samples on end that is neither broken by gaps nor "
            f"cut off at zero ({count} samples)"
        )
    sensor = estimate(windows, bus_step(values))
    if sensor is None or sensor.total == 0.0:
        return unknown("moves in straight lines only: no noise can be seen")
    loose, loose_ar = np.sqrt(np.diag(sensor.covariance))
    if sensor.noise <= BELOW_STEP * sensor.step:
        step, top = f"{sensor.step:.3g} {unit}", BELOW_STEP * sensor.step
        high = float(np.hypot(top, sensor.rounding))
        noise = Fitted(
            _short(sensor.total),
            unit,
            std=_short((high - sensor.rounding) / Z),
            low=_short(sensor.rounding),
            high=_short(high),
            note=f"rounding to steps of {step} hides the rest",
        )
        why = f"noise below the step of {step} shows no colour"
        ar = Fitted.unknown(mapped.noise_ar, "1", why)
        return sensor, noise, ar
    if sensor.ar > SLOWEST or loose > LOOSEST:
        _, noise, ar = unknown(
            f"{len(windows)} stretches of {WINDOW} samples do not tell noise "
            "from the signal's own wander"
        )
        return sensor, noise, ar
    if not sensor.quiet and np.tanh(np.arctanh(sensor.ar) - Z * loose_ar) > SLOW:
        _, noise, ar = unknown(
            "too little of the log is quiet to tell slow noise from the signal's own wander"
        )
        return sensor, noise, ar
    low, high = sensor.noise * np.exp(np.array([-Z, Z]) * loose)  # of what is not rounding
    share = sensor.rounding**2 / sensor.total**2
    noise = Fitted(
        _short(sensor.total),
        unit,
        std=_short(sensor.noise**2 / sensor.total * loose),
        low=_short(np.hypot(low, sensor.rounding)),
        high=_short(np.hypot(high, sensor.rounding)),
        note=f"{_short(sensor.rounding, 2):g} of it rounding" if share > 0.02 else None,
    )
    if loose_ar > LOOSEST_AR:
        return sensor, noise, Fitted.unknown(mapped.noise_ar, "1", "too few samples to tell")
    low, high = np.tanh(np.arctanh(sensor.ar) + np.array([-Z, Z]) * loose_ar)
    ar = Fitted(
        _short(sensor.ar),
        "1",
        std=_short((1 - sensor.ar**2) * loose_ar),
        low=_short(low),
        high=_short(high),
    )
    return sensor, noise, ar


def _short(value: float, digits: int = 5) -> float:
    """``value`` to as many digits as anyone will read."""
    return float(f"{value:.{digits}g}")
