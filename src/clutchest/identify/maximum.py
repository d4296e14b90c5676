"""The most probable numbers: Gauss–Newton steps on innovations made white, with priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.identify.colour import Colour, Stretches
from clutchest.identify.linearised import Problem, Rows, Shapes
from clutchest.signals import Floats

NO_SHAPES: Shapes = MappingProxyType({})
FAR = 5.0  # standard deviations; a reading further off counts as if it were here
STEPS, HALVINGS, TURNS = 12, 4, 6  # at most
SETTLED = 0.05  # of −2 ln(probability): a step that promises less is not taken
NEARLY = 3.0  # of the same: the colour of the noise is learned when it changes this by less
BOUND = 3.0  # units that one step may go


@dataclass(frozen=True, slots=True)
class Look:
    """All drives at one θ, white: ``r`` (K) and ``psi`` (K, m) as in
    :class:`~clutchest.identify.linearised.Rows`, drive after drive; ``cost`` is
    −2 ln(probability) up to a constant, priors in it."""

    theta: Floats
    shapes: Shapes
    r: Floats
    psi: Floats
    cost: float
    raw: Sequence[Rows]

    @property
    def information(self) -> Floats:
        """ψᵀψ (m, m)."""
        return self.psi.T @ self.psi

    @property
    def slope(self) -> Floats:
        """ψᵀr (m): half the derivative of the sum of squares."""
        return self.psi.T @ self.r


class Fitter:
    """One problem with the colour of its noise."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.stretches = [Stretches.of(d.t, d.sensor, d.row) for d in problem.drives]
        self.colour, self.learned = Colour.white(self.stretches), False
        self.prior = np.zeros(len(problem.thetas))
        self.prior[problem.nuisances] = 1.0

    def settle(self, theta: Floats) -> Look:
        """The most probable nuisances with gains as in ``theta``, and the colour of what is left:
        a step for the one, a lesson for the other, in turns."""
        look = self.look(theta)
        for _ in range(TURNS):
            look = self.most_probable(self.problem.nuisances, look.theta)
            before = look.cost
            self.learn(look.raw, look.theta)
            look = self.again(look)
            if abs(before - look.cost) < NEARLY:
                break
        return look

    def look(self, theta: Floats, shapes: Shapes = NO_SHAPES) -> Look:
        """All drives at ``theta`` (m)."""
        raw = self.problem.linearise(theta, shapes)
        return self._white(raw, theta, shapes)

    def again(self, look: Look) -> Look:
        """The same with the colour as it is known now."""
        return self._white(look.raw, look.theta, look.shapes)

    def _white(self, raw: Sequence[Rows], theta: Floats, shapes: Shapes) -> Look:
        cost, parts = float(np.sum(self.prior * theta**2)), []
        for stretches, rows in zip(self.stretches, raw, strict=True):
            joined = self.colour.whiten(stretches, np.column_stack([rows.r, rows.psi]))
            if self.learned:  # before, the model itself may be far off
                joined[:, 0] = np.clip(joined[:, 0], -FAR, FAR)
            parts.append(joined)
            cost += float(np.sum(joined[:, 0] ** 2))
            cost += rows.log_variance + self.colour.log_level(stretches)
        white = np.concatenate(parts)
        return Look(theta, shapes, white[:, 0], white[:, 1:], cost, raw)

    def learn(self, raw: Sequence[Rows], theta: Floats) -> None:
        """Colour from what the innovations keep when every θ, causes too, has taken its share:
        what a cause leaves in the data must not pass for noise."""
        look = self._white(raw, theta, {})
        prior = np.ones(len(theta))  # a cause is taken to be of a plausible size
        step = np.linalg.solve(look.information + np.diag(prior), -look.slope)
        rest = [rows.r + rows.psi @ step for rows in raw]
        self.colour, self.learned = Colour.fit(self.stretches, rest), True

    def most_probable(
        self, free: NDArray[np.int64], theta: Floats, shapes: Shapes = NO_SHAPES
    ) -> Look:
        """From ``theta`` on to the most probable values of the ``free`` ones (indices), nuisances
        among them; gains stay within their plausible sizes."""
        low, high = self._bounds()
        look = self.look(theta, shapes)
        for _ in range(STEPS):
            move = np.clip(look.theta + self.step(look, free), low, high) - look.theta
            if self._promised(look, move) < SETTLED:
                break
            tried = self.look(look.theta + move, shapes)
            for _ in range(HALVINGS):
                if tried.cost < look.cost:
                    break
                move /= 2.0
                tried = self.look(look.theta + move, shapes)
            if tried.cost > look.cost - SETTLED:
                break
            look = tried
        return look

    def step(self, look: Look, free: NDArray[np.int64]) -> Floats:
        """Gauss–Newton's step (m), zero where not ``free``."""
        both = np.ix_(free, free)
        curvature = look.information[both] + np.diag(self.prior[free] + 1e-9)
        slope = look.slope[free] + self.prior[free] * look.theta[free]
        step = np.zeros(len(look.theta))
        step[free] = np.clip(np.linalg.solve(curvature, -slope), -BOUND, BOUND)
        return step

    def _promised(self, look: Look, step: Floats) -> float:
        """By how much a step would lower the cost if all were linear."""
        after = look.r + look.psi @ step
        prior = np.sum(self.prior * ((look.theta + step) ** 2 - look.theta**2))
        return float(look.r @ look.r - after @ after - prior)

    def _bounds(self) -> tuple[Floats, Floats]:
        low, high = np.full(len(self.prior), -np.inf), np.full(len(self.prior), np.inf)
        for i in self.problem.gains:
            t = self.problem.thetas[i]
            number = next(n for n in self.problem.effects[t.owner].gains if n.key == t.key)
            low[i], high[i] = number.lower / t.unit, number.upper / t.unit
        return low, high
