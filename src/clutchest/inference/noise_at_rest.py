"""A drive whose inputs are calm where what they drive stands; its readings keep their noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Compiled
from clutchest.inference.prepared_drive import PreparedInputs
from clutchest.signals import Floats

KNOTS = 33  # of a drive's time, between which the response to the inputs' noise is a straight line


def without_noise(
    line: Timeline, inputs: PreparedInputs, compiled: Compiled, at: Floats
) -> Timeline:
    """The drive as driven by smooth inputs while what they drive stands: shaken by their noise, a
    motor that sticks would creep.  One that turns follows them as they are read: it takes their
    mean itself, and what smooths them first takes away no noise, only their turns.  In a machine
    that nothing says stands, inputs are smooth where they are calm: a controller's answer to noise
    of the readings would pass for their cause.  Readings of what an input settles at once keep that
    noise, as late as that state follows, as it would stand in them ``at`` these states (n), and at
    temperatures that are read: a resistance that has risen by a tenth lets a tenth less through.
    """
    model, noises = compiled.model, dict[int, tuple[Floats, Floats]]()
    flags = [model.regime.index(flag) for flag in set(model.uncorrected.values())]
    acts = (line.W[line.row][:, flags] == 0.0).any(axis=1) if flags else np.ones(len(line.t), bool)
    for j, each in enumerate(inputs.interpolated):
        noise = each.at_rest if flags else each.shakes
        if noise is not None and noise.any():
            noises[j] = each.time, noise
    if not noises:
        return line
    u, z, knots = line.u.copy(), line.z.copy(), np.linspace(line.t[0], line.t[-1], KNOTS)
    for j, (time, noise) in noises.items():
        u[:, j] -= acts * np.interp(line.t, time, noise)
    states = _read_directly(line, compiled, at, knots)
    for sensor in range(len(model.sensors)):
        of = line.sensor == sensor
        for gains, lags in _settled(sensor, states, line, compiled):
            t = line.t[of] - np.interp(line.t[of], knots, lags)
            for j, (time, noise) in noises.items():
                there = np.interp(line.t[of], knots, gains[:, j])
                z[of] += acts[of] * there * np.interp(t, time, noise)
    return replace(line, u=u, z=z)


def _read_directly(line: Timeline, compiled: Compiled, at: Floats, times: Floats) -> Floats:
    """States (k, n) at ``times`` (k): those that a sensor reads, and no fit corrects, by its
    readings, others ``at`` these (n)."""
    model, states, H = compiled.model, np.tile(at, (len(times), 1)), np.zeros(len(at))
    followed = [i for i, state in enumerate(model.states) if state.name in model.followed]
    for sensor in range(len(model.sensors)):
        numbers = line.W[line.row[0]], compiled.p, compiled.g
        compiled.functions.reading(sensor, at, line.u[0], *numbers, H)
        (read,), of = np.nonzero(H), line.sensor == sensor
        if len(read) == 1 and H[read[0]] == 1.0 and read[0] not in followed and of.any():
            states[:, read[0]] = np.interp(times, line.t[of], line.z[of])
    return states


def _settled(
    sensor: int, states: Floats, line: Timeline, compiled: Compiled
) -> Iterator[tuple[Floats, Floats]]:
    """For each state that an input settles at once: derivatives (k, nu) of a sensor's reading by
    the inputs at ``states`` (k, n) by way of it, with their sign reversed, and its lag (k) in s."""
    n, nu = states.shape[1], line.u.shape[1]
    f, A, B, H = np.zeros(n), np.zeros((n, n)), np.zeros((n, nu)), np.zeros(n)
    numbers = line.W[line.row[0]], compiled.p, compiled.g
    for i in compiled.model.settling:
        gains, lags = np.zeros((len(states), nu)), np.zeros(len(states))
        for k, x in enumerate(states):
            compiled.functions.dynamics(x, line.u[0], *numbers, f, A, B)
            compiled.functions.reading(sensor, x, line.u[0], *numbers, H)
            gains[k], lags[k] = H[i] / A[i, i] * B[i], -1.0 / A[i, i]
        yield gains, lags
