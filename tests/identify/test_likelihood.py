"""How sure a fit says it is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from clutchest.identify.likelihood import widened
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation

BLOCKS, LENGTH = 200, 25


@pytest.mark.parametrize(("louder", "least"), [(1.0, 1.0), (3.0, 1.8)])
def test_noise_that_is_louder_where_it_matters_widens_the_interval(
    louder: float, least: float
) -> None:
    """Straight-line fits to 400 draws: what they scatter by, beside what each of them says."""
    rng = np.random.default_rng(8)
    heavy = np.repeat(rng.random(BLOCKS) < 0.2, LENGTH)
    psi = np.where(heavy, 1.0, 0.1)[:, None] * rng.standard_normal((len(heavy), 2))
    level = np.where(heavy, louder, 1.0)
    covariance = np.linalg.inv(psi.T @ psi + np.eye(2))
    blocks = np.repeat(np.arange(BLOCKS), LENGTH)
    found, stated = [], []
    for _ in range(400):
        true = rng.standard_normal(2)
        r = level * rng.standard_normal(len(psi)) - psi @ true
        theta = -covariance @ (psi.T @ r)
        fit = Linearisation(theta, {}, r + psi @ theta, psi, 0.0, (), ())
        found.append(theta - true)
        stated.append(np.diag(widened(covariance, fit, np.arange(2), blocks)))
    scatter, told = np.std(found, axis=0), np.sqrt(np.mean(stated, axis=0))
    assert np.all(told > 0.99 * least * np.sqrt(np.diag(covariance)))
    np.testing.assert_allclose(told, scatter, rtol=0.12)  # of 400 draws: ± 3.5 %


def test_blocks_number_what_lies_together() -> None:
    drives = [
        SimpleNamespace(readings=SimpleNamespace(t=np.array(t)))
        for t in ([0.2, 1.5, 0.9, 7.0], [], [0.1, 1.1])
    ]
    numbered = Problem.blocks(SimpleNamespace(drives=drives), 1.0)  # type: ignore[arg-type]
    assert numbered.tolist() == [0, 1, 0, 2, 3, 4]
