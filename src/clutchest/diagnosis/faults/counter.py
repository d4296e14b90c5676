"""The counter does not count frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.wrong_frames import WrongFrames
from clutchest.signals import Traffic

SURE = 0.35  # of a period: how far off its beat a frame may be and still say how many went before


class Counter(WrongFrames):
    """The counter goes on by another number than frames have come or been lost.

    Lost frames make it jump too, by as many as the time since the last one has room for.
    """

    kind = "counter"

    def wrong(self, traffic: Traffic, alive: NDArray) -> tuple[NDArray, NDArray]:
        """See :meth:`WrongFrames.wrong`."""
        if len(traffic) < 2 or not traffic.turns:
            return np.zeros(0, np.intp), np.zeros(0, bool)
        gaps = np.diff(alive)
        passed = gaps / np.median(gaps)
        whole = np.rint(passed)
        sure = (np.abs(passed - whole) < SURE) & (whole >= 1) & (whole < traffic.turns)
        sure &= traffic.step[1:] >= 0
        rows = np.flatnonzero(sure)
        return rows + 1, traffic.step[1:][rows] != whole[rows]
