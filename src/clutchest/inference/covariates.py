"""Covariates of errors at every event of a drive: inputs, states and their highest values so far,
rates, places within a turn, durations, time, energy, and how often and after how long a rest
surfaces have slid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.casadi_later import ca, one_at_a_time
from clutchest.inference.denoising import (
    BRIEF,
    CALM,
    adaptive_mean,
    deadband,
    denoised_rate,
    denoised_slope,
)
from clutchest.inference.noise_model import median_std
from clutchest.inference.operating_point import OperatingPoint
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.models.declarations import ENERGY, ENGAGEMENTS, RECENT, RECENT_SLIP, REST, TURN
from clutchest.models.effects.effect import TIME
from clutchest.models.machine import Machine
from clutchest.native import compiled
from clutchest.signals import Floats

KNOTS = 5  # of a curve over a covariate
SPEEDS = ("rad/s", "m/s")  # units of a mass's speed
BEGINNING = 3.0 ** -np.arange(3)  # parts of a duration: more happens at its begin
FINE_KNOTS = 8, 36  # over time and within a turn
AT_REST = 6.0  # standard deviations of its noise, from the lowest to the highest
PAUSE = 0.5  # s, of a rest: what is shorter is noise of the speeds, or a change of the slip's sign
ENDS = 0.002, 0.998  # quantiles of a covariate at which curves over it end
BEYOND = 0.1  # of how far it goes: beyond, what is read elsewhere has a knot of its own
CONSTANT = 1e-9  # of its own size; a covariate that moves less is none


def covariates(
    drive: PreparedDrive, at: OperatingPoint, also: Iterable[str] = ()
) -> dict[str, Floats]:
    """Name → value at every event (K) of the drive at an operating point; ``also`` of these
    quantities of the equations."""
    line, machine = drive.line, drive.compiled.machine
    read, power = _series(drive, at, _without_noise(drive, at.states), also)
    spans = np.diff(line.t, prepend=line.t[0])
    # correlation with the noise of a covariate is no error
    series = {name: deadband(line.t, value, drive.tracked.act) for name, value in read.items()}
    inputs = [item.name for item in drive.compiled.model.inputs]
    series |= {
        name: denoised_slope(line.t, at.inputs[:, inputs.index(name)], drive.tracked.act)
        for name in drive.compiled.model.slopes
    }
    series |= {
        name: denoised_rate(line.t, read[of], drive.tracked.act, _windows(machine, of))
        for name, of in machine.rates.items()
        if of in read
    }
    series |= {name: np.maximum.accumulate(series[of]) for name, of in machine.peaks.items()}
    # a speed's own noise is in no angle by it, but its deadband would be
    turning, of_speeds = spans * _moves(drive), set(machine.turns.values())
    angles = {of: np.cumsum(read[of] * turning) for of in of_speeds if of in read}
    angles |= {s.name: series[s.name] for s in machine.states if s.name in series}
    series |= {name: np.mod(angles[of], TURN) for name, of in machine.turns.items() if of in angles}
    series |= {
        name: departure(line.t, series[of])
        for name, of in machine.departures.items()
        if of in series
    }
    series |= {
        name: _duration(line.t, series[of] > 0.0)
        for name, of in machine.durations.items()
        if of in series  # not every model of the machine has each quantity
    }
    series[ENERGY] = np.cumsum(power * spans)
    series[REST], series[ENGAGEMENTS] = rests(line.t, drive.tracked.act)
    series[RECENT_SLIP] = recent_slip(line.t, drive.tracked.act)
    series[TIME] = line.t
    return series


def covariate(
    drive: PreparedDrive, at: OperatingPoint, name: str, also: Iterable[str] = ()
) -> Floats | None:
    """The one of that ``name`` (K), as :func:`covariates` has it; None where the drive has none."""
    read, _ = _series(drive, at, _without_noise(drive, at.states), also)
    if name in read:
        return deadband(drive.line.t, read[name], drive.tracked.act)
    return covariates(drive, at, also).get(name)


def measured_at_rest(drive: PreparedDrive, at: OperatingPoint) -> OperatingPoint:
    """An operating point with inputs as they are measured where equations do not act: there nothing
    implies them."""
    inputs, rests = at.inputs.copy(), ~drive.tracked.act
    for j, by in at.corrections.items():
        inputs[rests, j] -= by[rests]
    return replace(at, inputs=inputs)


def _moves(drive: PreparedDrive) -> NDArray[np.bool_]:
    """At which events (K) of a drive something moves against something else: in a regime without
    any flag nothing does, and a state that is a random walk there is no speed."""
    flags = drive.line.W[drive.line.row]
    return np.asarray((flags > 0.0).any(axis=1)) if flags.shape[1] else np.ones(len(flags), bool)


def _windows(machine: Machine, name: str) -> tuple[float, ...]:
    """Over which s the rate of ``name`` is taken: no mass changes its speed as fast as others do
    theirs."""
    return CALM if {**machine.units, **machine.covariates}.get(name) in SPEEDS else BRIEF


def _duration(t: Floats, lasts: NDArray[np.bool_]) -> Floats:
    """For how long something ``lasts`` at times ``t`` (K), s; 0 where it does not."""
    return np.where(lasts, t - np.maximum.accumulate(np.where(lasts, t[0], t)), 0.0)


def rests(t: Floats, slides: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """At times ``t`` (K), s, where surfaces ``slides`` (K) or not: for how long they have rested,
    s, and while they slide, for how long they had before; how often they have begun to slide.  The
    first rest began before the record did: it was as long as any."""
    sliding = np.flatnonzero(slides)
    if not len(sliding):
        return t - t[0], np.zeros(len(t))
    since = np.diff(t[sliding], prepend=t[0])
    begins = (since > PAUSE) & (np.diff(sliding, prepend=-1) > 1)  # slow readings are no rests
    begins[0] = True
    since[0] = since[begins].max()
    count = np.zeros(len(t))
    count[sliding[begins]] = 1.0
    last = np.searchsorted(sliding, np.arange(len(t)), side="right") - 1
    before = since[begins][np.cumsum(begins) - 1]
    rest = t - np.where(last < 0, t[0], t[sliding[last]])
    held = slides | ((rest <= PAUSE) & (last >= 0))
    return np.where(held, before[last], rest), np.cumsum(count)


def recent_slip(t: Floats, slides: NDArray[np.bool_]) -> Floats:
    """The share of the time before each of ``t`` (K), s, that surfaces ``slides`` (K), with weights
    that fade over ``RECENT`` s.  Before the record they rested."""
    spans = np.diff(t, prepend=t[:1])
    slid = slides & (spans > 0.0)
    grown = np.full(len(t), -np.inf)  # logarithms, as weights overflow
    grown[slid] = np.log(-np.expm1(-spans[slid] / RECENT)) + t[slid] / RECENT
    return np.asarray(np.exp(np.logaddexp.accumulate(grown) - t / RECENT))


def departure(t: Floats, value: Floats) -> Floats:
    """Of ``value`` (K), from its mean over the time before each of ``t`` (K), s, with weights that
    fade over ``RECENT`` s."""
    out = np.zeros(len(value))
    _depart(value, 1.0 - np.exp(-np.diff(t, prepend=t[:1]) / RECENT), out)
    return out


@compiled
def _depart(value: Floats, share: Floats, out: Floats) -> None:
    """Departures from a mean in which each ``value`` (K) has a ``share`` (K)."""
    weight, total = 0.0, 0.0
    for k in range(len(value)):
        weight += share[k] * (1.0 - weight)
        total += share[k] * (value[k] - total)
        if weight > 0.0:
            out[k] = value[k] - total / weight


def noise_in_derivatives(
    drive: PreparedDrive, at: OperatingPoint, smooth: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Name → what the ``smooth`` covariates lack (K) that derivatives hold, which are taken at the
    states themselves; of those that vary with states which an input settles at once."""
    settling = drive.compiled.model.settling
    if not len(settling):
        return {}
    mean = _without_noise(drive, at.states)
    as_they_are = mean.copy()
    as_they_are[:, settling] = at.states[:, settling]
    read, _ = _series(drive, at, as_they_are)
    without, _ = _series(drive, at, mean)
    return {n: v - smooth[n] for n, v in read.items() if np.any(v != without[n])}


