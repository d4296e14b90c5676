"""Gains that begin within a drive: a fault is put into the equations from its onset on.

The innovations are then a smooth function of its size, as they are of a gain that has always acted,
so that whatever fits one fits the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.inference.linearisation import Modulation
from clutchest.inference.prepared_drive import LaterGain, PreparedDrive
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import UnknownGain
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats


def beginning_at(problem: Problem, gain: int, onset: float, *, grows: bool = False) -> Problem:
    """The problem in which a ``gain`` (index of a shared theta) acts from ``onset`` s on; where it
    ``grows``, as a rate times the time since the drive's start does, it has not grown before."""
    unknown = problem.thetas[gain]
    assert isinstance(unknown, UnknownGain) and gain < problem.shared
    numbers = [(effect.name, key) for effect, key in problem.compiled.model.numbers]
    row = numbers.index((unknown.effect, unknown.key))

    def with_onset(drive: PreparedDrive) -> PreparedDrive:
        t = drive.line.t
        acts = np.zeros(len(t))
        acts[t > onset] = 1.0 - onset / t[t > onset] if grows else 1.0
        return replace(drive, later=(LaterGain(row, gain, acts),))

    return replace(problem, drives=tuple(map(with_onset, problem.drives)))


def from_the_start(problem: Problem, lin: Linearisation, gain: int) -> Floats:
    """Derivatives (K, 1), before whitening, of the first drive at a linearisation by a ``gain``
    (index) that acts throughout, though its own begins later."""
    always = [Modulation(np.zeros((len(d.line.t), 0)), np.array([-1])) for d in problem.drives]
    return problem.modulated(lin.theta, lin.shapes, lin.implied, np.array([gain]), always)[0]
