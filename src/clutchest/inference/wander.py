"""Slow wander: what states that are constant in the equations, and wander in truth, do to readings.

In a healthy vehicle friction wanders with humidity, and the bias of a torque report with the fuel.
Such a random walk is a sum of sines with independent normal coefficients (its Karhunen-Loève
expansion: M. Loève, Probability Theory II, 1978, section 37).
"""

from __future__ import annotations

import numpy as np

from clutchest.inference.linearisation import Modulation, modulated
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.unknowns import StateWander, of_compiled
from clutchest.signals import Floats
from clutchest.vehicle.state_uncertainty import Wander

TERMS = 32  # of a walk: of its variance at the end of a drive, 1/150 is left out


def random_walk(t: Floats, density: float) -> Floats:
    """A random walk at times ``t`` (K) s, 0 at the first, as columns (K, TERMS), each to be taken a
    number of times that is normal, of variance 1; ``density`` unit/√s."""
    since, whole = t - t[0], max(t[-1] - t[0], 1e-9)
    rate = (np.arange(TERMS) + 0.5) * np.pi / whole
    walk = np.outer(since, rate)
    np.sin(walk, out=walk)  # in place: of an hour, 25 MiB
    walk *= density * np.sqrt(2.0 / whole) / rate
    return walk


def wander_of(
    drive: PreparedDrive, numbers: ModelNumbers, at: OperatingPoint, wander: Wander
) -> Floats:
    """What the wander of one state does to the readings of a drive at these ``numbers``: columns
    (K, TERMS), each to be taken a number of times that is normal, of variance 1."""
    time = drive.line.t
    rates = random_walk(time, wander.density)
    rates[1:] = np.diff(rates, axis=0)
    rates[0] = 0.0
    span = np.diff(time, prepend=time[0])[:, None]
    rates /= np.where(span > 0.0, span, np.inf)
    theta = list(of_compiled(drive.compiled, {})).index(StateWander(wander.state))
    every = Modulation(rates, np.arange(TERMS))
    return modulated(drive, numbers, at, np.full(TERMS, theta), every)
