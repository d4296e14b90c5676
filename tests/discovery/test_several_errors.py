"""Which of several equations in error comes first."""

from __future__ import annotations

import numpy as np

from clutchest.discovery.residual_curves import Nuisances
from clutchest.discovery.several_errors import evidence_together
from clutchest.inference.unknowns import UnknownParameter
from made_up import objective_of


def test_two_curves_of_one_equation_count_for_more_than_a_better_one_elsewhere():
    rng = np.random.default_rng(8)
    own = rng.standard_normal((600, 2))
    elsewhere = own.sum(axis=1, keepdims=True) + 0.8 * rng.standard_normal((600, 1))
    measured = 0.4 * own.sum(axis=1) + rng.standard_normal(600)
    objective = objective_of(
        lambda theta: (measured, np.ones((600, 1))), (UnknownParameter("level", 1.0),)
    )
    fit = objective.linearise_at(np.zeros(1))
    bare = Nuisances(fit, np.array([0]), objective.prior)

    def of(columns: np.ndarray) -> float:
        return evidence_together(bare, columns)

    assert max(of(own[:, :1]), of(own[:, 1:])) < of(elsewhere) < of(own)
    assert of(rng.standard_normal((600, 3))) < 0.0
