"""Curves of what no named cause explains."""

from __future__ import annotations

import numpy as np
from scipy.stats import multivariate_normal

from clutchest.discovery.curve_evidence import SCALES, evidence, expected


def test_evidence_is_twice_the_logarithm_of_the_bayes_factor() -> None:
    """Of data y = X c + noise with c ~ N(0, s²), s any of SCALES, by the marginal likelihoods
    themselves; many scores at once as each alone."""
    rng = np.random.default_rng(5)
    healthy = multivariate_normal(np.zeros(40), np.eye(40))
    for columns in (1, 3, 8):
        x, none = rng.standard_normal((40, columns)), np.zeros((columns, columns))
        y = rng.standard_normal((4, 40)) + rng.standard_normal((4, columns)) @ x.T
        each = [
            multivariate_normal(np.zeros(40), np.eye(40) + s**2 * x @ x.T).logpdf(y) for s in SCALES
        ]
        factor = 2.0 * (np.log(np.mean(np.exp(each), axis=0)) - healthy.logpdf(y))
        np.testing.assert_allclose(evidence(y @ x, x.T @ x, none), factor, rtol=1e-9)
        np.testing.assert_allclose(evidence(y[2] @ x, x.T @ x, none), factor[2], rtol=1e-9)
        means = [np.linalg.solve(x.T @ x + np.eye(columns) / s**2, x.T @ y[2]) for s in SCALES]
        weights = np.exp(np.array(each)[:, 2] - np.max(np.array(each)[:, 2]))
        weights /= weights.sum()
        mean, off = expected(y[2] @ x, x.T @ x, none)
        np.testing.assert_allclose(mean, weights @ means, rtol=1e-9)
        second = sum(
            w * (np.linalg.inv(x.T @ x + np.eye(columns) / s**2) + np.outer(m, m))
            for w, s, m in zip(weights, SCALES, means, strict=True)
        )
        np.testing.assert_allclose(off.T @ off, second - np.outer(mean, mean), atol=1e-12)


def test_a_faint_direction_is_no_evidence() -> None:
    """Two columns that are all but one: their difference holds only noise, which may go with what
    is left of the data."""
    rng = np.random.default_rng(6)
    shared, noise = rng.standard_normal((2, 400))
    x = np.column_stack([shared, shared + 1e-3 * noise])
    y = 30.0 * noise / np.linalg.norm(noise)
    score, information = 1e3 * y @ x, 1e6 * x.T @ x
    assert evidence(score, information, np.zeros((2, 2))) > 500.0
    assert evidence(score, information, 1e-5 * information) > 500.0  # of itself: all of it is told
    assert evidence(score, information, 1e-5 * 1e6 * np.eye(2) * np.sum(shared**2)) < 5.0
