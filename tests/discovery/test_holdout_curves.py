"""Curves judged by drives that were not used to find them."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.discovery.holdout_curves import HeldOutCurves, _likely
from clutchest.discovery.holdout_gain import BLOCK, HeldOutPrediction
from clutchest.discovery.residual_curves import Curve
from clutchest.signals import Floats

AT = np.arange(0.0, 40.0 * BLOCK, 1.0)
SECOND = AT // BLOCK % 2 == 1
NONE = np.zeros(len(AT))


def curve(covariate: str, evidence: float) -> Curve:
    return Curve(
        "torque",
        "torque",
        covariate,
        np.zeros(2),
        np.zeros(2),
        np.zeros((0, 2)),
        evidence,
        evidence,
        1e-9,
    )


def held_out_prediction(white: Floats) -> HeldOutPrediction:
    return HeldOutPrediction(AT, white, white, AT, NONE, 0.0)


def transfer(misfit: Floats, *left: tuple[Curve, Floats]) -> HeldOutCurves:
    """Drives with a ``misfit`` of which each curve leaves what stands beside it."""
    columns = np.column_stack([misfit, *(rest for _, rest in left)])
    span = np.linalg.svd(columns, full_matrices=False)[0]
    curves = tuple(curve for curve, _ in left)
    parts = np.ones(len(AT), bool), ~SECOND, SECOND
    gained = [
        [np.sum(misfit[part] ** 2 - rest[part] ** 2) / 2.0 for part in parts] for _, rest in left
    ]
    return HeldOutCurves(
        curves,
        span,
        held_out_prediction(misfit),
        tuple(held_out_prediction(rest) for _, rest in left),
        np.array(gained),
    )


@pytest.fixture
def misfit() -> Floats:
    return 0.3 * np.random.default_rng(1).standard_normal(len(AT))


def test_what_goes_with_it_on_another_road_comes_first(misfit: Floats) -> None:
    carried = transfer(
        misfit, (curve("temp_disc", 100.0), 0.9 * misfit), (curve("temp_body", 95.0), 0.1 * misfit)
    )
    assert [c.covariate for c in carried.ranked()] == ["temp_body", "temp_disc"]
    chosen, gain = carried.best([True, True])
    assert chosen is carried.curves[1]
    assert gain is not None
    assert gain.total == pytest.approx((1 - 0.1**2) * np.sum(misfit**2) / 2.0)


def test_the_log_counts_as_much(misfit: Floats) -> None:
    carried = transfer(
        misfit, (curve("temp_disc", 300.0), 0.9 * misfit), (curve("temp_body", 95.0), 0.1 * misfit)
    )
    assert [c.covariate for c in carried.ranked()] == ["temp_disc", "temp_body"]


def test_time_is_not_refuted_by_another_drive_and_patches_only_where_it_pays(
    misfit: Floats,
) -> None:
    worse = transfer(
        misfit, (curve("time", 100.0), 2.0 * misfit), (curve("temp_body", 95.0), 1.1 * misfit)
    )
    assert worse.ranked()[0].covariate == "time"
    assert worse.best([True, True])[0] is worse.curves[1]
    assert worse.best([True, False]) == (None, None)
    better = transfer(misfit, (curve("time", 100.0), 0.5 * misfit))
    assert better.best([True])[0] is better.curves[0]


def test_a_gain_is_not_measured_where_the_curve_was_chosen() -> None:
    """Each of two curves does well in one half and harm in the other, as luck has it: each half
    is judged by the curve that the other half speaks for."""
    misfit = 0.3 * np.random.default_rng(2).standard_normal(len(AT))
    lucky_first, lucky_second = np.where(SECOND, 1.5, 0.5), np.where(SECOND, 0.5, 1.5)
    carried = transfer(
        misfit,
        (curve("temp_disc", 0.0), lucky_first * misfit),
        (curve("temp_body", 0.0), lucky_second * misfit),
    )
    gain = carried.best([True, True])[1]
    assert gain is not None
    assert gain.total == pytest.approx((1 - 1.5**2) * np.sum(misfit**2) / 2.0)


def test_nothing_that_the_equations_can_follow_is_no_patch(misfit: Floats) -> None:
    carried = transfer(misfit, (curve("position_rate", 100.0), 0.1 * misfit))
    assert carried.best([False]) == (None, None)


def test_what_a_log_does_not_tell_of_a_curve_no_other_drive_denies() -> None:
    """A curve of two pieces, the second of which the log has hardly seen; beside one nuisance."""
    rng = np.random.default_rng(3)
    pieces = np.column_stack([~SECOND, SECOND]).astype(float)
    own = rng.standard_normal((len(AT), 1))
    r = rng.standard_normal(len(AT)) + pieces @ [-0.5, -0.5]
    told, guessed = np.array([0.5, 0.5]), np.array([0.5, -1.5])
    known, vague = np.diag([0.05, 0.05]), np.diag([0.05, 3.0])

    def gain(coefficients: Floats, off: Floats) -> float:
        with_curve = _likely(r + pieces @ coefficients, own, np.zeros(1), pieces @ off)
        return with_curve - _likely(r, own, np.zeros(1))

    assert gain(told, known) > 50.0
    assert gain(guessed, known) < -50.0
    # it gains where it was seen, less what it costs that elsewhere it might have been anything
    first = gain(np.array([0.5, 0.0]), np.diag([0.05, 0.0]))
    assert first < gain(guessed, vague) < gain(told, known)
