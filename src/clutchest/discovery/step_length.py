"""Whether the longest steps of a user's own equations resolve them.

What a fit takes for exact are the equations between readings, so that an error of their integration
adds up over a drive, and passes for one of the equations.  It shows where steps half as long
predict something else.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from clutchest.discovery.verdict import UNNAMED
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation


def too_long(problem: Problem, fit: Linearisation) -> list[str]:
    """A warning where steps half as long change the readings that a ``fit`` predicts, in all by
    what would pass for an error: as far off as its chance is :data:`UNNAMED`."""
    finer = tuple(
        replace(drive, line=replace(drive.line, longest=drive.line.longest / 2.0))
        for drive in problem.drives
    )
    own, half = (
        [each.r for each in of.linearise(fit.theta, fit.shapes, NO_DERIVATIVES)]
        for of in (problem, replace(problem, drives=finer))
    )
    sensor = np.concatenate([drive.readings.sensor for drive in problem.drives])
    r, change = np.concatenate(own), np.concatenate(half) - np.concatenate(own)
    off = {
        problem.compiled.model.sensors[i].name: float(
            np.linalg.norm(change[sensor == i]) / max(np.sqrt(np.mean(r[sensor == i] ** 2)), 1.0)
        )
        for i in np.unique(sensor)
    }
    name = max(off, key=lambda each: off[each])
    if not off[name] ** 2 > chdtri(1.0, UNNAMED):
        return []
    return [
        f"the steps (Model.longest) are too long for these equations: half as long, they predict "
        f"readings of {name} that are {off[name]:.2g} standard deviations away over the log, which "
        "passes for an error of the equations"
    ]
