"""All drives at one θ: innovations made white, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.operating_point import OperatingPoint
from clutchest.inference.unknowns import Shapes
from clutchest.signals import Floats


@dataclass(frozen=True, slots=True)
class Linearisation:
    """All drives at one θ, white: ``r`` (K) innovations and ``by_active`` (K, a) their derivatives
    by the ``active`` thetas (a; all where None), drive after drive; ``cost`` is
    −2 ln(probability) up to a constant, priors in it, of what lies in the objective's span; ``raw``
    the same before whitening, derivatives only where all are active, and ``implied`` the operating
    point of every drive at θ.
    """

    theta: Floats
    shapes: Shapes
    r: Floats
    by_active: Floats
    cost: float
    raw: Sequence[NormalisedInnovations]
    implied: Sequence[OperatingPoint]
    active: NDArray[np.int64] | None = None

    @property
    def bare(self) -> Linearisation:
        """Where it is and what that costs; of an hour, innovations and derivatives are 100 MiB."""
        nothing = np.zeros((0, len(self.theta)))
        return replace(self, r=np.zeros(0), by_active=nothing, raw=(), implied=(), active=None)

    @property
    def as_point(self) -> Linearisation:
        """The same without innovations and derivatives: others can still be linearised from it."""
        return replace(self.bare, implied=self.implied)

    @property
    def as_measured(self) -> Linearisation:
        """The same before whitening alone: what another objective judges anew."""
        return replace(self.bare, raw=self.raw, implied=self.implied)

    @property
    def without_derivatives(self) -> Linearisation:
        """The same with the innovations before whitening alone: what residuals are judged by."""
        return replace(self.bare, raw=[each.alone for each in self.raw], implied=self.implied)

    def only(self, active: NDArray[np.int64]) -> Linearisation:
        """The same with derivatives by these thetas (indices) alone, none of them before
        whitening."""
        raw = [each.alone for each in self.raw]
        return replace(self, by_active=self.by(active), active=active, raw=raw)

    @property
    def psi(self) -> Floats:
        """Derivatives by every θ, shape (K, m): 0 by those that are not active."""
        return self.by_active if self.active is None else self.by(np.arange(len(self.theta)))

    def by(self, thetas: NDArray[np.int64]) -> Floats:
        """Derivatives (K, n) by these thetas (indices, n): 0 by those that are not active."""
        if self.active is None:
            return self.by_active[:, thetas]
        place = np.full(len(self.theta), -1)
        place[self.active] = np.arange(len(self.active))
        known, some = place[thetas] >= 0, np.zeros((len(self.r), len(thetas)))
        some[:, known] = self.by_active[:, place[thetas][known]]
        return some

    @property
    def information(self) -> Floats:
        """ψᵀψ (m, m)."""
        product = self.by_active.T @ self.by_active
        if self.active is None:
            return product
        every = np.zeros((len(self.theta), len(self.theta)))
        every[np.ix_(self.active, self.active)] = product
        return every

    def slope(self, r: Floats) -> Floats:
        """ψᵀr (m) of ``r`` (K); of the innovations, half the derivative of their sum of squares."""
        product = self.by_active.T @ r
        if self.active is None:
            return product
        every = np.zeros(len(self.theta))
        every[self.active] = product
        return every

    def change(self, step: Floats) -> Floats:
        """ψ · ``step`` (m): by how much the innovations (K) change, to first order."""
        return self.by_active @ (step if self.active is None else step[self.active])
