"""Frames with a wrong counter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.wrong_frames import WrongFrames
from clutchest.signals import Traffic

LEAST_PERIODS = 0.6  # periods per lost frame that a counter's jump implies, at least


class Counter(WrongFrames):
    """The counter stands still, or advances by more frames than fit into the time since the last
    frame.

    An advance by one is valid at any time: frames delayed by a busy node arrive close together.
    """

    kind = "counter"
    harmless = True

    def wrong(self, traffic: Traffic, bus_time: NDArray) -> tuple[NDArray, NDArray]:
        """See :meth:`WrongFrames.wrong`."""
        rows = np.flatnonzero(traffic.step >= 0) if traffic.turns else np.zeros(0, np.intp)
        if not len(rows):
            return rows, np.zeros(0, bool)
        before = np.concatenate([[self.last], bus_time[:-1]])
        gaps, step = (bus_time - before)[rows], traffic.step[rows]
        self.last = float(bus_time[-1])
        period = traffic.period or self.period or float(np.median(gaps))
        lost = step.astype(float) - 1.0
        return rows, (step == 0) | (gaps < LEAST_PERIODS * lost * period)
