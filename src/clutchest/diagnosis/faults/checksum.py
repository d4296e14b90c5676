"""Frames with a wrong checksum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.wrong_frames import WrongFrames
from clutchest.signals import Traffic


class Checksum(WrongFrames):
    """The checksum is not that of the payload."""

    kind = "checksum"
    masked_by = ("missing",)

    def wrong(self, traffic: Traffic, bus_time: NDArray) -> tuple[NDArray, NDArray]:
        """See :meth:`WrongFrames.wrong`."""
        return np.arange(len(traffic)), ~traffic.sound
