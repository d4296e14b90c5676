"""Where an input turns so sharply that how it went between two samples matters.

Samples 10 ms apart hardly show when in between a pedal was let go, and what the torque did
meanwhile stays in a tracked state for a while.  Readings beside it have noise of their own, most of
it those in between, but are those that tell most of delays.  Those beside a single reading far off
tell nothing, nor those beside a step of what is switched.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from clutchest.casadi_later import one_at_a_time
from clutchest.estimate.whole_log import Compiled, delays
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.models.model import Expressions, Model
from clutchest.models.symbols import Input
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

SHARP, SETTLED = 16.0, 0.05  # of an input's noise: a bend that counts; s until it is forgotten
AGAINST = 0.25  # of its second difference: what those beside a single reading far off have at least


def bends(
    drive: PreparedDrive, signals: Signals, vehicle: Vehicle
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Events (K) at which the tracked states still hold what an input did between two samples as it
    turned sharply (1), and those between these samples (2); and those of them of which nothing can
    be said.  An input that moves none of these states at the file's numbers does not matter: a
    position read to a micrometre bends whenever it moves."""
    t, late = drive.line.t, delays(vehicle)
    still, turns, out = held = np.zeros((3, len(t) + 1), int)
    for item in _moving(drive.compiled, drive.tracked.which):
        mapped = vehicle.signals.get(item.name)
        if item.name not in signals or mapped is None or len(signals[item.name].time) < 3:
            continue
        time, second = signals[item.name].time, np.diff(signals[item.name].value, 2)
        sharp = np.abs(second) > SHARP * mapped.noise
        lost = sharp & _spikes(second) if item.smooth else sharp
        for count, which, for_s in (
            (still, sharp, SETTLED),
            (turns, sharp, 0.0),
            (out, lost, SETTLED),
        ):
            begins, ends = time[:-2][which], time[2:][which] + for_s
            for edges, change in ((begins, 1), (ends, -1)):
                np.add.at(count, np.searchsorted(t, edges - late.get(item.name, 0.0)), change)
    within = np.cumsum(held[:, :-1], axis=1) > 0
    return within[0].astype(np.int64) + within[1], within[2]


@one_at_a_time
def driving(model: Model, e: Expressions, rates: ca.SX) -> set[int]:
    """Indices of the inputs in some ``rates`` of a model, written out as ``e``."""
    return {j for j in range(len(model.inputs)) if ca.depends_on(rates, e.u[j])}


def _spikes(second: Floats) -> NDArray[np.bool_]:
    """Whether second differences (k) are those of a single reading off its neighbours, where those
    before and after go against it, or the ones after such."""
    padded = np.pad(second, 1)
    against = -np.sign(second) * np.array([padded[:-2], padded[2:]])
    alone = against.min(axis=0) > AGAINST * np.abs(second)
    return np.asarray(alone | np.roll(alone, 1))


@one_at_a_time
def _moving(compiled: Compiled, which: NDArray[np.bool_]) -> list[Input]:
    """The inputs that move any of the states ``which`` (n), effects of no size left out."""
    model, e = compiled.model, compiled.model.expressions()
    rates = ca.substitute(e.rate, e.g, ca.DM(compiled.g))[np.flatnonzero(which).tolist()]
    return [model.inputs[j] for j in sorted(driving(model, e, rates))]
