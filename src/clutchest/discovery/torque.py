"""Clutch torque open loop: what the equations make of the inputs, beside what was measured."""

from __future__ import annotations

import numpy as np

from clutchest.inference.objective import Linearisation
from clutchest.inference.problem import Problem
from clutchest.inference.while_sliding import while_sliding
from clutchest.signals import Floats

NAMES = ("measured_torque", "clutch_torque")

Torques = tuple[Floats, Floats, Floats]


def torques(problem: Problem, fit: Linearisation) -> list[Torques]:
    """(time s, measured Nm, simulated Nm) of every drive at a fit while the surfaces slide.

    Temperatures, wear and friction follow from the numbers of the fit alone; only speeds and
    positions are as measured.  What a cause makes of the measurement itself, as a wrong report of
    the engine's torque does, is simulated with it.
    """
    return [_of_drive(problem, fit, drive) for drive in range(len(problem.drives))]


def _of_drive(problem: Problem, fit: Linearisation, drive: int) -> Torques:
    p, g, *_ = problem.numbers(fit.theta, fit.shapes, drive)
    nominal = problem.compiled.p  # what was measured does not change with what is believed
    off = np.zeros_like(g)
    still = [
        i
        for i, (effect, n) in enumerate(problem.compiled.model.numbers)
        if any(s.key == n and s.shape for s in effect.parameters)
    ]
    off[still] = problem.compiled.g[still]
    time, (read, told, made) = while_sliding(
        problem.drives[drive], fit.implied[drive], NAMES, (nominal, off), (nominal, g), (p, g)
    )
    return time, read[0], made[1] + read[0] - told[0]
