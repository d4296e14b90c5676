"""A drive as its equations see it at given numbers: innovations, and how they answer to each.

Everything unknown is a number θ: the parameters that the vehicle file gives a spread, the gains of
effects, and what each state starts from.  States that the model renews at every slip (the engine
speed) are tracked by the filter; all others follow from θ alone, without process noise and without
being corrected.  The innovations are then a smooth function of θ, which Gauss–Newton steps follow
as far as they like, and no adapting state swallows what a cause leaves in the data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.records import (
    ActiveThetas,
    Denoised,
    MeasuredRates,
    Numbers,
    Sensitivities,
    Start,
    Tracking,
)
from clutchest.estimate.delay_equalisation import evenly_late
from clutchest.estimate.initial_state import fresh, nominal
from clutchest.estimate.samples import slope
from clutchest.estimate.timeline import Timeline, build
from clutchest.estimate.whole_log import Compiled, delays, events_of, regimes_of
from clutchest.inference.decimation import decimated
from clutchest.inference.denoising import calm, firm, path
from clutchest.inference.input_interpolation import InterpolatedInput, apart
from clutchest.inference.input_noise_covariance import input_noise_directions
from clutchest.inference.noise_model import Stretches
from clutchest.models.effects.effect import TIME, Lateness
from clutchest.models.model import Model
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

SLOPE = 0.6  # s, over which a signal that may be late is smoothed: noise that stays in a slope goes
# with what it did to a tracked state before, and passes for a delay where noise is slow
RATE_WINDOW = 0.2  # s, over which the slope of a tracked state is fitted
SETTLING = 0.15  # s; a tracked state's first innovations are not yet coloured as later ones
SHARP, SETTLED = 16.0, 0.05  # of an input's noise: a bend to be seen; s until it is forgotten
IMPLIED = 30.0  # of an input's noise, that it may lie from its reading
LEAST = 0.01  # standard deviations per unit; readings that answer less to every θ are left out


class LinearisedDrive:
    """One drive, to be linearised anywhere; ``units`` (m) of the compiled model's thetas.

    Of its readings that tell of θ: ``t`` s, ``sensor`` index, ``row`` the regime's, ``mode``, and
    ``std`` of the innovation; shape (K,) each.  ``walks`` (K, c): what the noise of inputs does to
    innovations by way of states that no reading corrects, in the innovations' ``std``.
    """

    def __init__(
        self, signals: Signals, vehicle: Vehicle, compiled: Compiled, units: Floats
    ) -> None:
        model, signals = compiled.model, evenly_late(signals, vehicle)
        line = build(signals, vehicle, model, 1.0, delays(vehicle))
        self.tracked = np.array([state.name in model.renewed for state in model.states])
        line = replace(line, Q=np.where(np.tile(self.tracked, 2), line.Q, 0.0))
        R = line.R.copy()
        for i, sensor in enumerate(model.sensors):
            if sensor.name in model.renewed:  # a nimble filter: colour is taken out afterwards
                R[line.sensor == i] = vehicle.signals[sensor.column or sensor.name].noise ** 2
        line = replace(line, R=R)
        self.compiled, self.line = compiled, decimated(line, model)
        self.nominal = nominal(compiled, line)
        self.delays = _delays(signals, compiled, self.line.t)
        self.start = fresh(vehicle, compiled, line)
        self.start.P[~self.tracked] = 0.0
        self.start.P[:, ~self.tracked] = 0.0
        self.acts = np.zeros(len(self.line.t), bool)
        for flag, _ in model.renewed.values():
            self.acts |= self.line.W[self.line.row, model.regime.index(flag)] > 0
        self.slope, self.calm = self._tracked(line)
        self.states = np.zeros((len(self.line.t), len(model.states)))
        self.course, self.apart = self._courses(signals, vehicle, line), apart(self.line.t)
        off = np.column_stack([c.off(self.line.t, self.apart) for c in self.course])
        self.line = replace(self.line, u=self.line.u - off)
        self.smooth = np.column_stack([c.at(self.line.t, self.apart) for c in self.course])
        e, self.still, self.firm = model.expressions(), {}, {}
        dragging, self.plays = e.dragging, e.plays
        mapped = (vehicle.signals.get(item.name) for item in model.inputs)
        noise, ar = zip(
            *((s.noise, s.noise_ar) if s else (np.inf, 0.0) for s in mapped), strict=True
        )
        for j, freed in _sloped(model, dragging, noise, ar).items():
            time, value = self.course[j].time, self.course[j].value
            acts = np.interp(time, self.line.t, self.acts) > 0.5
            self.still[j] = time, freed(time, value, acts)
            if j in dragging:
                self.firm[j] = time, firm(time, value, self.still[j][1], acts, noise[j], ar[j])
        self.moved = dict[int, Floats]()  # inputs, by what the run before implies
        self.reach = IMPLIED * np.array(noise)
        self.expected = self.smooth.copy()
        # the filter's gains are those of the vehicle file's numbers, wherever it is linearised
        self.frozen, self.gain = False, np.zeros_like(self.slope)
        self.variance = np.ones(len(self.line.t))
        self.rows = np.arange(len(self.line.t))
        at = compiled.p, compiled.g, self.nominal
        _, answers = self.answer(*at, {}, np.arange(len(units)))
        self.frozen, std = True, np.sqrt(self.variance)
        tells = np.zeros(len(std), bool)
        for answer, unit in zip(answers.T, units, strict=True):
            tells |= np.abs(answer) * unit > LEAST * std
        # near lock-up a tracked state tells of the clutch's shudder, not of any θ
        reads = np.array([sensor.name for sensor in model.sensors])
        tracks = np.isin(reads, [s.name for s in model.states if s.name in model.renewed])
        settled = self.acts & (self._since_acting() > SETTLING)
        settled &= ~self._bent(signals, vehicle)
        counts = (self.line.sensor >= 0) & (settled | ~tracks[self.line.sensor])
        rows = np.flatnonzero(counts & tells)
        self.rows = rows[np.argsort(self.line.sensor[rows], kind="stable")]
        self.t, self.sensor = self.line.t[self.rows], self.line.sensor[self.rows]
        self.row, self.mode = self.line.row[self.rows], self.line.mode[self.rows]
        self.std = std[self.rows]
        self.input_noise_directions = input_noise_directions(self, vehicle)

    @property
    def stretches(self) -> Stretches:
        """How its readings hang together."""
        return Stretches.of(self.t, self.sensor, self.row)

    def _bent(self, signals: Signals, vehicle: Vehicle) -> NDArray[np.bool_]:
        """Events (K) at which the tracked states still hold the error of an input that turned so
        sharply that when it did so, between two samples, matters."""
        bends, late = np.zeros(len(self.line.t) + 1, int), delays(vehicle)
        for item in self.compiled.model.inputs:
            mapped = vehicle.signals.get(item.name)
            if item.name not in signals or mapped is None or len(signals[item.name].time) < 3:
                continue
            time, value = signals[item.name].time, signals[item.name].value
            sharp = np.abs(np.diff(value, 2)) > SHARP * mapped.noise
            begins, ends = time[:-2][sharp], time[2:][sharp] + SETTLED
            for edges, change in ((begins, 1), (ends, -1)):
                at = np.searchsorted(self.line.t, edges - late.get(item.name, 0.0))
                np.add.at(bends, at, change)
        return np.cumsum(bends[:-1]) > 0

    def _since_acting(self) -> Floats:
        """For how long the tracked states' equations have acted, s, at every event."""
        t, begins = self.line.t, np.diff(self.acts.astype(int), prepend=0) == 1
        return t - np.maximum.accumulate(np.where(begins, t, t[0]))

    def answer(
        self, p: Floats, g: Floats, x: Floats, late: Mapping[str, float], active: NDArray[np.int64]
    ) -> tuple[Floats, Floats]:
        """Innovations (K) of the readings that count, and their derivatives (K, a) by the
        ``active`` thetas (a) of the compiled model.

        ``p`` parameters, ``g`` numbers of effects, ``x`` first states; ``late`` s by signal come
        on top of the effects' delays.  Derivatives are taken at the inputs that the run before
        implied (see ``compute.sensitivities``).
        """
        shifts = self._shifts(g, late)
        uneven = {d.theta: d.size / d.reach for d in self.delays if np.ndim(d.size)}
        basis = np.column_stack([*uneven.values(), np.zeros((len(self.line.t), 0))])
        which = np.array([list(uneven).index(k) if k in uneven else -1 for k in active], np.int64)
        innovations, answers, states = self._run(p, g, x, shifts, active, basis, which)
        self.states = states
        self._imply(p, g, self._late(shifts))
        return innovations, answers

    def modulated(
        self,
        p: Floats,
        g: Floats,
        x: Floats,
        late: Mapping[str, float],
        active: NDArray[np.int64],
        basis: Floats,
        which: NDArray[np.int64],
    ) -> Floats:
        """Derivatives as of :meth:`answer`, of thetas of which number c acts in proportion to
        column ``which[c]`` of ``basis`` (events, b)."""
        return self._run(p, g, x, self._shifts(g, late), active, basis, which)[1]

    def _shifts(self, g: Floats, late: Mapping[str, float]) -> dict[str, float | Floats]:
        """By how many s signals are late at every event, beyond what the vehicle file states."""
        shifts: dict[str, float | Floats] = {**late}
        for delay in self.delays:
            if by := float(g[delay.row] - self.compiled.g[delay.row]):
                shifts[delay.signal] = shifts.get(delay.signal, 0.0) + by * delay.size
        return shifts

    def _run(
        self,
        p: Floats,
        g: Floats,
        x: Floats,
        late: Mapping[str, float | Floats],
        active: NDArray[np.int64],
        basis: Floats,
        which: NDArray[np.int64],
    ) -> tuple[Floats, Floats, Floats]:
        """Innovations, derivatives, and the states (events, n) on the way."""
        line, functions = self.line, self.compiled.functions
        n, m = len(x), len(self.compiled.thetas)
        measured = self._late(late)
        # only the smooth part is shifted: between its samples noise would seem smaller
        u, true = line.u + (measured - self.smooth), measured
        for j, by in self.moved.items():
            true[:, j] += by
        started, S = np.zeros(n), np.zeros((n, m))
        functions.initial(x, p, g, started, S)
        started = np.where(self.tracked, self.start.x, started)
        states, innovations = np.zeros((len(line.t), n)), np.zeros(len(self.rows))
        answers = np.zeros((len(self.rows), len(active)))
        place = np.full(len(line.t), -1)
        place[self.rows] = np.arange(len(self.rows))
        slope = self._slopes(self.still, late)
        moves = slope if g[self.plays].any() else self._slopes(self.firm, late)
        functions.filter_sensitivities(
            Start(started, self.start.P.copy(), S[:, active].copy()),
            ActiveThetas(active, basis, which),
            events_of(line)._replace(u=u, emit=place),
            Denoised(true, slope, moves, self.calm),
            Tracking(np.flatnonzero(self.tracked), self.gain, self.variance, self.frozen),
            regimes_of(line),
            Numbers(p, g),
            Sensitivities(states, innovations, answers),
            functions.sensitivity_workspace(len(active)),
        )
        return innovations, answers, states

    def _late(self, late: Mapping[str, float | Floats]) -> Floats:
        """The smooth inputs (events, nu), some of them ``late``."""
        measured = self.smooth.copy()
        for name, delay in late.items():
            j = self.compiled.model.input(name)
            measured[:, j] = self.course[j].at(self.line.t + delay, self.apart)
        return measured

    def _imply(self, p: Floats, g: Floats, measured: Floats) -> None:
        """What the inputs must have been at the states of the last run, for the next one; as
        ``measured`` (events, nu) where nothing tells of it."""
        line, acts = self.line, np.flatnonzero(self.acts)
        implied = measured.copy()
        for j, by in self.moved.items():
            implied[:, j] += by
        self.compiled.functions.imply_inputs(
            self.states,
            line.row,
            MeasuredRates(np.flatnonzero(self.tracked), self.slope, self.acts),
            regimes_of(line),
            Numbers(p, g),
            measured,
            implied,
        )
        moves, self.moved = np.any((implied != measured)[acts], axis=0), {}
        for j in map(int, np.flatnonzero(moves)):
            # θ may lie where the equations run away: the next run begins from here
            by = np.clip(implied[acts, j] - measured[acts, j], -self.reach[j], self.reach[j])
            by[~np.isfinite(by)] = 0.0
            # no jump where the equations begin to act
            self.moved[j] = np.interp(line.t, line.t[acts], by)
        for j, by in self.moved.items():
            measured[:, j] += by
        self.expected = measured

    def _slopes(
        self, of: Mapping[int, tuple[Floats, Floats]], late: Mapping[str, float | Floats]
    ) -> Floats:
        """Slopes (K, nu), on the way to each event, of inputs: index → times, and values without
        their noise."""
        found, t = np.zeros_like(self.smooth), self.line.t
        span = np.diff(t, prepend=t[0])
        for j, course in of.items():
            value = np.interp(t + late.get(self.compiled.model.inputs[j].name, 0.0), *course)
            np.divide(np.diff(value, prepend=value[0]), span, out=found[:, j], where=span > 0.0)
        return found

    def _courses(
        self, signals: Signals, vehicle: Vehicle, whole: Timeline
    ) -> list[InterpolatedInput]:
        """Every input, with samples as close as the signal's, so that it can be shifted in time."""
        found = []
        for j, item in enumerate(self.compiled.model.inputs):
            course = InterpolatedInput.straight(self.line.t, self.line.u[:, j])
            if item.name in signals and self.line.noise[j] and len(signals[item.name].time) > 4:
                own = signals[item.name].time
                read = np.interp(own, whole.t, whole.u[:, j])
                course = InterpolatedInput.of(own, read, vehicle.signals[item.name].noise)
            found.append(course)
        return found

    def _tracked(self, whole: Timeline) -> tuple[Floats, Floats]:
        """Measured rates of the tracked states at every event, and their values without the noise
        of their readings; shape (K, tracked) each."""
        model = self.compiled.model
        rate = np.zeros((len(self.line.t), self.tracked.sum()))
        value = rate.copy()
        edges = self.line.t[1:][np.diff(self.acts) != 0]
        for j, i in enumerate(np.flatnonzero(self.tracked)):
            read = whole.sensor == model.sensor(model.states[i].name)
            t, z = whole.t[read], whole.z[read]
            # no line is drawn across the place where another equation takes over
            pieces = np.split(np.arange(len(t)), np.searchsorted(t, edges))
            pieces = [k for k in pieces if len(k)]
            rates = [
                slope(Signal.of("", "", t[k], z[k]), 0.0, RATE_WINDOW)[0].value for k in pieces
            ]
            still = [calm(t[k], z[k], np.ones(len(k), bool)) for k in pieces]
            rate[:, j] = np.interp(self.line.t, t, np.concatenate(rates))
            value[:, j] = np.interp(self.line.t, t, np.concatenate(still))
        return rate, value