@one_at_a_time
def _series(
    drive: PreparedDrive, at: OperatingPoint, states: Floats, also: Iterable[str] = ()
) -> tuple[dict[str, Floats], Floats]:
    """Inputs, ``states`` (K, n) and the equations' quantities as they are, and the power (K)."""
    model, machine, line = drive.compiled.model, drive.compiled.machine, drive.line
    series = {
        item.name: at.inputs[:, j]
        for j, item in enumerate(model.inputs)
        if item.name not in model.slopes
    }
    parts = {state.name for part in machine.unmodelled.values() for state in part.states}
    series |= {s.name: states[:, i] for i, s in enumerate(model.states) if s.name not in parts}
    e = model.expressions()
    known = e.quantities.names()
    quantities = tuple(name for name in (*machine.covariates, *also) if name in known)
    wanted = ca.vertcat(*(getattr(e.quantities, n) for n in quantities), model.power(e))
    values = e.along(
        wanted,
        states,
        at.inputs,
        line.W[line.row],
        drive.compiled.p,
        drive.compiled.g,
    )
    return series | dict(zip(quantities, values, strict=False)), values[-1]


def _without_noise(drive: PreparedDrive, states: Floats) -> Floats:
    """States (K, n), of those that readings correct all the time their adaptive means: what the
    filter makes of a reading's noise is in its innovation as well, and so is an input's noise that
    one which it settles at once has."""
    model, smoothed = drive.compiled.model, states.copy()
    for i in map(model.state, model.tracked):
        noise = median_std(np.diff(states[:, i])) / np.sqrt(2.0)
        smoothed[:, i] = adaptive_mean(drive.line.t, states[:, i], noise, 0.0)
    return smoothed


