"""Innovations of a drive at given numbers, and their derivatives by every unknown.

A linearisation is a function: numbers and an operating point in; innovations, derivatives and the
operating point that the numbers imply out.  Innovations depend on the numbers alone; derivatives
are taken at the inputs of the operating point that is handed over (see ``compute.sensitivities``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.records import MeasuredRates, Numbers
from clutchest.estimate.whole_log import regimes_of
from clutchest.inference.input_interpolation import slopes_of
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import FrozenGains, PreparedDrive, Samples
from clutchest.inference.propagation import (
    Derivatives,
    Modulation,
    PropagatedInputs,
    Propagation,
)
from clutchest.native import compiled
from clutchest.signals import Floats

Shifts = Mapping[str, float | Floats]  # signal → by how many s it is late, at every event or always


class LinearResponse(NamedTuple):
    """``innovations`` (K) of the readings, and the operating point that the numbers ``imply``."""

    innovations: Floats
    implied: OperatingPoint


def linearise(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    active: NDArray[np.int64],
    into: Derivatives,
) -> LinearResponse:
    """Innovations; derivatives by the ``active`` thetas (a) of the compiled model are filled in."""
    return _linearised(drive, numbers, at, active, into, drive.gains, frozen=True)


def filtered(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    active: NDArray[np.int64],
    into: Derivatives,
) -> tuple[LinearResponse, FrozenGains]:
    """The same with the gains that the filter has at these ``numbers``, and these
    gains."""
    events, tracked = drive.tracked.rate.shape
    gains = FrozenGains(np.zeros((events, tracked)), np.ones(events))
    response = _linearised(drive, numbers, at, active, into, gains, frozen=False)
    gains.gain[~drive.tracked.corrected] = 0.0
    return response, gains


def modulated(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    active: NDArray[np.int64],
    modulation: Modulation,
) -> Floats:
    """Derivatives (K, a) by the ``active`` thetas (a), each acting as ``modulation`` says."""
    drive = drive.with_later_gains(numbers.effects)
    shifts = _shifts(drive, numbers)
    inputs = _inputs(drive, numbers, at, _late(drive, shifts), shifts)
    into = Derivatives.of(drive, len(active))
    Propagation(drive, numbers, inputs, drive.gains, frozen=True).run(active, modulation, into)
    return into.table


def _linearised(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    active: NDArray[np.int64],
    into: Derivatives,
    gains: FrozenGains,
    *,
    frozen: bool,
) -> LinearResponse:
    drive = drive.with_later_gains(numbers.effects)
    varying = {d.theta: d.size / d.reach for d in drive.delayed if np.ndim(d.size)}
    varying |= {each.theta: each.acts for each in drive.later}
    basis = np.column_stack([*varying.values(), np.zeros((len(drive.line.t), 0))])
    columns = [list(varying).index(k) if k in varying else -1 for k in active]
    modulation = Modulation(basis, np.array(columns, np.int64))
    shifts = _shifts(drive, numbers)
    measured = _late(drive, shifts)
    inputs = _inputs(drive, numbers, at, measured, shifts)
    propagation = Propagation(drive, numbers, inputs, gains, frozen)
    innovations, states = propagation.run(active, modulation, into)
    return LinearResponse(innovations, _implied(drive, numbers, at, states, measured))


def _inputs(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    measured: Floats,
    shifts: Shifts,
) -> PropagatedInputs:
    """Of the smooth ``measured`` inputs (events, nu), late by ``shifts``."""
    expected = measured.copy()
    for j, by in at.corrections.items():
        expected[:, j] += by
    inputs = drive.inputs
    if numbers.effects[list(drive.plays)].any():
        # where it is dragged and how fast that is late must not contradict each other
        moves = slope = _slopes(drive, {**inputs.denoised, **inputs.dragged}, shifts)
    else:
        slope = _slopes(drive, inputs.denoised, shifts)
        moves = _slopes(drive, inputs.deadband, shifts)
    # only the smooth part is shifted: between its samples noise would seem smaller
    return PropagatedInputs(drive.line.u + (measured - inputs.smooth), expected, slope, moves)


def _shifts(drive: PreparedDrive, numbers: ModelNumbers) -> Shifts:
    """By how many s signals are late at every event, beyond what the vehicle file states."""
    shifts: dict[str, float | Floats] = {**numbers.late}
    for delay in drive.delayed:
        by: float | Floats = float(numbers.effects[delay.row])
        for row, value in zip(drive.varying.which, drive.varying.value.T, strict=True):
            by = value if row == delay.row else by
        if np.any(by := by - drive.compiled.g[delay.row]):
            shifts[delay.signal] = shifts.get(delay.signal, 0.0) + by * delay.size
    return shifts


def _late(drive: PreparedDrive, shifts: Shifts) -> Floats:
    """The smooth inputs (events, nu), some of them late."""
    inputs = drive.inputs
    measured = inputs.smooth.copy()
    for name, delay in shifts.items():
        if np.ndim(delay) == 0 and delay == 0.0:
            continue
        j = drive.compiled.model.input(name)
        measured[:, j] = inputs.interpolated[j].at(drive.line.t + delay, inputs.spacing)
    return measured


def _implied(
    drive: PreparedDrive, numbers: ModelNumbers, at: OperatingPoint, states: Floats, inputs: Floats
) -> OperatingPoint:
    """What the ``inputs`` (events, nu), changed in place, must have been at these ``states``
    (events, n), by one Gauss–Newton step from where they are ``at``; as measured where nothing says
    otherwise."""
    line, tracked, regimes = drive.line, drive.tracked, regimes_of(drive.line)
    quick = np.where(drive.inputs.slow, 0.0, line.noise)
    implied = inputs.copy()
    for j, by in at.corrections.items():
        implied[:, j] += by
    measured = ~np.isnan(tracked.rate).any(axis=0)
    drive.compiled.functions.imply_inputs(
        states,
        line.row,
        MeasuredRates(
            np.flatnonzero(tracked.which)[measured], tracked.rate[:, measured], tracked.act
        ),
        drive.varying,
        regimes._replace(noise=quick),
        Numbers(numbers.parameters, numbers.effects.copy()),
        inputs,
        implied,
    )
    corrections = dict[int, Floats]()
    for j in range(inputs.shape[1]):
        by = np.zeros(len(line.t))
        if _corrected(line.t, tracked.act, implied, inputs, float(drive.inputs.limit[j]), j, by):
            corrections[j] = by
            inputs[:, j] += by
    return OperatingPoint(states, inputs, corrections)


@compiled
def _corrected(
    t: Floats,
    act: NDArray[np.bool_],
    implied: Floats,
    inputs: Floats,
    limit: float,
    j: int,
    by: Floats,
) -> bool:
    """``by`` (K) how much the j-th of ``implied`` inputs (K, nu) differs from ``inputs``, by
    ``limit`` at most: θ may lie where the equations run away, and the next linearisation begins
    from here.  Straight lines in between where equations do not ``act`` (K): no jump where they
    begin to.  Returns whether any does."""
    differs, last = False, -1
    for k in range(len(t)):
        if not act[k]:
            continue
        off = implied[k, j] - inputs[k, j]
        differs = differs or implied[k, j] != inputs[k, j]
        by[k] = min(max(off, -limit), limit)
        if not (abs(by[k]) < np.inf and off == off):
            by[k] = 0.0
        for i in range(last + 1, k):
            share = 1.0 if last < 0 else (t[i] - t[last]) / (t[k] - t[last])
            by[i] = by[k] if last < 0 else by[last] + share * (by[k] - by[last])
        last = k
    for i in range(last + 1, len(t)):
        by[i] = by[last] if last >= 0 else 0.0
    return differs


def _slopes(drive: PreparedDrive, of: Mapping[int, Samples], shifts: Shifts) -> Floats:
    """Slopes (events, nu), on the way to each event, of inputs by index."""
    slopes, t = np.zeros_like(drive.inputs.smooth), drive.line.t
    names = [item.name for item in drive.compiled.model.inputs]
    for j, (time, value) in of.items():
        slopes_of(t, t + shifts.get(names[j], 0.0), time, value, j, slopes)
    return slopes