@dataclass(frozen=True, slots=True)
class _Delay:
    """A ``signal`` is late by so many s times ``size``, 1 or one per event, the most of which is
    its ``reach``; the number stands in ``row`` of the effects' and is the compiled model's
    ``theta``."""

    signal: str
    row: int
    theta: int
    size: float | Floats
    reach: float


def _delays(signals: Signals, compiled: Compiled, t: Floats) -> list[_Delay]:
    """What effects delay at events at ``t`` (K)."""
    numbers = [(effect.name, key) for effect, key in compiled.model.numbers]
    found = []
    for effect in compiled.model.effects:
        for signal, key in effect.delays.items():
            varies, name = effect.lateness.get(signal), (effect.name, key)
            size, reach = (_late_by(varies, signals, t), varies.reach) if varies else (1.0, 1.0)
            place = numbers.index(name), compiled.thetas.index(name)
            found.append(_Delay(signal, *place, size, reach))
    return found


def _late_by(varies: Lateness, signals: Signals, t: Floats) -> Floats:
    """A delay at events at ``t`` (K), s; the most where nothing is known of what it goes with."""
    if varies.goes_with == TIME:
        return np.interp(t, varies.at, varies.seconds)
    if varies.goes_with not in signals.available:
        return np.full(len(t), varies.most)
    known = signals[varies.goes_with].only_valid()
    late = np.interp(known.at(t), varies.at, varies.seconds)
    return np.where(t < known.time[0], varies.most, late)


def _sloped(
    model: Model, dragging: Sequence[int], noise: Sequence[float], ar: Sequence[float]
) -> Mapping[int, Callable[[Floats, Floats, NDArray[np.bool_]], Floats]]:
    """Indices of inputs that may be late, or that are ``dragging`` something along, to how they are
    freed of their ``noise``, which each has at most, and its ``ar``."""
    late = {model.input(signal) for effect in model.effects for signal in effect.delays}
    # where a signal moves in short pulses, they are no more noise than its sensor has
    slow = {j: partial(calm, narrow=SLOPE, wide=2.0 * SLOPE, most=noise[j]) for j in late}
    return slow | {j: _dragging(noise[j], ar[j]) for j in dragging}


def _dragging(noise: float, ar: float) -> Callable[[Floats, Floats, NDArray[np.bool_]], Floats]:
    """How an input that drags something along is freed of its noise, wherever it acts."""
    return lambda time, value, acts: path(time, value, noise, ar)
