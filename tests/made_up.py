"""Small problems with known answers, as fits see them: innovations are given functions of θ."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from clutchest.inference.discrepancy import Discrepancy
from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.objective import Objective
from clutchest.inference.operating_point import OperatingPoint
from clutchest.inference.prepared_drive import Readings
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import Shapes, Unknown, UnknownGain, UnknownParameter
from clutchest.signals import Floats

PERIOD = 0.01  # s
Residuals = Callable[[Floats], tuple[Floats, Floats]]  # θ (m) → r (K), derivatives (K, m)
NOWHERE = OperatingPoint(np.zeros((0, 0)), np.zeros((0, 0)), {})


def objective_of(residuals: Residuals, thetas: Sequence[Unknown]) -> Objective:
    """Of one drive with these innovations and derivatives."""
    return Objective.of(cast(Problem, _Given(residuals, tuple(thetas))))


@dataclass
class _Given:
    """As much of a problem as fits use."""

    residuals: Residuals
    thetas: tuple[Unknown, ...]

    def __post_init__(self) -> None:
        gain = np.array([isinstance(t, UnknownGain) for t in self.thetas])
        self.gains, self.nuisances = np.flatnonzero(gain), np.flatnonzero(~gain)
        count = len(self.residuals(np.zeros(len(gain)))[0])
        nothing, time = np.zeros(count, int), np.arange(count) * PERIOD
        without = np.ones(count), np.zeros(count, bool), np.zeros((count, 0))
        readings = Readings(nothing, time, nothing, nothing, nothing, *without)
        self.drives = [SimpleNamespace(readings=readings, at_nominal=NOWHERE)]
        self.discrepancies: tuple[Discrepancy, ...] = ()

    def until(self, share: float) -> _Given:
        count = round(share * len(self.drives[0].readings.t))

        def residuals(theta: Floats) -> tuple[Floats, Floats]:
            r, psi = self.residuals(theta)
            return r[:count], psi[:count]

        return _Given(residuals, self.thetas)

    def implied(self, theta: Floats, shapes: Shapes) -> tuple[OperatingPoint, ...]:
        return (NOWHERE,)

    def linearise(
        self,
        theta: Floats,
        shapes: Shapes,
        active: NDArray[np.int64] | None = None,
        at: Sequence[OperatingPoint] = (),
    ) -> tuple[NormalisedInnovations, ...]:
        r, psi = self.residuals(theta)
        return (NormalisedInnovations(np.column_stack([r, psi]), len(theta), NOWHERE),)


@dataclass
class MadeUp:
    """A problem of one drive whose innovations are ``data`` (K) less ``law(θ)``.

    ``names`` of its numbers: those in ``bounds`` (lower, upper) are gains, the rest nuisances.
    """

    law: Callable[[Floats], Floats]
    data: Floats
    names: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def residuals(self, theta: Floats) -> tuple[Floats, Floats]:
        """Derivatives by finite differences."""
        psi = np.zeros((len(self.data), len(theta)))
        for k in range(len(theta)):
            step = np.zeros(len(theta))
            step[k] = 1e-6
            psi[:, k] = (self.law(theta - step) - self.law(theta + step)) / 2e-6
        return self.data - self.law(theta), psi

    @property
    def objective(self) -> Objective:
        thetas = [
            UnknownGain(n, n, 1.0, *self.bounds[n])
            if n in self.bounds
            else UnknownParameter(n, 1.0)
            for n in self.names
        ]
        return objective_of(self.residuals, thetas)

    def reference(self, begin: Floats) -> OptimizeResult:
        """The same optimum by SciPy; half its cost is what it calls ``cost``."""
        prior = [k for k, name in enumerate(self.names) if name not in self.bounds]
        low, high = np.full((2, len(self.names)), np.inf) * np.array([[-1.0], [1.0]])
        for k, name in enumerate(self.names):
            if name in self.bounds:
                low[k], high[k] = self.bounds[name]
        return least_squares(
            lambda theta: np.concatenate([self.data - self.law(theta), theta[prior]]),
            begin,
            bounds=(low, high),
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
            max_nfev=10_000,
        )

    @property
    def all(self) -> NDArray[np.int64]:
        return np.arange(len(self.names))
