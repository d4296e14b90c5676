"""Runs of samples that are all the same, how long healthy ones get, and the tests on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from clutchest.diagnosis.faults.fault import Alarm, StreamTest
from clutchest.diagnosis.sequential import (
    COUNT,
    EDGE,
    new_tail,
    tail_bound,
    tail_mean,
    tail_take,
)
from clutchest.signals import Floats

USUAL = 2.0  # samples in a run of a lively signal, before any has been seen
RUN, BEGUN, LAST, SAMPLES, SPAN, STUCK = range(6)


class Repeats:
    """State of one count of repeats, carried from batch to batch."""

    def __init__(self) -> None:
        self.tail = new_tail(USUAL, grain=1.0)
        self.state = np.zeros(6)

    def take(
        self, time: Floats, same: NDArray[np.bool_], judged: NDArray[np.bool_], per_1000h: float
    ) -> list[tuple[float, float, float]]:
        """Runs that are too long: (begun, detected, ended) s, ended inf while it lasts and begun
        −inf where the run of an earlier batch ended.

        ``same`` (n): as the sample before; ``judged`` (n): a repeat would mean something.
        """
        found = np.zeros((len(time) + 1, 3))
        n = _runs(time, same, judged, self.tail, self.state, per_1000h, found)
        return [tuple(row) for row in found[:n].tolist()]

    @property
    def bound(self) -> float:
        """The longest run, samples, that may be chance."""
        return float(tail_bound(self.tail, self._per_1000h()))

    def _per_1000h(self) -> float:
        period = self.state[SPAN] / max(self.state[SAMPLES], 1.0)
        return 3.6e6 / max(period * tail_mean(self.tail), 1e-9)

    @property
    def enabled(self) -> float:
        """s in which a repeat would have meant something."""
        return float(self.state[SPAN])

    def words(self) -> str:
        """What is known of healthy runs."""
        return (
            f"more than {self.bound:.3g} equal samples on end, from {int(self.tail[COUNT])} "
            f"runs of {tail_mean(self.tail):.2g} on average"
        )


class RepeatTest(StreamTest):
    """A test that fails where too many samples or payloads on end are all the same."""

    def __init__(self, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        self.repeats = Repeats()

    def judge(
        self,
        time: Floats,
        same: NDArray[np.bool_],
        judged: NDArray[np.bool_],
        what: Callable[[float, float], str],
    ) -> None:
        """Take what is new as :meth:`Repeats.take` does; ``what`` is wrong from … to, in words."""
        for begun, detected, ended in self.repeats.take(time, same, judged, self.per_1000h):
            if ended < np.inf:
                self.heal(ended)
            else:
                self.fail(Alarm(begun, detected, what=what(begun, detected)))
        self.enabled = self.repeats.enabled

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; samples or payloads."""
        return self.repeats.bound if self.enabled else None


@njit(cache=True)
def _runs(time, same, judged, tail, state, per_1000h, found):  # type: ignore[no-untyped-def]
    n = 0
    for k in range(len(time)):
        if not judged[k]:
            if state[STUCK]:
                found[n] = -np.inf, np.nan, time[k]
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
                    found[n] = -np.inf, np.nan, time[k]
                    n += 1
                else:
                    tail_take(tail, state[RUN])
            state[RUN], state[BEGUN], state[STUCK] = 1.0, time[k], 0.0
        state[LAST] = time[k]
        mean = tail_mean(tail)
        if state[RUN] > EDGE * mean and not state[STUCK]:
            period = state[SPAN] / max(state[SAMPLES], 1.0)
            if state[RUN] > tail_bound(tail, 3.6e6 / max(period * mean, 1e-9) / per_1000h):
                state[STUCK] = 1.0
                found[n] = state[BEGUN], time[k], np.inf
                n += 1
    return n
