"""Quantities of the equations while the surfaces slide, at even steps in time: events come
closer together where more happens, and would count it more often."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.inference.operating_point import OperatingPoint
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.signals import Floats

PERIOD = 0.05  # s


def while_sliding(
    drive: PreparedDrive,
    at: OperatingPoint,
    names: Sequence[str],
    *numbers: tuple[Floats, Floats],
) -> tuple[Floats, list[Floats]]:
    """Times (k) in s, and quantities (len(names), k) of the equations for each pair of parameters
    and numbers of effects, at the states of an operating point and at measured
    inputs.  Nothing where the equations do not have these quantities."""
    line, e = drive.line, drive.compiled.model.expressions()
    slides = drive.tracked.act & line.W[line.row].all(axis=1)
    time = np.arange(line.t[0], line.t[-1], PERIOD)
    ends = np.searchsorted(line.t, time)  # the event that ends the interval around
    inside = slides[ends] & slides[np.maximum(ends - 1, 0)]
    time, ends = time[inside], ends[inside]
    if not len(time) or not set(names) <= set(e.quantities.names()):
        return np.zeros(0), [np.zeros((len(names), 0)) for _ in numbers]
    wanted = e.together(names)
    states, inputs = (
        np.column_stack([np.interp(time, line.t, column) for column in table.T])
        for table in (at.states, line.u)
    )
    flags = line.W[line.row[ends]]
    return time, [e.along(wanted, states, inputs, flags, p, g) for p, g in numbers]
