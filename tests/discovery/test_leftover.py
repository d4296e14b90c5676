"""Curves of what no named cause explains."""

from __future__ import annotations

import numpy as np
from scipy.stats import multivariate_normal

from clutchest.discovery.leftover import Curve


def test_evidence_is_twice_the_logarithm_of_the_bayes_factor() -> None:
    """Of data y = X c + noise with c ~ N(0, 1), by the marginal likelihoods themselves."""
    rng = np.random.default_rng(5)
    for columns in (1, 3, 8):
        x, y = rng.standard_normal((40, columns)), rng.standard_normal(40)
        y += x @ rng.standard_normal(columns)
        covariance = np.linalg.inv(x.T @ x + np.eye(columns))
        best = covariance @ x.T @ y
        curve = Curve(
            "torque", "time", np.arange(columns), best, covariance, np.zeros(0),
            float(y @ x @ best), float(columns), 1.0, 1.0,
        )  # fmt: skip
        error = multivariate_normal(np.zeros(40), np.eye(40) + x @ x.T).logpdf(y)
        none = multivariate_normal(np.zeros(40), np.eye(40)).logpdf(y)
        np.testing.assert_allclose(curve.evidence, 2.0 * (error - none), rtol=1e-9)
