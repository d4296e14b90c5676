"""Clutch torque open loop: what the equations make of the inputs, beside what was measured."""

from __future__ import annotations

import casadi as ca
import numpy as np

from clutchest.identify.linearised import LinearDrive, Problem
from clutchest.identify.maximum import Look
from clutchest.signals import Floats

NAMES = ("measured_torque", "clutch_torque")

Torques = tuple[Floats, Floats, Floats]


def torques(problem: Problem, look: Look) -> list[Torques]:
    """(time s, measured Nm, simulated Nm) of every drive at ``look`` while the surfaces slide.

    Temperatures, wear and friction follow from the numbers at ``look`` alone; only speeds and
    positions are as measured.  Leaves the drives linearised at ``look``, without derivatives.
    """
    problem.linearise(look.theta, look.shapes, np.zeros(0, np.int64))
    return [_of_drive(problem, look, drive) for drive in problem.drives]


def _of_drive(problem: Problem, look: Look, own: LinearDrive) -> Torques:
    model, line = problem.compiled.model, own.line
    p, g, _ = problem.numbers(look.theta, look.shapes)
    e = model.expressions()
    if not set(NAMES) <= set(e.quantities.names()):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    wanted = ca.vertcat(*(getattr(e.quantities, name) for name in NAMES))
    rows = np.flatnonzero(own.acts & line.W[line.row].all(axis=1))
    if not len(rows):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    nominal = problem.compiled.p  # what was measured does not change with what is believed
    off = np.zeros_like(g)
    still = [i for i, (effect, n) in enumerate(model.numbers)
             if any(s.key == n and s.shape for s in effect.parameters)]  # fmt: skip
    off[still] = problem.compiled.g[still]

    def evaluated(p_: Floats, g_: Floats) -> Floats:
        return e.along(wanted, own.states[rows], line.u[rows], line.W[line.row[rows]], p_, g_)

    return line.t[rows], evaluated(nominal, off)[0], evaluated(p, g)[1]
