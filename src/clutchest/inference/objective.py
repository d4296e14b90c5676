"""What fits make least: −2 ln(posterior probability) of all drives, noise made white.

What the data say of θ lies in the span of derivatives at inputs that the data imply.  Outside of it
there is noise that the measured inputs bring along, and where θ scales an input, as an inertia
does, that noise would seem to depend on θ too.  So fits are judged within the span.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.discrepancy import ScatteredDrive, probability, probable_shares, scattering
from clutchest.inference.innovations import NO_DERIVATIVES, NormalisedInnovations
from clutchest.inference.input_noise_covariance import InputNoiseCovariance, white_covariances
from clutchest.inference.linear_solve import add_product, solved
from clutchest.inference.linearisation import Modulation
from clutchest.inference.noise_model import NoiseModel, Stretches
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import Shapes, UnknownGain, UnknownParameter
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

NO_SHAPES: Shapes = MappingProxyType({})
FAR = 5.0  # standard deviations; a reading that stays further off is left out
RUNAWAY = 1e60  # of a derivative, in standard deviations: there the equations have run away
NOTHING = 1e-10  # of a derivative, squared: rounding
SAME = 3e-6  # the same: what a derivative at two places differs by less is its inputs' noise


@dataclass(frozen=True, slots=True)
class Objective:
    """One problem with the model of its noise.

    ``weights`` (K) of each drive's readings, 0 where one does not count; ``scatter`` (K, c):
    directions in which the inputs' noise and discrepancies scatter each drive's innovations, and
    ``scattered``: how, where these are white; ``span`` (K, q): orthonormal, None for all there is;
    ``prior`` (m) precisions, 0 of gains; between ``low`` and ``high`` (m) gains are plausible, and
    parameters what the equations allow.
    """

    problem: Problem
    stretches: Sequence[Stretches]
    noise_model: NoiseModel
    weights: Sequence[Floats]
    scatter: Sequence[Floats]
    scattered: Sequence[InputNoiseCovariance]
    span: Floats | None
    prior: Floats
    low: Floats
    high: Floats

    @classmethod
    def of(cls, problem: Problem) -> Objective:
        """With white noise of the stated level, no discrepancies, everything in the span and prior
        variances of 1."""
        stretches = [drive.readings.stretches for drive in problem.drives]
        white = NoiseModel.white(stretches)
        weights = [np.ones(len(drive.readings.t)) for drive in problem.drives]
        prior = np.zeros(len(problem.thetas))
        prior[problem.nuisances] = 1.0
        low, high = np.full(len(prior), -np.inf), np.full(len(prior), np.inf)
        for i, t in enumerate(problem.thetas):
            if isinstance(t, UnknownGain | UnknownParameter):
                low[i], high[i] = t.lower, t.upper
        scatter = [drive.readings.input_noise for drive in problem.drives]
        scattered = white_covariances(stretches, white, weights, scatter)
        return cls(problem, stretches, white, weights, scatter, scattered, None, prior, low, high)

    def until(self, share: float) -> Objective:
        """That of the part of every drive which ends after a ``share`` of its time, in white
        noise; priors and bounds are the same."""
        whole = Objective.of(self.problem.until(share))
        return replace(whole, prior=self.prior, low=self.low, high=self.high)

    def without(self, rows: NDArray[np.bool_]) -> Objective:
        """One in which these ``rows`` (K) do not count; the noise model is the same."""
        edges = np.cumsum([len(weight) for weight in self.weights])[:-1]
        return self._weighted(
            self.noise_model,
            [w * ~own for w, own in zip(self.weights, np.split(rows, edges), strict=True)],
            self.scatter,
        )

    def with_bounds(self, times: float) -> Objective:
        """One that lets gains go so many ``times`` as far as is plausible."""
        gains = self.problem.gains
        low, high = self.low.copy(), self.high.copy()
        low[gains], high[gains] = times * low[gains], times * high[gains]
        return replace(self, low=low, high=high)

    def with_prior(self, which: NDArray[np.int64], std: float) -> Objective:
        """One in which these numbers (indices) have another prior standard deviation."""
        prior = self.prior.copy()
        prior[which] = 1.0 / std**2
        return replace(self, prior=prior)

    def with_span(
        self,
        columns: Sequence[Floats],
        least: float = NOTHING,
        counts: Sequence[Floats] | None = None,
    ) -> Objective:
        """One that judges by what lies in the span of these derivatives (K, …), without directions
        that hold ``least`` of them, squared, or less; each column as if it came as often as
        ``counts`` (…) of its part say, once unless given."""
        length = np.concatenate([np.linalg.norm(part, axis=0) for part in columns])
        scale = 1.0 / np.where(length > 1e-6, length, np.inf)
        if counts is not None:
            scale *= np.sqrt(np.concatenate(counts))
        inner = np.block([[a.T @ b for b in columns] for a in columns])
        directions, strength, _ = np.linalg.svd(inner * scale * scale[:, None])
        keep = strength > least
        turned = scale[:, None] * directions[:, keep] / np.sqrt(strength[keep])
        edges = np.cumsum([part.shape[1] for part in columns])[:-1]
        parts = zip(columns, np.split(turned, edges), strict=True)  # never all columns side by side
        span = np.zeros((len(columns[0]), turned.shape[1]))
        for part, by in parts:
            add_product(span, part, by)
        return replace(self, span=span)

    def also_in_span(self, columns: Floats) -> Objective:
        """One that judges by what lies in the span of these derivatives (K, c) as well."""
        if self.span is None:
            return self
        beside = columns - self.span @ (self.span.T @ columns)
        directions, strength, _ = np.linalg.svd(beside, full_matrices=False)
        keep = strength**2 > NOTHING * max(float(np.sum(columns**2)), 1e-300)
        return replace(self, span=np.column_stack([self.span, directions[:, keep]]))

    def with_noise_of(self, lin: Linearisation) -> Objective:
        """One without discrepancies whose noise model is that of what the innovations keep when
        every θ, causes too, has taken its share: what a cause leaves in the data must not pass for
        noise."""
        inner = lin.information + np.eye(len(lin.theta))  # a cause is of a plausible size
        step = solved(inner, -lin.slope(lin.r))
        rest = [innovations.r + innovations.change(step) for innovations in lin.raw]
        return self.in_noise(rest)

    def in_noise(self, rest: Sequence[Floats]) -> Objective:
        """One without discrepancies whose noise model is that of the ``rest`` (K) of each drive's
        innovations, but for what the inputs' noise and discrepancies most probably are of it."""
        rest = self._less_scatter(rest)
        noise_model = NoiseModel.fit(self.stretches, rest)
        weights = self._within_reach(noise_model, rest)
        known = [drive.readings.input_noise for drive in self.problem.drives]
        return self._weighted(noise_model, weights, known)

    def in_noise_of(self, lin: Linearisation) -> Objective:
        """One in noise as the innovations of a linearisation show it, which take all that is left
        for noise."""
        rest = [innovations.r for innovations in lin.raw]
        noise_model = NoiseModel.fit(self.stretches, rest)
        return self._weighted(noise_model, self._within_reach(noise_model, rest), self.scatter)

    def in_white_noise_of(self, lin: Linearisation) -> Objective:
        """One in white noise as loud as the innovations of a linearisation."""
        noise_model = NoiseModel.fit(self.stretches, [each.r for each in lin.raw], longest=0)
        return self._weighted(noise_model, self.weights, self.scatter)

    def _within_reach(self, noise_model: NoiseModel, rest: Sequence[Floats]) -> list[Floats]:
        """Weights of readings: 0 where what is left (K) of each drive's innovations lies far
        off."""
        return [
            (np.abs(noise_model.whiten(s, e)) < FAR).astype(float)
            for s, e in zip(self.stretches, rest, strict=True)
        ]

    def less_scatter(self, lin: Linearisation) -> list[NormalisedInnovations]:
        """A linearisation's innovations without what the inputs' noise and discrepancies most
        probably did to them, and without derivatives."""
        rest = self._less_scatter([innovations.r for innovations in lin.raw])
        return [
            replace(innovations.alone, table=e[:, None])
            for innovations, e in zip(lin.raw, rest, strict=True)
        ]

    def _less_scatter(self, innovations: Sequence[Floats]) -> list[Floats]:
        """Of each drive's ``innovations`` (K), not white, the same."""
        return [
            e - scatter @ noise.probable(self.noise_model.whiten(s, e))
            for e, scatter, s, noise in zip(
                innovations, self.scatter, self.stretches, self.scattered, strict=True
            )
        ]

    def with_discrepancies(self, lin: Linearisation, share: Floats | None = None) -> Objective:
        """One in which each discrepancy has its ``share`` of what is stated, as readings respond
        at a linearisation; the share that its innovations show, unless given."""
        if not self.problem.discrepancies:
            return self
        along = self.problem.discrepancy_directions(lin.theta, lin.shapes, lin.implied)
        if share is None:
            share = probable_shares(self._scattered(lin, along), self.problem.discrepancies)
        return self._scattering(along, share)

    def with_parts_of_discrepancies(
        self, lin: Linearisation, free: NDArray[np.int64], parts: Sequence[float]
    ) -> list[tuple[Objective, float]]:
        """Of each of so many ``parts`` of the discrepancies that a linearisation's innovations
        show: one in which they have that, and 2 ln of the probability of the data up to a constant,
        with no more than the ``free`` unknowns beside."""
        along = self.problem.discrepancy_directions(lin.theta, lin.shapes, lin.implied)
        drives = self._scattered(lin, along)
        share = probable_shares(drives, self.problem.discrepancies)
        alone = [drive.beside(free) for drive in drives]
        return [
            (self._scattering(along, part * share), 2.0 * probability(alone, part * share))
            for part in parts
        ]

    def _scattering(self, along: Sequence[Sequence[Floats]], share: Floats) -> Objective:
        """One in which each discrepancy has its ``share`` along its directions."""
        scatter = scattering(self.problem.drives, along, share)
        return self._weighted(self.noise_model, self.weights, scatter)

    def _scattered(
        self, lin: Linearisation, along: Sequence[Sequence[Floats]]
    ) -> list[ScatteredDrive]:
        """A linearisation's innovations, white but for what discrepancies do to them."""
        known = [drive.readings.input_noise for drive in self.problem.drives]
        still = self._weighted(self.noise_model, self.weights, known)
        tables = still._whitened([innovations.table.copy() for innovations in lin.raw])
        sources = zip(*along, strict=True)
        columns = [still._whitened([own.copy() for own in each]) for each in sources]
        every = zip(tables, zip(*columns, strict=True), strict=True)
        return [ScatteredDrive.along(*each) for each in every]

    def _weighted(
        self, noise_model: NoiseModel, weights: Sequence[Floats], scatter: Sequence[Floats]
    ) -> Objective:
        return replace(
            self,
            noise_model=noise_model,
            weights=weights,
            scatter=scatter,
            scattered=white_covariances(self.stretches, noise_model, weights, scatter),
        )

    def linearise_at(
        self,
        theta: Floats,
        shapes: Shapes = NO_SHAPES,
        active: NDArray[np.int64] | None = None,
    ) -> Linearisation:
        """All drives at ``theta`` (m), derivatives by the ``active`` thetas, all unless given, at
        the inputs that ``theta`` implies."""
        none = active is not None and not len(active)
        at = None if none else self.problem.implied(theta, shapes)
        return self._made(self.problem.linearise(theta, shapes, active, at), theta, shapes)

    def white_at(self, theta: Floats, shapes: Shapes = NO_SHAPES) -> Linearisation:
        """All drives at ``theta`` (m), derivatives by every theta, and nothing kept of what they
        were before whitening, which takes as much room."""
        raw = self.problem.linearise(theta, shapes, None, self.problem.implied(theta, shapes))
        return self._as_judged(raw, theta, shapes)

    def innovations_at(self, theta: Floats, shapes: Shapes = NO_SHAPES) -> Linearisation:
        """All drives at ``theta`` (m), without derivatives, from where others can be linearised."""
        at = self.problem.implied(theta, shapes)
        return self._made(self.problem.linearise(theta, shapes, NO_DERIVATIVES, at), theta, shapes)

    def relinearise(
        self,
        lin: Linearisation,
        theta: Floats,
        shapes: Shapes | None = None,
        active: NDArray[np.int64] | None = None,
    ) -> Linearisation:
        """The same at a ``theta`` (m) not far from a linearisation, at the inputs that this one
        implied, and with its ``shapes`` unless given."""
        shapes = lin.shapes if shapes is None else shapes
        raw = self.problem.linearise(theta, shapes, active, lin.implied)
        return self._made(raw, theta, shapes)

    def whitened(
        self, lin: Linearisation, active: NDArray[np.int64] | None = None
    ) -> Linearisation:
        """A linearisation as this objective judges it, with all its derivatives or those by the
        ``active`` thetas alone."""
        if active is None:
            tables = [each.table.copy() for each in lin.raw]
            return self._white(tables, lin.raw, lin.theta, lin.shapes)
        tables = [np.take(each.table, np.append(0, 1 + active), 1) for each in lin.raw]
        return replace(self._white(tables, lin.raw, lin.theta, lin.shapes), active=active)

    def judged(self, lin: Linearisation) -> Linearisation:
        """A linearisation that is white already, at the cost that it has in this span."""
        if not np.isfinite(lin.cost):
            return lin
        return replace(lin, cost=self._cost(lin.r, lin.theta))

    def _cost(self, r: Floats, theta: Floats) -> float:
        return float(np.sum(self.in_span(r) ** 2) + np.sum(self.prior * theta**2))

    def _made(
        self, raw: Sequence[NormalisedInnovations], theta: Floats, shapes: Shapes
    ) -> Linearisation:
        """Of what the problem gave.  Where some derivatives are wanted, none is kept as it was
        before whitening: only with every one of them is the noise model estimated."""
        if raw[0].active is None:
            return self._white([each.table.copy() for each in raw], raw, theta, shapes)
        return self._as_judged(raw, theta, shapes)

    def _as_judged(
        self, raw: Sequence[NormalisedInnovations], theta: Floats, shapes: Shapes
    ) -> Linearisation:
        """Of what the problem gave, of which the innovations are kept, not their derivatives: these
        are used up where nobody else keeps them."""
        alone, tables = [each.alone for each in raw], [each.table for each in raw]
        tables = [table if table.flags.writeable else table.copy() for table in tables]
        white = self._white(tables, alone, theta, shapes)
        return replace(white, active=raw[0].active)

    def _white(
        self,
        tables: list[Floats],
        raw: Sequence[NormalisedInnovations],
        theta: Floats,
        shapes: Shapes,
    ) -> Linearisation:
        """From ``tables`` (K, 1 + a) of every drive, which are used up; ``raw`` stands beside."""
        with np.errstate(over="ignore", invalid="ignore"):  # infinite, where the equations run away
            white = self.whiten(tables)
            r, active = white[:, 0], white[:, 1:]
            cost = self._cost(r, theta)
        if runs_away(active):
            cost = np.inf  # nowhere to go on from
        implied = tuple(innovations.implied for innovations in raw)
        return Linearisation(theta, shapes, r, active, cost, raw, implied, raw[0].active)

    def modulated(
        self, lin: Linearisation, thetas: NDArray[np.int64], modulations: Iterable[Modulation]
    ) -> Floats:
        """Derivatives (K, c), white, by ``thetas`` (c), each of which acts as the ``modulations``
        say, one of each drive."""
        return self.whiten(
            self.problem.modulated(lin.theta, lin.shapes, lin.implied, thetas, modulations)
        )

    def whiten(self, raw: list[Floats]) -> Floats:
        """Tables (K, c) of all drives as one, without autocorrelation and outliers; they are used
        up."""
        white = self._whitened(raw)
        return white[0] if len(white) == 1 else np.concatenate(white)

    def _whitened(self, raw: list[Floats]) -> list[Floats]:
        """The same, one of each drive."""
        for table, s, weight, noise in zip(
            raw, self.stretches, self.weights, self.scattered, strict=True
        ):
            self.noise_model.whiten_in_place(s, table)
            table *= weight[:, None]
            noise.whiten_in_place(table)
        return raw

    def in_span(self, values: Floats) -> Floats:
        """What of ``values`` (K, …) lies in the span."""
        return values if self.span is None else self.span.T @ values

    def within_bounds(self, theta: Floats, free: NDArray[np.int64]) -> Floats:
        """``theta`` (m) with the ``free`` ones (indices) no further than is plausible; what is held
        stays where it is."""
        inside = theta.copy()
        inside[free] = np.clip(theta[free], self.low[free], self.high[free])
        return inside


def runs_away(derivatives: Floats) -> bool:
    """Whether derivatives (K, c) are so large, or NaN, that the equations have run away."""
    if not derivatives.size:
        return False
    return not (derivatives.min() > -RUNAWAY and derivatives.max() < RUNAWAY)
