"""Innovations of a drive at given numbers, and their derivatives by every unknown.

A linearisation is a function: numbers and an operating point in; innovations, derivatives and the
operating point that the numbers imply out.  Innovations depend on the numbers alone; derivatives
are taken at the inputs of the operating point that is handed over (see ``compute.sensitivities``).
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.records import (
    ActiveThetas,
    Denoised,
    Events,
    MeasuredRates,
    Numbers,
    Sensitivities,
    Start,
    Tracking,
)
from clutchest.estimate.whole_log import events_of, regimes_of
from clutchest.inference.cores import parts_of
from clutchest.inference.input_interpolation import slopes_of
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import FrozenGains, PreparedDrive, Samples
from clutchest.native import compiled
from clutchest.signals import Floats

Shifts = Mapping[str, float | Floats]  # signal → by how many s it is late, at every event or always


class LinearResponse(NamedTuple):
    """``innovations`` (K) of the readings, and the operating point that the numbers ``imply``."""

    innovations: Floats
    implied: OperatingPoint


class Derivatives(NamedTuple):
    """Where derivatives of the innovations (K) are put: that by each of the active thetas (a) into
    column ``place`` (a) of a ``table`` (K, ≥ a)."""

    table: Floats
    place: NDArray[np.int64]

    @classmethod
    def of(cls, drive: PreparedDrive, count: int) -> Derivatives:
        """A table of so many columns, side by side."""
        return cls(np.zeros((len(drive.readings.event), count)), np.arange(count))


class Modulation(NamedTuple):
    """Of the thetas whose derivatives are taken, c acts in proportion to column ``column[c]`` of
    the ``basis`` (events, b); fully where that is −1."""

    basis: Floats
    column: NDArray[np.int64]


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
    shifts = _shifts(drive, numbers)
    inputs = _inputs(drive, numbers, at, _late(drive, shifts), shifts)
    into = Derivatives.of(drive, len(active))
    _propagated(drive, numbers, inputs, active, modulation, into, drive.gains, frozen=True)
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
    varying = {d.theta: d.size / d.reach for d in drive.delayed if np.ndim(d.size)}
    basis = np.column_stack([*varying.values(), np.zeros((len(drive.line.t), 0))])
    columns = [list(varying).index(k) if k in varying else -1 for k in active]
    modulation = Modulation(basis, np.array(columns, np.int64))
    shifts = _shifts(drive, numbers)
    measured = _late(drive, shifts)
    inputs = _inputs(drive, numbers, at, measured, shifts)
    innovations, states = _propagated(
        drive, numbers, inputs, active, modulation, into, gains, frozen=frozen
    )
    return LinearResponse(innovations, _implied(drive, numbers, at, states, measured))


class _Inputs(NamedTuple):
    """What a propagation takes in at every event: (events, nu) each."""

    measured: Floats
    expected: Floats
    slope: Floats
    moves: Floats


def _inputs(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    at: OperatingPoint,
    measured: Floats,
    shifts: Shifts,
) -> _Inputs:
    """Of the smooth ``measured`` inputs (events, nu), late by ``shifts``."""
    expected = measured.copy()
    for j, by in at.corrections.items():
        expected[:, j] += by
    inputs = drive.inputs
    slope = _slopes(drive, inputs.denoised, shifts)
    plays = numbers.effects[list(drive.plays)].any()
    moves = slope if plays else _slopes(drive, inputs.deadband, shifts)
    # only the smooth part is shifted: between its samples noise would seem smaller
    return _Inputs(drive.line.u + (measured - inputs.smooth), expected, slope, moves)


def _propagated(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    inputs: _Inputs,
    active: NDArray[np.int64],
    modulation: Modulation,
    into: Derivatives,
    gains: FrozenGains,
    *,
    frozen: bool,
) -> tuple[Floats, Floats]:
    """Innovations (K) and states (events, n); derivatives are filled in, and ``gains`` unless they
    are ``frozen``."""
    event, m = drive.readings.event, len(drive.compiled.thetas)
    place = np.full(len(drive.line.t), -1)
    place[event] = np.arange(len(event))
    events = events_of(drive.line)._replace(u=inputs.measured, emit=place)

    def part(columns: NDArray[np.int64]) -> Sensitivities:
        """With derivatives by some of the active thetas."""
        own = active[columns], modulation.column[columns], into.place[columns]
        thetas = ActiveThetas(own[0], modulation.basis, own[1], own[2])
        return _run(drive, numbers, inputs, events, thetas, gains, frozen, into.table)

    # derivatives do not depend on one another
    count = parts_of(len(active), len(event) * m) if frozen else 1
    columns = np.array_split(np.arange(len(active)), count)
    if count == 1:
        done = part(columns[0])
    else:
        with ThreadPoolExecutor(count) as pool:
            done, *_ = pool.map(part, columns)
    return done.innovation, done.x


def _run(
    drive: PreparedDrive,
    numbers: ModelNumbers,
    inputs: _Inputs,
    events: Events,
    thetas: ActiveThetas,
    gains: FrozenGains,
    frozen: bool,
    derivatives: Floats,
) -> Sensitivities:
    """One run of the filter along the ``events``; ``derivatives`` (K, ≥ a) are filled."""
    functions = drive.compiled.functions
    p, g, first, _ = numbers
    n, m = len(first), len(drive.compiled.thetas)
    started, S = np.zeros(n), np.zeros((n, m))
    functions.initial(first, p, g, started, S)
    started = np.where(drive.tracked.which, drive.start.x, started)
    readings, count = len(drive.readings.event), len(thetas.active)
    results = Sensitivities(np.zeros((len(events.t), n)), np.zeros(readings), derivatives)
    functions.filter_sensitivities(
        Start(started, drive.start.P.copy(), S[:, thetas.active].copy()),
        thetas,
        events,
        Denoised(inputs.expected, inputs.slope, inputs.moves, drive.tracked.value),
        Tracking(
            np.flatnonzero(drive.tracked.which),
            gains.gain,
            gains.variance,
            frozen,
            drive.tracked.settling,
        ),
        regimes_of(drive.line),
        Numbers(p, g),
        results,
        functions.sensitivity_workspace(count),
    )
    return results


def _shifts(drive: PreparedDrive, numbers: ModelNumbers) -> Shifts:
    """By how many s signals are late at every event, beyond what the vehicle file states."""
    shifts: dict[str, float | Floats] = {**numbers.late}
    for delay in drive.delayed:
        if by := float(numbers.effects[delay.row] - drive.compiled.g[delay.row]):
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
        regimes._replace(noise=quick),
        Numbers(numbers.parameters, numbers.effects),
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
