"""The most probable numbers: Gauss–Newton steps on innovations made white, with priors."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.input_noise_covariance import InputNoiseCovariance
from clutchest.inference.noise_model import NoiseModel
from clutchest.inference.unknowns import Problem, Rows, Shapes
from clutchest.signals import Floats

NO_SHAPES: Shapes = MappingProxyType({})
FAR = 5.0  # standard deviations; a reading that stays further off is left out
COOLING = (1e4, 1e3, 1e2, 1e1)  # variance of the noise at the first steps, over its own
WARM = 10.0  # mean squares of the innovations: variances beyond are no help
STEPS, PATIENCE, TURNS = 40, 3, 6  # at most
SHARES = (1.0, 0.5, 0.2, 0.05)  # of a hot step, until it pays
RUNAWAY = 1e60  # of a derivative, in standard deviations: there the equations have run away
ALIKE, LONGEST = 0.95, 10.0  # cosine of steps in one direction; by how much one is lengthened
WALL = 30.0  # times the best cost: a climb beyond leads nowhere
AHEAD = 0.05  # of a step: where one looks how the valley bends
SHORTENED, SHORTEST = 0.4, 0.05  # a bent step that leaves the valley is shortened by this, to this
SLOW = 0.003  # of the cost: what lies so far off need not be found to the last digit
SETTLED = 0.05  # of −2 ln(probability): a step that promises less is not taken
SLIGHT = 2.0  # the same: one that promises less, and of which no part kept it, is the last
NOTHING = 1e-10  # of a derivative, squared: rounding
SAME = 3e-6  # the same: what a derivative at two places differs by less is its inputs' noise
NEARLY = (
    10.0  # of the sum of squares: the colour of the noise is learned when it changes it by less
)


@dataclass(frozen=True, slots=True)
class Look:
    """All drives at one θ, white: ``r`` (K) and ``psi`` (K, m) as in
    :class:`~clutchest.inference.unknowns.Rows`, drive after drive; ``cost`` is
    −2 ln(probability) up to a constant, priors in it, of what lies in the fitter's span.
    """

    theta: Floats
    shapes: Shapes
    r: Floats
    psi: Floats
    cost: float
    raw: Sequence[Rows]

    @property
    def bare(self) -> Look:
        """Where it is and what that costs; of an hour, innovations and derivatives are 100 MiB."""
        return replace(self, r=np.zeros(0), psi=np.zeros((0, len(self.theta))), raw=())

    @property
    def information(self) -> Floats:
        """ψᵀψ (m, m)."""
        return self.psi.T @ self.psi

    @property
    def slope(self) -> Floats:
        """ψᵀr (m): half the derivative of the sum of squares."""
        return self.psi.T @ self.r


class Fitter:
    """One problem with the colour of its noise.

    What the data say of θ lies in the span of derivatives at inputs that the data imply.  Outside
    of it there is noise that the measured inputs bring along, and where θ scales an input, as an
    inertia does, that noise would seem to tell of θ too.  So fits are judged within the span.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.stretches = [d.stretches for d in problem.drives]
        self.noise_model = NoiseModel.white(self.stretches)
        self.weights = [np.ones(len(d.t)) for d in problem.drives]  # 0: not counted
        self.input_noise_directions = self._walks()
        self.span: Floats | None = None  # (K, q), orthonormal
        self.prior = np.zeros(len(problem.thetas))
        self.prior[problem.nuisances] = 1.0
        self.low, self.high = self._bounds()

    def without(self, rows: NDArray[np.bool_]) -> Fitter:
        """One that does not see these ``rows`` (K); the colour is the same."""
        other, begin = copy(self), 0
        other.weights = []
        for weight in self.weights:
            other.weights.append(weight * ~rows[begin : begin + len(weight)])
            begin += len(weight)
        other.input_noise_directions = other._walks()
        return other

    def roomier(self, times: float) -> Fitter:
        """One that lets gains go so many ``times`` as far as is plausible."""
        other = copy(self)
        other.low, other.high = times * self.low, times * self.high
        return other

    def settle(self, theta: Floats) -> Look:
        """The most probable nuisances with gains as in ``theta``, and the colour of what is left:
        a step for the one, a lesson for the other, in turns."""
        free = self.problem.nuisances
        look = self.improve(self.cooled(self.look(theta), free), free)
        for _ in range(TURNS):
            before = look.r @ look.r
            look = self.taught(look)
            self.focus([look.psi])
            look = self.improve(self.again(look), free)
            if abs(before - look.r @ look.r) < NEARLY:
                break
        return look

    def cooled(self, look: Look, free: NDArray[np.int64]) -> Look:
        """A look from far off brought near: at once, such data would drag everything along that is
        not priced."""
        for heat in COOLING:
            if heat * len(look.r) < WARM * (look.r @ look.r):
                look = self._cooler(look, free, heat)
        return look

    def _cooler(self, look: Look, free: NDArray[np.int64], heat: float) -> Look:
        """A step, as long as it pays, with noise of ``heat`` times its variance."""

        def cost(at: Look) -> float:
            return float(at.r @ at.r / heat + np.sum(self.prior * at.theta**2))

        step = self.step(look, free, heat=heat)
        for share in SHARES:
            tried = self.look(look.theta + share * step, look.shapes, free)
            if cost(tried) < cost(look):
                return tried
        return look

    def look(
        self,
        theta: Floats,
        shapes: Shapes = NO_SHAPES,
        active: NDArray[np.int64] | None = None,
    ) -> Look:
        """All drives at ``theta`` (m), derivatives by the ``active`` thetas, all unless given."""
        raw = self.problem.linearise(theta, shapes, active)
        return self._white(raw, theta, shapes)

    def come(self, theta: Floats, shapes: Shapes = NO_SHAPES) -> None:
        """Imply the inputs at ``theta`` (m): derivatives are taken at those that the run before
        implied, and that was elsewhere."""
        self.problem.linearise(theta, shapes, np.zeros(0, np.int64))

    def arrive(
        self,
        theta: Floats,
        shapes: Shapes = NO_SHAPES,
        active: NDArray[np.int64] | None = None,
    ) -> Look:
        """As :meth:`look`, from elsewhere."""
        self.come(theta, shapes)
        return self.look(theta, shapes, active)

    def taught(self, look: Look) -> Look:
        """The same with every derivative, once the colour has been learned from it."""
        return self.lesson(look.theta, look.shapes)

    def lesson(
        self, theta: Floats, shapes: Shapes, active: NDArray[np.int64] | None = None
    ) -> Look:
        """As :meth:`look`, once the colour has been learned there."""
        look = self.look(theta, shapes, active)
        self.learn(look.raw, theta)
        return self.again(look)

    def again(self, look: Look) -> Look:
        """The same with the colour as it is known now."""
        return self._white(look.raw, look.theta, look.shapes)

    def _white(self, raw: Sequence[Rows], theta: Floats, shapes: Shapes) -> Look:
        with np.errstate(over="ignore", invalid="ignore"):  # infinite, where the equations run away
            white = self._whiten([rows.table.copy() for rows in raw])
            r, active = white[:, 0], white[:, 1:]
            cost = float(np.sum(self._seen(r) ** 2) + np.sum(self.prior * theta**2))
        if active.size and not (active.min() > -RUNAWAY and active.max() < RUNAWAY):
            cost = np.inf  # nowhere to go on from
        return Look(theta, shapes, r, raw[0].spread(active), cost, raw)

    def modulated(
        self,
        look: Look,
        thetas: NDArray[np.int64],
        bases: Sequence[Floats],
        columns: NDArray[np.int64],
    ) -> Floats:
        """Derivatives (K, c), white, by ``thetas`` (c) of which each acts in proportion to one of
        the ``columns`` (c) of ``bases`` (events, b), a table per drive."""
        raw = self.problem.modulated(look.theta, look.shapes, thetas, bases, columns)
        return self._whiten(raw)

    def _whiten(self, raw: list[Floats]) -> Floats:
        """Tables (K, c) of all drives as one, without colour and outliers; they are used up."""
        for table, s, weight, walk in zip(
            raw, self.stretches, self.weights, self.input_noise_directions, strict=True
        ):
            self.noise_model.whiten_in_place(s, table)
            table *= weight[:, None]
            walk.whiten_in_place(table)
        return raw[0] if len(raw) == 1 else np.concatenate(raw)

    def _walks(self) -> list[InputNoiseCovariance]:
        """Those of the inputs' noise in every drive, as colour and outliers leave them."""
        return [
            InputNoiseCovariance.of(
                self.noise_model.whiten(s, drive.input_noise_directions) * weight[:, None]
            )
            for drive, s, weight in zip(
                self.problem.drives, self.stretches, self.weights, strict=True
            )
        ]

    def _seen(self, values: Floats) -> Floats:
        """What of ``values`` (K, …) lies in the span."""
        return values if self.span is None else self.span.T @ values

    def focus(self, columns: Sequence[Floats], least: float = NOTHING) -> None:
        """Judge fits by what lies in the span of these derivatives (K, …), without directions that
        hold ``least`` of them, squared, or less."""
        table = np.column_stack(columns)
        length = np.linalg.norm(table, axis=0)
        table /= np.where(length > 1e-6, length, np.inf)
        directions, strength, _ = np.linalg.svd(table.T @ table)
        keep = strength > least
        self.span = table @ (directions[:, keep] / np.sqrt(strength[keep]))

    def learn(self, raw: Sequence[Rows], theta: Floats) -> None:
        """Colour from what the innovations keep when every θ, causes too, has taken its share:
        what a cause leaves in the data must not pass for noise."""
        look = self._white(raw, theta, {})
        prior = np.ones(len(theta))  # a cause is taken to be of a plausible size
        step = np.linalg.solve(look.information + np.diag(prior), -look.slope)
        rest = [rows.r + rows.psi @ step for rows in raw]
        for e, drive, s, walk in zip(
            rest, self.problem.drives, self.stretches, self.input_noise_directions, strict=True
        ):
            e -= drive.input_noise_directions @ walk.probable(self.noise_model.whiten(s, e))
        self.noise_model = NoiseModel.fit(self.stretches, rest)
        self.weights = [
            (np.abs(self.noise_model.whiten(s, e)) < FAR).astype(float)
            for s, e in zip(self.stretches, rest, strict=True)
        ]
        self.input_noise_directions = self._walks()

    def most_probable(
        self, free: NDArray[np.int64], theta: Floats, shapes: Shapes = NO_SHAPES
    ) -> Look:
        """From ``theta`` on to the most probable values of the ``free`` ones (indices), nuisances
        among them; gains stay within their plausible sizes."""
        return self.improve(self.arrive(theta, shapes), free)

    def improve(self, look: Look, free: NDArray[np.int64]) -> Look:
        """The same from a look on.

        Valleys bend: a step along one may climb its wall, and the next one falls back onto its
        floor further on.  So a few climbs are let pass before steps are damped (Levenberg,
        Marquardt).  A step that leaves the valley altogether is bent as the valley is, and
        shortened until it stays within.
        """
        best, damping, climbs = look, 0.0, 0
        last, bend, share = np.zeros(len(look.theta)), None, 1.0
        for _ in range(STEPS):
            move = self.step(look, free, damping)
            if (promised := self._promised(look, move)) < SETTLED:
                break
            move = self._lengthened(look, free, move, last)
            if share < 1.0 and bend is None:
                bend = self._bend(look, move, free)
            path = move if bend is None else share * (move + share / 2.0 * bend)
            look = self.look(self.within(look.theta + path, free), look.shapes, free)
            straight = bend is None and not damping
            if look.cost < best.cost:
                gained, best, climbs, damping = best.cost - look.cost, look, 0, damping / 10.0
                last, bend, share = path if straight else 0.0 * path, None, min(1.0, 2.0 * share)
                if straight and gained < max(SETTLED, SLOW * best.cost):
                    break
                continue
            last = 0.0 * path
            may_fall = bend is None and look.cost < WALL * best.cost
            if may_fall and (climbs := climbs + 1) <= PATIENCE:
                continue
            look, climbs = best, 0
            if straight:
                bend = self._bend(best, move, free)
            elif bend is not None and share > SHORTEST:
                share *= SHORTENED
            elif promised < SLIGHT:
                break
            else:
                bend, share, damping = None, 1.0, max(10.0 * damping, 1.0)
        return best

    def _bend(self, look: Look, move: Floats, free: NDArray[np.int64]) -> Floats:
        """The second derivative (m) of the path along the valley's floor that begins with ``move``:
        geodesic acceleration (Transtrum and Sethna), from one more look a little way ahead."""
        ahead = self.look(look.theta + AHEAD * move, look.shapes, free)
        if not np.isfinite(ahead.cost):
            return np.zeros(len(look.theta))
        curved = 2.0 / AHEAD * ((ahead.r - look.r) / AHEAD - look.psi @ move)
        curvature = look.information + np.diag(self.prior + 1e-9)
        bend = np.zeros(len(look.theta))
        bend[free] = -np.linalg.solve(curvature[np.ix_(free, free)], (look.psi.T @ curved)[free])
        return bend

    def within(self, theta: Floats, free: NDArray[np.int64]) -> Floats:
        """``theta`` (m) with the ``free`` ones (indices) no further than is plausible; what is held
        stays where it is."""
        inside = theta.copy()
        inside[free] = np.clip(theta[free], self.low[free], self.high[free])
        return inside

    def _lengthened(
        self, look: Look, free: NDArray[np.int64], move: Floats, last: Floats
    ) -> Floats:
        """A step; where steps go on and on in one direction, one to where they lead (Aitken).

        Along a ridge, derivatives that are nearly alike take turns, and what little each of them is
        off makes a step too short.
        """
        along, square = move @ last, last @ last
        if along <= 0.0 or along < ALIKE * np.sqrt(square * (move @ move)) or along >= square:
            return move
        times = min(float(square / (square - along)), LONGEST)
        return self.within(look.theta + times * move, free) - look.theta

    def step(
        self, look: Look, free: NDArray[np.int64], damping: float = 0.0, heat: float = 1.0
    ) -> Floats:
        """Gauss–Newton's step (m), zero where not ``free``; a gain that would leave its plausible
        sizes stops at their end, and the others make the best of that.  With ``heat`` the data
        count for less."""
        curvature = look.information / heat + np.diag(self.prior + damping + 1e-9)
        slope = look.slope / heat + self.prior * look.theta
        step = np.zeros(len(look.theta))
        while len(free):
            rest = (
                -slope[free] - curvature[free] @ step + curvature[np.ix_(free, free)] @ step[free]
            )
            step[free] = np.linalg.solve(curvature[np.ix_(free, free)], rest)
            aim = look.theta + step
            out = free[(aim[free] < self.low[free]) | (aim[free] > self.high[free])]
            if not len(out):
                break
            step[out] = np.clip(aim[out], self.low[out], self.high[out]) - look.theta[out]
            free = np.setdiff1d(free, out)
        return step

    def covariance(self, look: Look, free: NDArray[np.int64]) -> Floats:
        """Of the ``free`` thetas (f), (f, f), as far as all is linear at a look."""
        return np.asarray(np.linalg.inv(self.curvature(look, free)), np.float64)

    def curvature(self, look: Look, free: NDArray[np.int64]) -> Floats:
        """Its inverse (f, f): half the second derivative of the cost."""
        return look.information[np.ix_(free, free)] + np.diag(self.prior[free] + 1e-9)

    def _promised(self, look: Look, step: Floats) -> float:
        """By how much a step would lower the cost if all were linear."""
        before, after = self._seen(look.r), self._seen(look.r + look.psi @ step)
        prior = np.sum(self.prior * ((look.theta + step) ** 2 - look.theta**2))
        return float(before @ before - after @ after - prior)

    def _bounds(self) -> tuple[Floats, Floats]:
        low, high = np.full(len(self.prior), -np.inf), np.full(len(self.prior), np.inf)
        for i in self.problem.gains:
            t = self.problem.thetas[i]
            number = next(n for n in self.problem.effects[t.owner].gains if n.key == t.key)
            low[i], high[i] = number.lower / t.unit, number.upper / t.unit
        return low, high
