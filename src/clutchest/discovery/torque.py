"""The compared pair of a machine open loop: simulated from the inputs, beside the measurement."""

from __future__ import annotations

import numpy as np

from clutchest.inference.problem import Problem
from clutchest.inference.while_sliding import while_sliding
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

Torques = tuple[Floats, Floats, Floats]


def torques(problem: Problem, fit: Linearisation) -> list[Torques]:
    """(time s, measured, simulated) of every drive at a fit while the equations act; empty where
    the machine declares no pair to compare.

    States follow from the parameters of the fit alone, only inputs are as measured.  The effect of
    a cause on the measurement itself, as of a wrong sensor gain, is simulated with it.
    """
    return [_of_drive(problem, fit, drive) for drive in range(len(problem.drives))]


def _of_drive(problem: Problem, fit: Linearisation, drive: int) -> Torques:
    compared = problem.compiled.machine.compared
    if compared is None:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    p, g, *_ = problem.numbers(fit.theta, fit.shapes, drive)
    nominal = problem.compiled.p  # the measurement does not depend on the unknowns
    off = np.zeros_like(g)
    shapes = [
        i
        for i, (effect, n) in enumerate(problem.compiled.model.numbers)
        if any(s.key == n and s.shape for s in effect.parameters)
    ]
    off[shapes] = problem.compiled.g[shapes]
    names = compared.measured, compared.simulated
    time, (nominal_pair, reported, extended) = while_sliding(
        problem.drives[drive], fit.implied[drive], names, (nominal, off), (nominal, g), (p, g)
    )
    measured = nominal_pair[0]
    return time, measured, extended[1] + measured - reported[0]
