"""A noise model with what unknowns took up of the noise given back.

Unknowns take up slow errors with what they explain, so that the rest looks less autocorrelated than
the noise is: the more, the shorter a record and the slower its noise.  How much less is seen on
noise drawn from the model, of which the unknowns take their share as of the record; what that costs
its autocovariances is given back, and so on with the model that this makes: restricted likelihood
(D. Harville, Maximum likelihood approaches to variance component estimation, 1977) by simulation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.inference.noise_model import NoiseModel, Stretches, sums
from clutchest.signals import Floats

TURNS, DRAWS = 6, 60


def restored(
    model: NoiseModel,
    stretches: Sequence[Stretches],
    innovations: Sequence[Floats],
    derivatives: Sequence[Floats],
) -> NoiseModel:
    """The ``model`` of what unknowns leave of the ``innovations`` (K) of every drive, restored;
    ``derivatives`` (K, m) by unknowns of prior variance 1."""
    white = np.random.default_rng(len(stretches)).standard_normal(
        (sum(map(len, innovations)), DRAWS)
    )
    tables = [np.column_stack(pair) for pair in zip(innovations, derivatives, strict=True)]
    edges = np.cumsum([len(table) for table in tables])[:-1]
    for _ in range(TURNS):
        own = [model.whiten(s, table) for s, table in zip(stretches, tables, strict=True)]
        whole = np.column_stack([np.concatenate(own), white])
        r, psi = whole[:, [0, *range(-DRAWS, 0)]], whole[:, 1:-DRAWS]
        inner = psi.T @ psi + np.eye(psi.shape[1])
        rest = r - psi @ np.linalg.solve(inner, psi.T @ r)

        def coloured(values: Floats, model: NoiseModel = model) -> list[Floats]:
            parts = zip(stretches, np.split(values, edges), strict=True)
            return [model.coloured(s, part) for s, part in parts]

        left, count = sums(stretches, coloured(rest[:, 0]))
        drawn, _ = sums(stretches, coloured(white))
        kept, _ = sums(stretches, coloured(rest[:, 1:]))
        model = NoiseModel.of_sums(model.groups, left + drawn - kept, count)
    return model
