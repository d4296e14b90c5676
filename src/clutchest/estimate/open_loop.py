"""The model run open loop: driven by its inputs, corrected by no measurement."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.start import fresh
from clutchest.estimate.timeline import build
from clutchest.estimate.whole_log import Filtered, compile_model, delays, run
from clutchest.models.model import Model
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle


def open_loop(
    signals: Signals, vehicle: Vehicle, model: Model, rate: float = 10.0
) -> tuple[Floats, Floats, Filtered]:
    """(time s, clutch torque Nm, everything) of one drive on the grid of ``rate`` Hz.

    ``model`` must take the engine speed as measured (``dry_clutch.following_speed``): the speed
    alone is set to each of its samples, and slip with it.
    """
    compiled = compile_model(vehicle, model)
    timeline = build(signals, vehicle, compiled.model, rate, delays(vehicle))
    gains = np.zeros((len(timeline.t), len(compiled.model.states)))
    speed = compiled.model.sensor("engine_speed")
    gains[timeline.sensor == speed, compiled.model.state("engine_speed")] = 1.0
    start = fresh(vehicle, compiled, timeline)
    result = run(compiled, timeline, start, frozen=gains, with_signature=False)
    rows = timeline.emit >= 0
    torque = result.outputs[:, compiled.model.outputs.index("transmitted_torque"), 0]
    return timeline.t[rows][timeline.grid], torque[timeline.grid], result
