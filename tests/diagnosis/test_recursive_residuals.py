"""Residuals block by block against the same problem solved whole, by dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from linear_drive import FAULTS, STATES, THETAS, linear_drive

import clutchest
from clutchest.diagnosis.blocks import block_index
from clutchest.diagnosis.recursive_residuals import nuisances, onset_scores, recursive_residuals
from clutchest.generator.mismatch import Mismatch
from clutchest.inference.unknowns import InitialState, UnknownGain
from clutchest.vehicle.state_uncertainty import Wander


def test_residuals_are_the_innovations_of_the_whole_linear_drive():
    blocks, rows, covariance, of = linear_drive(1)
    result = recursive_residuals(blocks, FAULTS)
    for k in (0, 1, 5, 11):
        before, own = of < k, of == k
        gain = np.linalg.solve(covariance[np.ix_(before, before)], covariance[np.ix_(before, own)])
        e = rows[own, 0] - gain.T @ rows[before, 0]
        S = covariance[np.ix_(own, own)] - covariance[np.ix_(own, before)] @ gain
        trace = rows[own][:, 1 + np.array(FAULTS)]
        information = np.diag(trace.T @ np.linalg.solve(S, trace))
        z = -trace.T @ np.linalg.solve(S, e) / np.sqrt(information)
        assert result.z[k] == pytest.approx(z, abs=1e-8)
        assert result.information[k] == pytest.approx(information, rel=1e-8)
        assert result.chi_square[k] == pytest.approx(e @ np.linalg.solve(S, e), rel=1e-8)


@pytest.mark.parametrize("onset", [0, 5])
def test_scores_since_the_onset_are_those_of_all_readings(onset):
    blocks, rows, covariance, _ = linear_drive(2, size=0.4, onset=onset, masked=True)
    before = recursive_residuals(blocks, FAULTS).before
    result = onset_scores(blocks, FAULTS, before, onset, len(blocks))
    trace = rows[:, 1 + np.array(FAULTS)]
    weighted = np.linalg.solve(covariance, trace)
    assert result.information[-1] == pytest.approx(trace.T @ weighted, rel=1e-7, abs=1e-7)
    assert result.score[-1] == pytest.approx(-weighted.T @ rows[:, 0], rel=1e-7, abs=1e-7)


def test_a_block_that_tells_next_to_nothing_of_a_fault_tells_nothing():
    """What is left of a derivative there is noise of the inputs."""
    blocks = linear_drive(3)[0]
    gram = blocks.gram.copy()
    gram[5, 1 + FAULTS[0], :] *= 0.01
    gram[5, :, 1 + FAULTS[0]] *= 0.01
    result = recursive_residuals(replace(blocks, gram=gram), FAULTS)
    assert result.z[5, 0] == 0.0
    assert np.all(result.z[np.arange(12) != 5, 0] != 0.0)
    assert np.all(result.z[:, 1] != 0.0)


def test_healthy_residuals_are_white_and_of_variance_one():
    z = np.concatenate(
        [recursive_residuals(linear_drive(seed)[0], FAULTS).z[:, 0] for seed in range(60)]
    )
    assert np.mean(z**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(z)))
    assert np.mean(z[1:] * z[:-1]) == pytest.approx(0.0, abs=4 / np.sqrt(len(z)))


def test_a_healthy_clutch_may_wear():
    thetas = (*THETAS, UnknownGain("wear", "rate", 0.5, healthy=0.1))
    free, variance, per_hour = nuisances(thetas, STATES)
    assert free.tolist() == [0, 1, 2, 5]
    assert variance[-1] == pytest.approx(0.01)
    assert per_hour.tolist() == [0.0, 0.0, 1.0, 0.0]


def test_a_healthy_clutch_may_start_warm():
    thetas = (InitialState("temp_body", 8.0), InitialState("friction", 0.02))
    _, variance, per_hour = nuisances(thetas, STATES)
    assert variance.tolist() == [(40.0 / 8.0) ** 2, 1.0]
    assert per_hour.tolist() == [0.0, 1.0]


def test_a_healthy_clutch_may_wander_as_its_file_states():
    """A torque bias by 0.5 Nm/√s is six starts of 5 Nm in an hour; friction no less than ever."""
    thetas = (InitialState("torque_bias", 5.0), InitialState("friction", 0.02))
    stated = (Wander("torque_bias", 0.5), Wander("friction", 1e-4))
    assert nuisances(thetas, STATES, stated)[2] == pytest.approx([36.0, 1.0])


@pytest.mark.slow
def test_a_torque_bias_that_wanders_as_the_file_states_is_no_fault():
    """It was, by 10.9 ± 1.7 Nm, where 30 Nm matter."""
    wandering = Mismatch.drawn(["wander"], 88013)
    run = clutchest.simulate("truck", "mixed", 88013, duration=900.0, mismatch=wandering)
    assert np.ptp(run.truth.columns["torque_bias"]) > 10.0
    assert clutchest.diagnose(run, "truck").faults == ()


def test_a_pause_or_its_length_ends_a_block():
    t = np.array([0.0, 1.0, 2.5, 5.5, 6.0, 20.0, 5.6])
    assert block_index(t).tolist() == [0, 0, 0, 1, 1, 2, 1]
    assert np.bincount(block_index(np.arange(0.0, 18.0))).tolist() == [6, 6, 6]