def at_rest(drive: PreparedDrive, at: OperatingPoint) -> set[str]:
    """The inputs that move no further than their noise, their rates and departures: what correlates
    with them correlates with noise."""
    model = drive.compiled.model
    still = np.ptp(at.inputs, axis=0) <= AT_REST * np.sqrt(drive.line.variance)
    resting = {item.name for item, rests in zip(model.inputs, still, strict=True) if rests}
    machine = drive.compiled.machine
    made = {**machine.rates, **machine.departures}
    return resting | {name for name, of in made.items() if of in resting}


def knots(
    machine: Machine,
    name: str,
    value: Floats,
    where: Floats,
    reads: NDArray[np.bool_] | None = None,
) -> tuple[Floats, ...]:
    """Where curves over this covariate of a machine may bend: at its quantiles, counted with
    weights ``where`` (K), and where it ends where the error ``reads`` (K) as well; evenly and also
    more finely over time and within a turn, where a torque may ripple many times; nowhere for a
    covariate that does not move there."""
    inside = value[where > 0.0]
    if not len(inside) or not np.isfinite(inside).all():
        return ()
    low, high = np.quantile(inside, ENDS)
    if high - low <= CONSTANT * max(abs(low), abs(high), 1e-9):
        return ()
    if name == TIME or name in machine.turns:
        return tuple(np.linspace(low, high, count) for count in FINE_KNOTS)
    if name in machine.durations:
        return (np.concatenate([[0.0], high * BEGINNING[::-1]]),)
    inner = np.quantile(inside, np.linspace(0.0, 1.0, KNOTS)[1:-1])
    even = np.linspace(low, high, KNOTS)[1:-1]
    bends = np.unique(np.concatenate([[low], (inner + even) / 2.0, [high]]))
    distinct = np.min(np.diff(bends)) > CONSTANT * (high - low)
    bends = bends if distinct else np.linspace(low, high, KNOTS)
    if reads is not None and reads.any():
        below, above = np.quantile(value[reads], ENDS)
        lower = [below] if below < low - BEYOND * (high - low) else []
        upper = [above] if above > high + BEYOND * (high - low) else []
        bends = np.concatenate([lower, bends, upper])
    return (bends,)


def hats(value: Floats, at: Floats) -> Floats:
    """Piecewise straight curves (K, len(at)), each 1 at its knot and 0 at all others."""
    inside = np.clip(value, at[0], at[-1])
    return np.column_stack([np.interp(inside, at, row) for row in np.eye(len(at))])
