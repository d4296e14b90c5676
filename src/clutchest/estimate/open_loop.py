"""The model run open loop: driven by its inputs, corrected by no measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.delay_equalisation import evenly_late
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.timeline import build
from clutchest.estimate.whole_log import Compiled, FilterOptions, compile_model, delays, run
from clutchest.models.model import Model
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class OpenLoop:
    """The model along one drive, on a regular grid: ``time`` s, ``torque``, the machine's main
    output, and ``mode``, its place among the machine's modes, shape (m,); ``states`` (m, n),
    ``inputs`` (m, nu) and regime ``flags`` (m, nw) in the order of the model."""

    compiled: Compiled
    time: Floats
    torque: Floats
    mode: NDArray[np.uint8]
    states: Floats
    inputs: Floats
    flags: Floats

    def quantity(self, *names: str, **parameters: float) -> Floats:
        """Quantities of the equations (len(names), m), with other ``parameters`` if given, of
        the states as they were simulated."""
        model, p = self.compiled.model, self.compiled.p.copy()
        for key, value in parameters.items():
            p[[q.key for q in model.parameters].index(key)] = value
        e = model.expressions()
        return e.along(e.together(names), self.states, self.inputs, self.flags, p, self.compiled.g)

    def state(self, name: str) -> Floats:
        """One state (m,)."""
        return self.states[:, self.compiled.model.state(name)]


def open_loop(signals: Signals, vehicle: Vehicle, model: Model, rate: float = 10.0) -> OpenLoop:
    """The model along one drive on the grid of ``rate`` Hz.

    ``model`` must take the derivative of its anchor as measured: that state alone is set to each of
    its samples.
    """
    compiled = compile_model(vehicle, model)
    even = evenly_late(signals, vehicle)
    timeline = build(even, vehicle, compiled.model, rate, delays(vehicle))
    gains = np.zeros((len(timeline.t), len(compiled.model.states)))
    anchor = compiled.model.sensor(model.anchor)
    gains[timeline.sensor == anchor, compiled.model.state(model.anchor)] = 1.0
    start = fresh(vehicle, compiled, timeline)
    result = run(compiled, timeline, start, FilterOptions(gains=gains, signature=False))
    rows = np.flatnonzero(timeline.emit >= 0)[timeline.grid]
    torque = compiled.model.outputs.index(compiled.machine.output)
    return OpenLoop(
        compiled,
        timeline.t[rows],
        result.outputs[timeline.grid, torque, 0],
        timeline.mode[rows],
        result.x[timeline.grid],
        timeline.u[rows],
        timeline.W[timeline.row[rows]],
    )
