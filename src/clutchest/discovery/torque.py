"""Clutch torque open loop: what the equations make of the inputs, beside what was measured."""

from __future__ import annotations

import numpy as np

from clutchest.inference.linearisation import LinearisedDrive
from clutchest.inference.map_fit import Look
from clutchest.inference.unknowns import Problem
from clutchest.inference.while_sliding import while_sliding
from clutchest.signals import Floats

NAMES = ("measured_torque", "clutch_torque")

Torques = tuple[Floats, Floats, Floats]


def torques(problem: Problem, look: Look) -> list[Torques]:
    """(time s, measured Nm, simulated Nm) of every drive at ``look`` while the surfaces slide.

    Temperatures, wear and friction follow from the numbers at ``look`` alone; only speeds and
    positions are as measured.  What a cause makes of the measurement itself, as a wrong report of
    the engine's torque does, is simulated with it.  Leaves the drives linearised at ``look``,
    without derivatives.
    """
    problem.linearise(look.theta, look.shapes, np.zeros(0, np.int64))
    return [_of_drive(problem, look, drive) for drive in problem.drives]


def _of_drive(problem: Problem, look: Look, own: LinearisedDrive) -> Torques:
    p, g, _ = problem.numbers(look.theta, look.shapes)
    nominal = problem.compiled.p  # what was measured does not change with what is believed
    off = np.zeros_like(g)
    still = [
        i
        for i, (effect, n) in enumerate(problem.compiled.model.numbers)
        if any(s.key == n and s.shape for s in effect.parameters)
    ]
    off[still] = problem.compiled.g[still]
    time, (read, told, made) = while_sliding(own, NAMES, (nominal, off), (nominal, g), (p, g))
    return time, read[0], made[1] + read[0] - told[0]
