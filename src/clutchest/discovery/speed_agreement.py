"""Whether two speeds that slip on each other agree where they do not: a sensor that counts a wrong
number of teeth, or a message that is late, shows there before any equation is asked.

The regimes are decided by these speeds.  Where one of them is late, or off in proportion, they are
decided wrongly, and no curve beside the equations as they then are puts that right: so the speeds
are made to agree first, and the search looks for what is wrong beside that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.special import ndtr

from clutchest.discovery.where import Where
from clutchest.inference.covariates import hats
from clutchest.shown import plus_minus
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

STEP, SMOOTH = 0.02, 0.04  # s, of the grid, and the standard deviation of its smoothing
EARLIEST, LATEST, APART = -0.2, 0.5, 0.02  # s, searched
WIDE, CLOSE, STEPS = 0.05, 6.0, 12  # of the speed: slip that may be none, at first; in the end, in
# standard deviations of the sensors' noise; so many steps from one to the other
NOISE = 0.25  # of that width, squared: less is no disagreement
TURNS = 0.15  # of its highest speed: a shaft that turns
LEAST = 20.0  # s, that the two turn together
AROUND, MOSTLY = 1.0, 0.9  # s, of which they do in this share: just before, they slip a little
BLOCK = 1.0  # s, in which what is left may correlate
RATIO_SPREAD = 0.001  # of two healthy sensors, one over the other
SURE = 5.0  # standard deviations, the healthy spread among them
PLACES = 4  # of a delay in s that a file states
BENDS = 4  # knots of a ratio over speed
NEAR = 4.0  # times that width, about a ratio for all speeds: where one of them is sought
SPAN = 0.2  # of the highest speed: of fewer speeds, no ratio tells whether it changes with them
EXPLAINS = 3.0  # standard deviations of what it explains, by blocks: not in a few of them alone


@dataclass(frozen=True, slots=True)
class RatioOverSpeed:
    """A ``ratio`` less 1 (k) that changes with the speed, at values ``speed`` (k) rad/s of it, and
    its standard deviations (k)."""

    speed: Floats
    ratio: Floats
    std: Floats

    @property
    def largest(self) -> tuple[float, float]:
        """The ratio that is the most, and its standard deviation."""
        k = int(np.argmax(np.abs(self.ratio)))
        return float(self.ratio[k]), float(self.std[k])

    @property
    def changes(self) -> bool:
        """Whether it is not the same at all speeds, surely."""
        low, high = int(np.argmin(self.ratio)), int(np.argmax(self.ratio))
        within = np.linalg.norm([RATIO_SPREAD, self.std[low], self.std[high]])
        return float(self.ratio[high] - self.ratio[low]) > SURE * float(within)

    def at(self, speed: Floats) -> Floats:
        """The ratio less 1 at each ``speed`` (n)."""
        return np.interp(speed, self.speed, self.ratio)


@dataclass(frozen=True, slots=True)
class Disagreement:
    """What two speeds disagree by while they turn together: the ``first`` over the ``second`` is 1
    + ``ratio``, the second is ``late`` s; each 0 where it is no more than a healthy pair's, else
    with its standard deviation; ``p_value`` of the surer one.  Of a ratio that changes with the
    speed, ``ratio`` is the largest, and all of it is ``over`` the second's speed."""

    first: str
    second: str
    ratio: float
    ratio_std: float
    late: float
    late_std: float
    p_value: float
    over: RatioOverSpeed | None = None

    @property
    def wrong(self) -> str:
        """Which of the two has a wrong ratio: the first, though it may be the second; of a ratio
        that changes with the speed that which reads less, as what counts teeth loses them."""
        return self.second if self.over is not None and self.ratio > 0.0 else self.first

    def before(self, other: Where | None) -> Where:
        """The sensor that is wrong; behind it whatever ``other`` equations have an error."""
        ratio = [f"sensor:{self.wrong}"] if self.ratio else []
        late = [f"timing:{self.second}"] if self.late else []
        found = [
            Where(equation, (equation.partition(":")[2],), p_value=self.p_value)
            for equation in (*ratio, *late)
        ]
        beside = [] if other is None else [replace(other, others=()), *other.others]
        return replace(found[0], others=(*found[1:], *beside))

    @property
    def words(self) -> list[str]:
        """A warning each: what disagrees, and what was done about it."""
        words, together = [], "while they turn together"
        if self.over is not None:
            other = self.first if self.wrong == self.second else self.second
            most = plus_minus(100.0 * abs(self.ratio), 100.0 * self.ratio_std, "%")
            words.append(
                f"{self.wrong} reads up to {most} less than {other} {together}, by another share "
                "at another speed: all else was examined as if it were the one that is wrong"
            )
        elif self.ratio:
            size = plus_minus(100.0 * abs(self.ratio), 100.0 * self.ratio_std, "%")
            more = "more" if self.ratio > 0.0 else "less"
            words.append(
                f"{self.first} reads {size} {more} than {self.second} {together}: one of the two "
                "is wrong; all else was examined as if it were the first"
            )
        if self.late:
            size = plus_minus(1e3 * abs(self.late), 1e3 * self.late_std, "ms")
            later = "later" if self.late > 0.0 else "earlier"
            words.append(
                f"{self.second} is {size} {later} than {self.first} {together}: all else was "
                "examined without that"
            )
        return words

    def corrected(self, signals: Signals) -> Signals:
        """Every drive as it would have been read without it."""
        first, *later = (self._corrected(drive) for drive in signals.drives)
        return replace(first, later=tuple(later))

    def stated(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with the delay in its file, unless it is less than none; a ratio cannot be
        stated."""
        second = vehicle.signals[self.second]
        delay = round(second.delay + self.late, PLACES)
        if not self.late or delay < 0.0:
            return vehicle
        signals = {**vehicle.signals, self.second: replace(second, delay=delay)}
        return replace(vehicle, signals=signals)

    def _corrected(self, drive: Signals) -> Signals:
        """One drive."""
        signals = dict(drive.signals)
        if self.ratio and self.wrong in signals:
            one = signals[self.wrong]
            ratio = self.ratio if self.over is None else self.over.at(one.value)
            share = 1.0 + ratio if self.wrong == self.first else 1.0 / (1.0 + ratio)
            signals[self.wrong] = replace(one, value=one.value / share)
        if self.late and self.second in signals:
            one = signals[self.second]
            moved = replace(one, time=one.time - self.late)
            signals[self.second] = moved.between(0.0, np.nextafter(drive.end, np.inf))
        return replace(drive, signals=signals)


def disagreement(signals: Signals, vehicle: Vehicle) -> Disagreement | None:
    """What the two speeds that slip on each other disagree by where they do not; None where that is
    no more than healthy ones do, or cannot be told: one is missing, or made of a wheel's, or they
    do not turn together for long."""
    event = vehicle.machine.event
    if event is None or len(event.slip) != 2:
        return None
    first, second = event.slip
    if not all(n in vehicle.signals and not vehicle.signals[n].gears for n in event.slip):
        return None
    drives = [
        _Pair.of(drive[first], drive[second], vehicle)
        for drive in signals.drives
        if {first, second} <= drive.available
    ]
    fit = _fitted([pair for pair in drives if pair is not None], _width(vehicle, event.slip))
    if fit is None:
        return None
    healthy = np.array([RATIO_SPREAD, vehicle.signals[second].delay_spread])
    value, std, explains = fit.value.copy(), fit.std.copy(), fit.explains.copy()
    if fit.over is not None:
        (value[0], std[0]), explains[0] = fit.over.largest, np.inf
    within: Floats = np.hypot(std, healthy)
    sure = np.where(explains > EXPLAINS, np.abs(value) / within, 0.0)
    if sure.max() < SURE:
        return None
    ratio, late = map(float, np.where(sure < SURE, 0.0, value))
    p_value = max(4.0 * float(ndtr(-np.max(sure))), float(np.finfo(float).tiny))
    over = fit.over if ratio else None
    return Disagreement(first, second, ratio, float(std[0]), late, float(std[1]), p_value, over)


def _width(vehicle: Vehicle, names: Sequence[str]) -> float:
    """rad/s of slip from which on it is no noise."""
    return CLOSE * float(np.linalg.norm([vehicle.signals[name].noise for name in names]))


@dataclass(frozen=True, slots=True)
class _Pair:
    """The two speeds of a drive at times ``time`` (n) s, where ``first`` (n) is; the ``second`` as
    it was read at its own times."""

    time: Floats
    first: Floats
    second: Signal

    @classmethod
    def of(cls, first: Signal, second: Signal, vehicle: Vehicle) -> _Pair | None:
        """On one grid, smoothed, their stated delays allowed for; None of a short drive."""
        one, two = (
            replace(own, time=own.time - vehicle.signals[own.name].delay)
            for own in (first.only_valid(), second.only_valid())
        )
        begin, end = max(one.time[0], two.time[0]), min(one.time[-1], two.time[-1])
        time = np.arange(begin - EARLIEST, end - LATEST, STEP)
        if len(time) * STEP < LEAST:
            return None
        return cls(time, _smooth(one.at(time)), two)

    def at(self, late: float) -> Floats:
        """The second speed (n) were it so much ``late``."""
        return _smooth(self.second.at(self.time + late))


def _smooth(value: Floats) -> Floats:
    return np.asarray(gaussian_filter1d(value, SMOOTH / STEP, mode="nearest"))


@dataclass(frozen=True, slots=True)
class _Fit:
    """The ratio less 1 and the lateness (2) that most of the time agrees with, and their standard
    deviations; by how many of its own standard deviations each ``explains`` more than none; the
    ratio ``over`` the speed, None where one for all speeds explains as much."""

    value: Floats
    std: Floats
    explains: Floats
    over: RatioOverSpeed | None


def _fitted(pairs: Sequence[_Pair], width: float) -> _Fit | None:
    """Of drives in which slip beyond a ``width`` is none of noise; None where the speeds do not
    turn together for long."""
    if not pairs:
        return None
    speeds = _Speeds.of(pairs, width)
    if np.count_nonzero(speeds.turns) * STEP < LEAST:
        return None
    tried = np.arange(EARLIEST, LATEST + APART / 2, APART)
    losses = [float(np.sum(speeds.loss(speeds.ratio(late), late))) for late in tried]
    near = float(tried[int(np.argmin(losses))])
    value, std, seconds = speeds.refined(near)
    if seconds < LEAST or not np.all(np.isfinite(std)):
        return None
    ratio, late = value
    best = speeds.loss(ratio, late)
    others = speeds.loss(0.0, late), speeds.loss(speeds.ratio(0.0), 0.0)
    over = speeds.over_speed(ratio, late)
    if over and not (over.changes and _clearly(best - speeds.loss(over, late)) > EXPLAINS):
        over = None
    return _Fit(value, std, np.array([_clearly(other - best) for other in others]), over)


def _clearly(gain: Floats) -> float:
    """A gain of blocks (b), in standard deviations of its sum."""
    return float(gain.sum() / max(np.linalg.norm(gain), 1e-12))


@dataclass(frozen=True, slots=True)
class _Speeds:
    """Drives one after the other: the ``first`` speed (n), where the second ``turns`` (n), the
    ``block`` (n) of each sample."""

    pairs: Sequence[_Pair]
    first: Floats
    turns: NDArray[np.bool_]
    block: NDArray[np.int64]
    width: float

    @classmethod
    def of(cls, pairs: Sequence[_Pair], width: float) -> _Speeds:
        first = np.concatenate([pair.first for pair in pairs])
        second = np.concatenate([pair.at(0.0) for pair in pairs])
        block = np.arange(len(first)) // int(BLOCK / STEP)
        return cls(pairs, first, second > TURNS * second.max(), block, width)

    def second(self, late: float) -> Floats:
        """The second speed (n) were it so much ``late``."""
        return np.concatenate([pair.at(late) for pair in self.pairs])

    def ratio(self, late: float) -> float:
        """The first over the second, less 1, were the latter so much ``late``."""
        second = self.second(late)
        wide = self._wide(second)
        column = second[:, None]
        return float(self._robust(self.first - second, column, np.zeros(1), wide, column)[0][0])

    def _wide(self, second: Floats) -> float:
        """rad/s by which the speeds may differ at first while they turn together."""
        return max(WIDE * float(np.median(second[self.turns])), self.width)

    def loss(self, ratio: float | RatioOverSpeed, late: float) -> Floats:
        """What they disagree by in each block, in ``width``, squared; no more where they slip, and
        nothing where it may be noise, of which one lateness or another explains a little."""
        second = self.second(late)
        share = ratio.at(second) if isinstance(ratio, RatioOverSpeed) else ratio
        left = self.first - (1.0 + share) * second
        lost = np.clip((left / self.width) ** 2, NOISE, 1.0) - NOISE
        return np.bincount(self.block, np.where(self.turns, lost, 0.0)).astype(float)

    def refined(self, near: float) -> tuple[Floats, Floats, float]:
        """Ratio less 1 and lateness (2), from ``near`` on, their standard deviations by what is
        left in blocks, and for how many s the speeds agree."""
        second = self.second(near)
        columns = np.column_stack([second, np.gradient(second, STEP)])
        # noise of the second has a slope too, which says nothing of lateness, and which the first
        # has not
        known = np.column_stack([second, np.gradient(self.first, STEP)])
        value, std, seconds = self._with_std(
            self.first - second, columns, np.zeros(2), self._wide(second), known
        )
        return value + np.array([0.0, near]), std, seconds

    def over_speed(self, ratio: float, late: float) -> RatioOverSpeed | None:
        """The ratio over the second's speed, where there is about this one for all speeds, or none;
        None where they turn together at one speed only."""
        second = self.second(late)
        close = self.turns & (np.abs(self.first - second) < WIDE * second)
        low, high = np.quantile(second[close], [0.02, 0.98]) if close.any() else (0.0, 0.0)
        if high - low <= SPAN * high:
            return None
        speed = np.linspace(low, high, BENDS)
        columns, wide = second[:, None] * hats(second, speed), NEAR * self.width
        found = []
        for begin in (0.0, ratio):  # what is far from either may be slip that stays the same
            start = np.full(BENDS, begin)
            value, std, _ = self._with_std(self.first - second, columns, start, wide, columns)
            found.append(RatioOverSpeed(speed, value, std))
        return min(found, key=lambda each: float(np.sum(self.loss(each, late))))

    def _with_std(
        self,
        off: Floats,
        columns: Floats,
        begin: Floats,
        wide: float,
        instruments: Floats,
    ) -> tuple[Floats, Floats, float]:
        """As ``_robust``: coefficients, their standard deviations (c) by what is left in blocks,
        and for how many s they describe the speeds."""
        value, weight = self._robust(off, columns, begin, wide, instruments)
        scores = instruments * (weight * (off - columns @ value))[:, None]
        each = np.column_stack([np.bincount(self.block, score) for score in scores.T])
        inner = np.linalg.inv((instruments.T * weight) @ columns + 1e-9 * np.eye(len(value)))
        std = np.sqrt(np.diag(inner @ (each.T @ each) @ inner.T))
        return value, std, float(np.count_nonzero(weight)) * STEP

    def _robust(
        self, off: Floats, columns: Floats, begin: Floats, wide: float, instruments: Floats
    ) -> tuple[Floats, Floats]:
        """Coefficients (c) of ``columns`` (n, c) in what the speeds are ``off`` (n), by
        ``instruments`` (n, c), which the noise of the columns is not in, from where they ``begin``
        (c) on, and weights (n), by Tukey's, from ``wide`` on ever closer: where the speeds slip on
        each other they do not count."""
        value: Floats = begin
        weight: Floats = np.zeros(len(off))
        for width in np.geomspace(wide, self.width, STEPS):
            left = off - columns @ value
            together = uniform_filter1d((np.abs(left) < width).astype(float), round(AROUND / STEP))
            counts = self.turns & (together > MOSTLY)
            weight = np.where(counts, np.maximum(1.0 - (left / width) ** 2, 0.0) ** 2, 0.0)
            inner = (instruments.T * weight) @ columns + 1e-9 * np.eye(len(value))
            value = np.asarray(np.linalg.solve(inner, (instruments.T * weight) @ off))
        return value, weight
