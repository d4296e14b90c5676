"""The counter does not count frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.wrong_frames import WrongFrames
from clutchest.signals import Traffic

ROOM = 0.6  # of a period, for every frame that is said to have been lost


class Counter(WrongFrames):
    """The counter stands still, or goes on by more frames than the time since the last one has room
    for.

    By one it may go on at any time: frames that waited somewhere come close together.
    """

    kind = "counter"
    harmless = True

    def wrong(self, traffic: Traffic, alive: NDArray) -> tuple[NDArray, NDArray]:
        """See :meth:`WrongFrames.wrong`."""
        rows = np.flatnonzero(traffic.step >= 0) if traffic.turns else np.zeros(0, np.intp)
        if not len(rows):
            return rows, np.zeros(0, bool)
        before = np.concatenate([[self.last], alive[:-1]])
        gaps, step = (alive - before)[rows], traffic.step[rows]
        self.last = float(alive[-1])
        period = traffic.period or self.period or float(np.median(gaps))
        lost = step.astype(float) - 1.0
        return rows, (step == 0) | (gaps < ROOM * lost * period)
