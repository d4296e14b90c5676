"""What it does to scores that the noise's colour is estimated from the record they are taken of.

A colour that is a little off makes slow causes more significant than they are, or less: the more,
the shorter a record and the slower its noise.  So noise is drawn that is coloured as that of the
record most probably is, its colour estimated in each draw as that of the record was, and the draw's
scores taken by that estimate: a parametric bootstrap
(B. Efron, R. Tibshirani, An Introduction to the Bootstrap, 1993, chapter 6).  Its innovations are
those of the record, in blocks: loud ones come together, and a model of their colour leaves some of
it (H. Künsch, The jackknife and the bootstrap for general stationary observations, 1989).

What the noise of the record most probably is: unknowns take up slow errors with what they explain,
so that the rest looks less autocorrelated than the noise is.  How much less is seen on noise drawn
from the model, of which the unknowns take their share as of the record; what that costs its
autocovariances is given back, and so on with the model that this makes: restricted likelihood
(D. Harville, Maximum likelihood approaches to variance component estimation, 1977) by simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.noise_model import NoiseModel, Stretches
from clutchest.inference.score_test import Projection, ScoreTest
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

DRAWS = 600  # so that the level of the search is that of several of them
MOST = 6 * DRAWS  # where a p-value is near that level: the fifth of 600 draws scatters by 45 %
DOUBTFUL = 1e-5, 0.02  # family-wise p-values for which that matters
BLOCK = 32  # readings
TURNS, DRAWS_OF_MODEL = 6, 60  # of what is given back to a noise model
LONGEST = 2500  # readings; of a longer record, the colour is known well enough
INSIGNIFICANT = 0.05  # family-wise p-value by a known colour, which an estimated one only raises


@dataclass(frozen=True, slots=True)
class EstimatedNoise:
    """The noise ``model`` of a record, as estimated, and how its readings hang together:
    ``stretches`` of every drive."""

    model: NoiseModel
    stretches: Sequence[Stretches]

    def coloured(self, white: Floats) -> Floats:
        """Noise (K, …) whose innovations are ``white`` (K, …), by the model."""
        return self._of_drives(self.model.coloured, white)

    def whitened(self, model: NoiseModel, values: Floats) -> Floats:
        """``values`` (K, …) made white by another ``model``."""
        return self._of_drives(model.whiten, values)

    def restored(self, r: Floats, psi: Floats) -> EstimatedNoise:
        """What it is likely to be, where unknowns by which the innovations ``r`` (K) have these
        derivatives ``psi`` (K, m), both white, took their share, of prior variance 1."""
        rng = np.random.default_rng(len(self.stretches))
        counts = np.repeat([1.0, 1.0, -1.0], [1, DRAWS_OF_MODEL, DRAWS_OF_MODEL])
        counts[1:] /= DRAWS_OF_MODEL
        white = rng.standard_normal((len(r), DRAWS_OF_MODEL))
        noise, known = self, self.coloured(np.column_stack([r, psi]))
        for _ in range(TURNS):
            whole = np.column_stack([noise.whitened(noise.model, known), white])
            r, psi = whole[:, [0, *range(-DRAWS_OF_MODEL, 0)]], whole[:, 1:-DRAWS_OF_MODEL]
            inner = psi.T @ psi + np.eye(psi.shape[1])
            rest = r - psi @ np.linalg.solve(inner, psi.T @ r)
            columns = noise.coloured(np.column_stack([rest[:, 0], white, rest[:, 1:]]))
            parts = np.split(columns, self._edges)
            model = NoiseModel.of_columns(self.stretches, parts, counts)
            noise = replace(noise, model=model)
        return noise

    def estimated(self, rest: Floats) -> NoiseModel:
        """The model of what is left (K) of noise."""
        return NoiseModel.fit(self.stretches, np.split(rest, self._edges))

    @property
    def _edges(self) -> NDArray[np.int64]:
        return np.cumsum([len(s.group) for s in self.stretches])[:-1]

    def _of_drives(self, function: Callable[[Stretches, Floats], Floats], values: Floats) -> Floats:
        parts = np.split(values, self._edges)
        pairs = zip(self.stretches, parts, strict=True)
        return np.concatenate([function(s, np.ascontiguousarray(part)) for s, part in pairs])

    def _whiten_in_place(self, model: NoiseModel, values: Floats) -> None:
        for s, part in zip(self.stretches, np.split(values, self._edges), strict=True):
            model.whiten_in_place(s, part)

    def scores(
        self, projection: Projection, columns: Floats, every: Floats, rng: np.random.Generator
    ) -> Floats:
        """Scores (DRAWS, C), in standard deviations, of noise by causes whose derivatives, white,
        are ``columns`` (K, C), beside the nuisances of a ``projection``, by the colour that is
        estimated of each draw when unknowns with the derivatives ``every`` (K, m) of prior variance
        1 have taken their share."""
        r, psi, known = projection.r, projection.psi, projection.known
        inner = every.T @ every + (1.0 + 1e-9) * np.eye(every.shape[1])
        drawn = self.restored(r, every).coloured(in_blocks(r, rng))
        white = self.whitened(self.model, drawn)
        rest = self.coloured(white - every @ np.linalg.solve(inner, every.T @ white))
        basis = self.coloured(np.column_stack([psi, columns, projection.r]))
        own, null = np.empty_like(basis), np.zeros((DRAWS, columns.shape[1]))
        for k in range(DRAWS):
            own[:], own[:, -1] = basis, drawn[:, k]
            self._whiten_in_place(self.estimated(rest[:, k]), own)
            free = own[:, : psi.shape[1]]
            of_draw = Projection(own[:, -1], free, np.zeros(psi.shape[1]), known, free.T @ free)
            c = of_draw.apart(own[:, psi.shape[1] : -1])
            score = c.score + rng.standard_normal(len(c.away)) @ c.away
            null[k] = score / np.sqrt(np.maximum(c.variance, 1e-300))
        return null


def in_blocks(r: Floats, rng: np.random.Generator) -> Floats:
    """Innovations (K, DRAWS) out of ``r`` (K), in blocks that begin anywhere, on a circle."""
    begins = rng.integers(len(r), size=(-(-len(r) // BLOCK), 1, DRAWS))
    rows = (begins + np.arange(BLOCK)[:, None]).reshape(-1, DRAWS)[: len(r)]
    return r[rows % len(r)]


def with_estimated_noise(
    test: ScoreTest,
    noise: EstimatedNoise,
    lin: Linearisation,
    nuisances: NDArray[np.int64],
    prior: Floats,
    columns: Floats,
    seed: int,
) -> ScoreTest:
    """The test of causes whose derivatives, white, are ``columns`` (K, C), its null that of scores
    by an estimated colour; the test itself where the record is long, or nothing is significant."""
    if len(lin.r) > LONGEST or not test.least_p <= INSIGNIFICANT:
        return test
    projection = Projection.of(lin, nuisances, prior)
    every = np.column_stack([projection.psi, columns])
    rng, std = np.random.default_rng(seed), np.where(np.isfinite(test.std), test.std, 0.0)
    test = replace(test, null=std * noise.scores(projection, columns, every, rng))
    while len(test.null) < MOST and DOUBTFUL[0] < test.least_p < DOUBTFUL[1]:
        more = std * noise.scores(projection, columns, every, rng)
        test = replace(test, null=np.vstack([test.null, more]))
    return test
