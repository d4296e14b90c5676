"""Runs of identical samples: the tail of their lengths in a healthy vehicle, and the test on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.stream_test import Alarm, StreamTest
from clutchest.diagnosis.sequential import (
    COUNT,
    EDGE,
    new_tail,
    tail_bound,
    tail_mean,
    tail_take,
)
from clutchest.native import compiled
from clutchest.signals import Floats

FIRST_RUNS = 20.0  # where the prior is a guess: so many are observed before the test begins,
FIRST_S = 30.0  # unless one of them lasts for so long, s
PRIOR_RUN = 2.0  # samples in a run of identical ones, before any has been observed
RUN, BEGUN, LAST, SAMPLES, SPAN, STUCK = range(6)


class Repeats:
    """State of a count of repeated samples, carried from batch to batch, for ``per_1000h`` false
    alarms.  ``guessed``: that noise changes them is not known, but to be observed first."""

    def __init__(self, per_1000h: float, guessed: bool = False) -> None:
        self.per_1000h = per_1000h
        self.first = FIRST_RUNS if guessed else 0.0
        self.tail = new_tail(PRIOR_RUN, grain=1.0)
        self.state = np.zeros(6)

    def take(
        self, time: Floats, same: NDArray[np.bool_], tested: NDArray[np.bool_]
    ) -> list[tuple[float, float, float]]:
        """Runs that are too long: (begun, detected, ended) s, ended inf while it lasts and begun
        −inf where the run of an earlier batch ended.

        ``same`` (n): equal to the sample before; ``tested`` (n): a healthy sample would differ.
        """
        changes = np.zeros((len(time) + 1, 3))
        n = _runs(time, same, tested, self.tail, self.state, (self.per_1000h, self.first), changes)
        return [tuple(row) for row in changes[:n].tolist()]

    @property
    def bound(self) -> float:
        """The longest run, samples, that may be chance."""
        period = self.state[SPAN] / max(self.state[SAMPLES], 1.0)
        runs = 3.6e6 / max(period * tail_mean(self.tail), 1e-9)  # in 1000 h
        return float(tail_bound(self.tail, runs / self.per_1000h))

    @property
    def enabled(self) -> float:
        """s in which a repeated sample could have been detected."""
        return float(self.state[SPAN])

    def words(self, samples: str) -> str:
        """The limit and the data that it rests on; ``samples`` or payloads."""
        return (
            f"limit: {self.bound:.3g} consecutive identical {samples}, estimated from "
            f"{int(self.tail[COUNT])} runs of {tail_mean(self.tail):.2g} on average"
        )


class RepeatTest(StreamTest):
    """A test that fails where too many consecutive samples or payloads are identical."""

    def __init__(self, subject: str, per_1000h: float, guessed: bool = False) -> None:
        super().__init__(subject, per_1000h)
        self.repeats = Repeats(per_1000h, guessed)

    def test(
        self,
        time: Floats,
        same: NDArray[np.bool_],
        tested: NDArray[np.bool_],
        what: Callable[[float, float], str],
    ) -> None:
        """Test new samples as :meth:`Repeats.take` does; ``what(begun, detected)`` describes the
        fault."""
        for begun, detected, ended in self.repeats.take(time, same, tested):
            if ended < np.inf:
                self.heal(ended)
            else:
                self.fail(Alarm(begun, detected, what=what(begun, detected)))
        self.enabled = self.repeats.enabled

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; samples or payloads."""
        return self.repeats.bound if self.enabled else None


@compiled
def _runs(time, same, tested, tail, state, rate, changes):  # type: ignore[no-untyped-def]
    n = 0
    per_1000h, first = rate
    for k in range(len(time)):
        if not tested[k]:
            if state[STUCK]:
                changes[n] = -np.inf, np.nan, time[k]
                n += 1
            state[RUN], state[STUCK] = 0.0, 0.0
            continue
        if state[RUN] and same[k]:
            state[RUN] += 1.0
            state[SAMPLES] += 1.0
            state[SPAN] += min(time[k] - state[LAST], 10.0)
        else:
            if state[RUN]:
                state[SAMPLES] += 1.0
                state[SPAN] += min(time[k] - state[LAST], 10.0)
                if state[STUCK]:
                    changes[n] = -np.inf, np.nan, time[k]
                    n += 1
                else:
                    tail_take(tail, state[RUN])
            state[RUN], state[BEGUN], state[STUCK] = 1.0, time[k], 0.0
        state[LAST] = time[k]
        mean = tail_mean(tail)
        known = tail[COUNT] >= first or time[k] - state[BEGUN] > FIRST_S
        if known and state[RUN] > EDGE * mean and not state[STUCK]:
            period = state[SPAN] / max(state[SAMPLES], 1.0)
            if state[RUN] > tail_bound(tail, 3.6e6 / max(period * mean, 1e-9) / per_1000h):
                state[STUCK] = 1.0
                changes[n] = state[BEGUN], time[k], np.inf
                n += 1
    return n
