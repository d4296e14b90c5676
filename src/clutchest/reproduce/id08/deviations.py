"""A9: what the paper admits its model gets wrong, seen and explained.

The generator plays the measured rig, with each deviation built in by a mechanism of its own; the
model's extensions have other equations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize_scalar

from clutchest.generator.alsd import EFFECTS, plant
from clutchest.generator.alsd.effects import numbers
from clutchest.generator.alsd.generate import run
from clutchest.generator.effects import complete
from clutchest.models.effects import Effect
from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.id08 import extensions
from clutchest.reproduce.id08.rig import OIL, RPM, Columns, Rig, times
from clutchest.reproduce.id08.steps import FAST, ON, ONSET, PLOTS
from clutchest.signals import Floats

REMOVED = 0.8  # of the RMS error

Seen = Callable[[Columns, Columns, float], bool]  # (rig, model, release s) → the paper's word


@dataclass(frozen=True)
class Deviation:
    """``words`` of what is wrong at ``amps``, in which quantity and from when to when (s; None:
    the release), the real rig's mechanism, and the model's ``extension`` for it."""

    words: str
    amps: float
    quantity: str
    window: tuple[float, float] | None
    extension: Effect
    seen: Seen
    mechanism: Mapping[str, float] = field(default_factory=dict)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def sizes(self) -> list[tuple[str, float, str]]:
        """(name, size, unit) of the real rig's mechanism."""
        own = [
            (name, size, "m" if name == "soft" else "1") for name, size in self.mechanism.items()
        ]
        return own + [(f"{e} {k}", v, "1") for e, of in self.effects.items() for k, v in of.items()]


def onset(o: Columns) -> float:
    """Time of the first torque, s."""
    return float(o["time"][np.argmax(o["clutch_torque"] > ONSET)])


def sharpness(o: Columns) -> float:
    """Time from the first torque to 15 % of the largest, s."""
    torque = o["clutch_torque"]
    return float(np.argmax(torque > 0.15 * torque.max())) * 1e-3 - onset(o)


def swing(o: Columns, off: float) -> float:
    """Peak over settled torque."""
    time, torque = o["time"], o["clutch_torque"]
    return float(torque.max() / torque[(time > off - 0.02) & (time < off)].mean())


def settled(o: Columns, off: float) -> float:
    """Torque held at the end, Nm."""
    time = o["time"]
    return float(o["clutch_torque"][(time > off - 0.02) & (time < off)].mean())


def home(o: Columns, off: float) -> float:
    """Time from the release until a tenth of the angle is left, s."""
    later = o["time"] >= off
    angle = o["motor_angle"][later]
    return float(np.argmax(angle < 0.1 * angle[0])) * 1e-3


DEVIATIONS = (
    Deviation(
        "onset too sharp",
        12.0,
        "clutch_torque",
        (ON, ON + 0.2),
        extensions.PACK_BEDDING,
        lambda rig, model, off: sharpness(model) < sharpness(rig) - 1e-3,
        {"soft": 1.2e-5},
    ),
    Deviation(
        "damping too large",
        12.0,
        "clutch_torque",
        (ON, 1.4),
        extensions.BALL_RAMP_DITHER,
        lambda rig, model, off: swing(model, off) < swing(rig, off),
        {"dither": 0.5},
    ),
    Deviation(
        "12 A steady state off",
        12.0,
        "clutch_torque",
        (1.2, 1.4),
        extensions.BALL_RAMP_LOAD,
        lambda rig, model, off: abs(settled(model, off) / settled(rig, off) - 1) > 0.02,
        {"easing": 1.5},
    ),
    Deviation(
        "delay off at 2.5 A",
        2.5,
        "motor_angle",
        (ON, ON + 0.25),
        extensions.MOTOR_FRICTION,
        lambda rig, model, off: abs(onset(model) - onset(rig)) > 5e-3,
        effects={"motor_friction": {"change": 0.3}},
    ),
    Deviation(
        "motor return slow at 7 A",
        7.0,
        "motor_angle",
        None,
        extensions.FILM_RELEASE,
        lambda rig, model, off: home(model, off) > home(rig, off) + 1e-3,
        {"loose": 0.85},
    ),
    Deviation(
        "motor return slow at 2.5 A",
        2.5,
        "motor_angle",
        None,
        extensions.FILM_RELEASE,
        lambda rig, model, off: home(model, off) > home(rig, off) + 1e-3,
        {"loose": 0.85},
    ),
)


@dataclass(frozen=True)
class Explained:
    """One deviation: RMS error without and with the extension of the best ``size``."""

    deviation: Deviation
    measured: Columns
    base: Columns
    extended: Columns
    seen: bool
    size: float
    before: float
    after: float

    @property
    def removed(self) -> float:
        """Share of the RMS error that the extension removes."""
        return 1.0 - self.after / self.before if self.before > 0 else 0.0


def measured(rig: Rig, deviation: Deviation) -> Columns:
    """The same step by the generator, deviating unless the rig does not."""
    off, end = PLOTS[deviation.amps][:2]
    time = times(end)
    profile = np.zeros(len(time), plant.PROFILE)
    profile["oil"], profile["driven"] = OIL, FAST * RPM
    profile["asked"] = np.where((time >= ON) & (time < off), deviation.amps, 0.0)
    parameters = rig.parameters
    mechanism, effects = (deviation.mechanism, deviation.effects) if rig.deviating else ({}, {})
    return run(
        profile,
        numbers(
            parameters, complete(effects, EFFECTS), parameters["friction_coefficient"], mechanism
        ),
    )


def explain(rig: Rig, deviation: Deviation) -> Explained:
    """Fit the extension's one number to what was measured."""
    off, end = PLOTS[deviation.amps][:2]
    real, extension = measured(rig, deviation), deviation.extension
    start, stop = deviation.window or (off, end)
    rows = (real["time"] >= start) & (real["time"] < stop)

    def modelled(size: float) -> Columns:
        return rig.step(deviation.amps, FAST, ON, off, end, extension, size)

    def error(o: Columns) -> float:
        apart: Floats = o[deviation.quantity][rows] - real[deviation.quantity][rows]
        return float(np.sqrt(np.mean(apart**2)))

    base, (number,) = modelled(0.0), extension.gains
    best = minimize_scalar(
        lambda size: error(modelled(size)),
        bounds=(number.lower, number.upper),
        method="bounded",
        options={"xatol": 1e-3 * (number.upper - number.lower), "maxiter": 40},
    )
    extended = modelled(best.x)
    seen = deviation.seen(real, base, off)
    return Explained(
        deviation, real, base, extended, seen, float(best.x), error(base), error(extended)
    )


def a9(rig: Rig) -> Verdict:
    """Every deviation shows in the base model, and its extension removes most of the error."""
    explained = [explain(rig, deviation) for deviation in DEVIATIONS]
    words = "; ".join(
        f"{e.deviation.words}: {'seen' if e.seen else 'not seen'}, {e.deviation.extension.name} "
        f"removes {100 * e.removed:.0f} %"
        for e in explained
    )
    numbers_ = {f"{e.deviation.words} removed": e.removed for e in explained}
    return Verdict(
        words, all(e.seen and e.removed >= REMOVED for e in explained), numbers_, explained
    )


CLAIMS = (
    Claim(
        "A9",
        "what the paper admits",
        "Fig. 11",
        "simulated onset too sharp, damping too large, 12 A steady state off, delay off at 2.5 A, "
        "motor return slow at low and middle current",
        a9,
        {"no deviation in the rig": Rig.undeviating},
    ),
)
