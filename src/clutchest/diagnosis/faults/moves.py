"""What an actuator did, move by move: how far it had to move at least, and how far it moved."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from clutchest.models.fault import Actuator, Follower
from clutchest.signals import Floats, Signal
from clutchest.vehicle import Vehicle

MOVED = 6.0  # standard deviations: a move of the leader beyond doubt
LONGEST_S = 3.0  # s within which it must take place
LASTS_S = 0.25  # s over which the drive of an actuator must last, and its output has followed
SCATTER = 10.0  # standard deviations: range of readings of an output that rests
CLEAR = 10.0  # times as far as resting readings scatter an actuator has to move at least


class Move(NamedTuple):
    """From ``begin`` to ``end`` s the leader moved or rose by ``asked``, for which the follower has
    to move by ``least``, and it moved by ``moved``; before, it was last seen to move at ``last``
    s."""

    last: float
    begin: float
    end: float
    asked: float
    least: float
    moved: float


class Moves(Protocol):
    """Finds the moves in new samples; keeps what the next samples need.

    ``subject``: what sticks; ``leader``, ``follower``: the signals; ``std`` of a ``moved``;
    ``never``: there was no move, in words; ``needed``: how many without motion are a fault, however
    clear each of them is; ``harmless``: the equations hold all the same.
    """

    subject: str
    leader: str
    follower: str
    std: float
    never: str
    needed: int
    harmless: bool

    def take(self, follower: Signal, leader: Signal) -> list[Move]:
        """The moves that new samples complete."""


class Following:
    """Moves of a leader between samples of its follower, beyond the leader's free stroke.

    Both as the middle one of three readings has them: a single reading far off, of which heavy
    tails of noise have some in an hour, is a move and a move back that nothing follows.
    """

    never = "never moved beyond its free stroke"
    needed, harmless = 3, True

    def __init__(self, vehicle: Vehicle, pair: Follower) -> None:
        self.subject, self.leader, self.follower = pair.subject, pair.leader, pair.follower
        follower, leader = (vehicle.signals[n].noise for n in (pair.follower, pair.leader))
        self.stroke, self.std = pair.stroke, float(np.hypot(follower, leader))
        self._last: tuple[float, float, float] | None = None
        self._latest = np.zeros((0, 3))  # the last two samples: time, follower, leader

    def take(self, follower: Signal, leader: Signal) -> list[Move]:
        """See :meth:`Moves.take`."""
        moves = []
        leading = np.interp(follower.time, leader.time, leader.value)
        new = np.column_stack([follower.time, follower.value, leading])
        samples = np.concatenate([self._latest, new])
        self._latest = samples[-2:]
        for t, f, m in _middle_of_three(samples).tolist():
            before = self._last
            if before is None or t - before[0] > LONGEST_S or min(m, before[2]) < self.stroke:
                self._last = t, f, m
            elif abs(m - before[2]) > MOVED * np.sqrt(2.0) * self.std:
                asked = m - before[2]
                moves.append(Move(before[0], before[0], t, asked, asked, f - before[1]))
                self._last = t, f, m
        return moves


def _middle_of_three(samples: Floats) -> Floats:
    """Of samples (k, c) the middle value of every three in a row (k − 2, c)."""
    before, own, after = samples[:-2], samples[1:-1], samples[2:]
    lower, upper = np.minimum(before, own), np.maximum(before, own)
    return np.maximum(lower, np.minimum(upper, after))


@dataclass(slots=True)
class _Window:
    """The highest and lowest of drive and output within one of the windows of LASTS_S."""

    begin: float
    drive: tuple[float, float]
    output: tuple[float, float]

    def over(self, drive: Floats, output: Floats) -> None:
        """With further samples."""
        self.drive = _range(drive, self.drive)
        self.output = _range(output, self.output)


class Actuation:
    """Rises of an actuator's drive that last, each from the lowest level since the one before.

    The travel is the range of the output's readings from the low level to the end of the rise, less
    what noise makes of it: an actuator that has just returned has moved as well.
    """

    never = "never rose by more than friction may hold"
    needed, harmless = 2, False

    def __init__(self, vehicle: Vehicle, actuator: Actuator) -> None:
        self.subject, self.leader = actuator.subject, actuator.drive
        self.follower, self.least = actuator.output, actuator.least
        self.std = vehicle.signals[actuator.output].noise
        self.parameters = {key: p.value for key, p in vehicle.parameters.items()}
        self._window: _Window | None = None  # that is not complete yet
        self._last = 0.0  # s, begin of the last window in which the output moved
        self._low: _Window | None = None  # of the lowest drive, its output's range up to now

    def take(self, follower: Signal, leader: Signal) -> list[Move]:
        """See :meth:`Moves.take`."""
        return [move for window in self._complete(follower, leader) if (move := self._rise(window))]

    def _complete(self, follower: Signal, leader: Signal) -> Iterator[_Window]:
        """Windows that end with samples of a later one."""
        moments = np.union1d(follower.time, leader.time)
        number = np.floor(moments / LASTS_S)
        for begin in np.unique(number) * LASTS_S:
            drive, output = (
                s.value[slice(*np.searchsorted(s.time, (begin, begin + LASTS_S)))]
                for s in (leader, follower)
            )
            if self._window is not None and begin <= self._window.begin:
                self._window.over(drive, output)
                continue
            if self._window is not None:
                yield self._window
            self._window = _Window(begin, _range(drive), _range(output))

    def _rise(self, window: _Window) -> Move | None:
        """The rise that ends with this window, if there is one."""
        low, rest, last = self._low, SCATTER * self.std, self._last
        if window.output[1] - window.output[0] > rest:
            self._last = window.begin
        if not _seen(window) or low is None or window.drive[1] <= low.drive[1]:
            self._low = window if _seen(window) else None
            return None
        low.output = _range(np.array(window.output), low.output)
        least = self.least(self.parameters, low.drive[1], window.drive[0])
        if least < CLEAR * rest or window.begin - low.begin < 2.0 * LASTS_S:
            return None
        self._low = window
        asked, moved = window.drive[0] - low.drive[1], low.output[1] - low.output[0] - rest
        end = window.begin + LASTS_S
        return Move(min(last, low.begin), low.begin, end, asked, least, max(moved, 0.0))


def _seen(window: _Window) -> bool:
    """Whether it has readings of both signals."""
    return bool(np.isfinite([*window.drive, *window.output]).all())


def _range(values: Floats, before: tuple[float, float] = (np.inf, -np.inf)) -> tuple[float, float]:
    """Lowest and highest of ``values`` and of a range ``before``; (∞, −∞) of none."""
    return float(min(values.min(initial=np.inf), before[0])), float(
        max(values.max(initial=-np.inf), before[1])
    )
