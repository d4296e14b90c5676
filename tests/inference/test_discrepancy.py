"""How far discrepancies go: what a log shows of what is stated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from clutchest.inference.discrepancy import SHARES, ScatteredDrive, probability, probable_shares
from clutchest.vehicle import SmoothError
from clutchest.vehicle.state_uncertainty import Wander

WALK = Wander("friction", 1.0)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_share_that_a_walk_shows(share: float) -> None:
    """In the mean over logs, of variances; as wide as such an estimate scatters."""
    rng, found = np.random.default_rng(7), []
    for _ in range(20):
        known, columns = rng.normal(size=(400, 3)), 3.0 * rng.normal(size=(400, 40)) / 20.0
        r = rng.normal(size=400) + known @ rng.normal(size=3)
        r += share * columns @ rng.normal(size=40)
        drive = ScatteredDrive.along(np.column_stack([r, known]), [columns])
        found.append(probable_shares([drive], [WALK])[0])
    assert SHARES.min() <= min(found) and max(found) <= SHARES.max()
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(share, abs=0.2)


def test_how_probable_a_share_is_of_data_with_fewer_unknowns() -> None:
    """As by the densities of the normal distribution that is stated."""
    rng = np.random.default_rng(9)
    columns, known = rng.normal(size=(60, 8)), rng.normal(size=(60, 3))
    r = rng.normal(size=60) + 0.7 * columns @ rng.normal(size=8)
    drive = ScatteredDrive.along(np.column_stack([r, known]), [columns])
    told, exact = [], []
    for share in (0.0, 0.3, 1.0):
        told.append(probability([drive.beside(np.array([0, 2]))], np.array([share])))
        covariance = np.eye(60) + share**2 * columns @ columns.T
        covariance += known[:, [0, 2]] @ known[:, [0, 2]].T
        exact.append(multivariate_normal(np.zeros(60), covariance).logpdf(r))
    np.testing.assert_allclose(np.diff(told), np.diff(exact), rtol=1e-6)


def test_unknowns_that_do_nearly_all_that_discrepancies_do_leave_a_probability() -> None:
    """Where a model is far off, derivatives are huge, and what is left of them is rounding."""
    rng = np.random.default_rng(10)
    columns = 1e9 * rng.normal(size=(60, 8))
    known = columns @ rng.normal(size=(8, 5))
    table = np.column_stack([rng.normal(size=60), known])
    shares = np.array([[0.5], [1.0], [2.0]])
    told = [probability([ScatteredDrive.along(table, [columns])], each) for each in shares]
    assert np.isfinite(told).all()


def test_two_drives_are_judged_as_one_table_of_both() -> None:
    """Drives share no walk: their directions are those of one drive with columns for each."""
    rng = np.random.default_rng(8)
    tables = [rng.normal(size=(90, 4)) for _ in range(2)]
    columns = [rng.normal(size=(90, 6)) for _ in range(2)]
    apart = probable_shares(
        [ScatteredDrive.along(t, [c]) for t, c in zip(tables, columns, strict=True)],
        [WALK],
    )
    none = np.zeros((90, 6))
    both = np.vstack([np.column_stack([columns[0], none]), np.column_stack([none, columns[1]])])
    together = probable_shares([ScatteredDrive.along(np.vstack(tables), [both])], [WALK])
    np.testing.assert_allclose(apart, together, rtol=1e-9)


def test_a_smooth_error_counts_as_stated_whatever_a_log_shows() -> None:
    rng = np.random.default_rng(10)
    columns = [rng.normal(size=(90, 6)) for _ in range(2)]
    drive = ScatteredDrive.along(rng.normal(size=(90, 4)), columns)
    share = probable_shares([drive], [WALK, SmoothError("torque", "slave_position", 1.0, 1.0)])
    assert share[0] < 0.3
    assert share[1] == 1.0
