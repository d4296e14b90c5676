"""A machine with the numbers that drives determine, and what it says of others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from clutchest.casadi_later import one_at_a_time
from clutchest.identify.likelihood import Posterior, most_probable, problem_of
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import InitialState
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Prediction:
    """Of one sensor in one drive: ``time`` (k) s, ``measured`` (k) readings and their ``error``
    (k), in the sensor's unit."""

    time: Floats
    measured: Floats
    error: Floats


@dataclass(frozen=True, slots=True)
class FittedMachine:
    """All numbers of a ``vehicle`` as some drives determine them: the ``posterior``."""

    vehicle: Vehicle
    posterior: Posterior

    @classmethod
    def of(cls, signals: Signals, vehicle: Vehicle) -> FittedMachine:
        """The most probable numbers of these drives."""
        return cls(vehicle, most_probable(problem_of(signals, vehicle)))

    @property
    def numbers(self) -> Mapping[str, float]:
        """Parameters and effects, by name, in the units of the vehicle file."""
        problem = self.posterior.problem
        model, at = problem.compiled.model, problem.numbers(self.posterior.theta, {})
        named = zip(model.parameters, at.parameters.tolist(), strict=True)
        effects = zip(model.numbers, at.effects.tolist(), strict=True)
        return {p.key: v for p, v in named} | {f"{e.name}.{k}": v for (e, k), v in effects}

    def predicted(self, signals: Signals, sensor: str) -> list[Prediction]:
        """Readings of a sensor in every drive, as the equations predict them with these numbers.

        From the readings before where its state is renewed by them (one step ahead), from the
        inputs alone where it is not.  A state starts as in the first drive that was fitted.
        """
        other, at = self._other(signals)
        raw = other.linearise(at, {}, np.zeros(0, np.int64))
        which = other.compiled.model.sensor(sensor)
        predictions = []
        for drive, innovations in zip(other.drives, raw, strict=True):
            rows = np.flatnonzero(drive.readings.sensor == which)
            error = innovations.r[rows] * drive.readings.std[rows]
            measured = drive.line.z[drive.readings.event[rows]]
            predictions.append(Prediction(drive.readings.t[rows], measured, error))
        return predictions

    def quantities(self, *names: str) -> ca.Function:
        """Quantities of the equations as a function of states, inputs and regime flags."""
        e = self.posterior.problem.compiled.model.expressions()
        return self._of_moment(ca.vertcat(*(getattr(e.quantities, name) for name in names)))

    def rates(self) -> ca.Function:
        """Derivatives of the states as a function of states, inputs and regime flags, each in the
        order of the equations."""
        return self._of_moment(self.posterior.problem.compiled.model.expressions().rate)

    @one_at_a_time
    def _of_moment(self, wanted: ca.SX) -> ca.Function:
        """Expressions at the fitted numbers, as a function of states, inputs and flags."""
        problem = self.posterior.problem
        e, at = problem.compiled.model.expressions(), problem.numbers(self.posterior.theta, {})
        known = [ca.DM(at.parameters), ca.DM(at.effects)]
        return ca.Function("at", [e.x, e.u, e.w], ca.substitute([wanted], [e.p, e.g], known))

    def _other(self, signals: Signals) -> tuple[Problem, Floats]:
        """Other drives as the equations see them, and θ there."""
        mine, other = self.posterior.problem, problem_of(signals, self.vehicle)
        theta, at = self.posterior.theta, np.zeros(len(other.thetas))
        at[: other.shared] = theta[: mine.shared]
        started = {
            t.state: float(value)
            for t, value in reversed(list(zip(mine.thetas, theta, strict=True)))
            if isinstance(t, InitialState)
        }
        for k, t in enumerate(other.thetas):
            if isinstance(t, InitialState):
                at[k] = started.get(t.state, 0.0)
        return other, at
