"""Isolation: the fault with its onset and size, and the faults that the data do not exclude."""

from types import SimpleNamespace

import numpy as np
import pytest
from linear_drive import THETAS, linear_drive

from clutchest.diagnosis.fault_tests import run_fault_tests
from clutchest.diagnosis.isolation import (
    Explanation,
    explanations,
    not_excluded,
    scores,
    separability,
)
from clutchest.diagnosis.isolation import hypotheses as hypotheses_of
from clutchest.inference.unknowns import UnknownGain
from clutchest.models import machine_of

TRUCK = machine_of("dry_clutch")
FAULTS = {fault.name: fault for fault in TRUCK.faults}
TWO = SimpleNamespace(faults=(FAULTS["friction_level"], FAULTS["torque_gain"]), wear=None)


def results_of(machine, **options):
    drive, *_ = linear_drive(**options)
    return run_fault_tests(drive, machine, 1.0, 1.0)


@pytest.mark.parametrize("off", [-2, -1, 0, 1, 2])
def test_the_onset_may_be_off(off):
    results = results_of(TWO, seed=4, size=0.8, onset=20, blocks=40)
    best = explanations(results, [20 + off], 40)[0]
    assert best.fault == "friction_level" and best.behind == 0.0
    assert abs(best.onset - 20) <= 1
    assert best.size == pytest.approx(0.8 * 0.5, abs=4 * best.std)


def explanation(fault, behind):
    return Explanation(fault, 1.0, 0.1, "1", 0, behind)


def test_rivals_are_excluded_at_95_percent():
    ranked = [explanation("a", 0.0), explanation("b", 2.6), explanation("c", 2.8)]
    assert not_excluded(ranked) == ("a", "b")


PADS = (
    *THETAS[:3],
    UnknownGain("position_offset", "offset", 1.0),
    UnknownGain("wear", "amount", 3.0),
    UnknownGain("position_drift", "rate", 2.0),
)
POSITION = SimpleNamespace(
    faults=(FAULTS["drift:slave_position"], FAULTS["position_offset"]), wear=TRUCK.wear
)


def position_derivatives(blocks, per_block=15):
    """An offset, wear that lowers the zero position as much, and a drift, in units."""
    rng = np.random.default_rng(6)
    psi = rng.standard_normal((blocks * per_block, 6))
    hours = np.repeat(300.0 * np.arange(blocks) / 3600.0, per_block)
    psi[:, 4] = -3.0 * psi[:, 3]
    psi[:, 5] = 2.0 * hours * psi[:, 3]
    return psi


@pytest.mark.parametrize(("size", "names"), [(-0.8, {"position_offset", "wear"}), (0.8, None)])
def test_wear_only_lowers_and_begins_before_the_drive(size, names):
    psi = position_derivatives(40)
    results = results_of(POSITION, seed=7, size=size, blocks=40, thetas=PADS, psi=psi)
    ranked = explanations(results, [0], 40)
    assert set(not_excluded(ranked)) == (names or {"position_offset"})
    assert next(e for e in ranked if e.fault == "wear").size >= 0.0
    later = results_of(POSITION, seed=7, size=size, onset=20, blocks=40, thetas=PADS, psi=psi)
    assert "wear" not in {e.fault for e in explanations(later, [20], 40)}


def test_a_drift_that_begins_later_has_not_drifted_before():
    """Its derivative from block k on is that of a drift from the start less the offset by then."""
    psi = position_derivatives(40)
    results = results_of(POSITION, seed=8, blocks=40, thetas=PADS, psi=psi)
    known = hypotheses_of(results)
    k = 24
    hours = results.blocks.begin[k] / 3600.0
    score, information = scores(results, known, k, 40)
    shifted = psi.copy()
    shifted[:, 5] -= 2.0 * hours * psi[:, 3]
    other = results_of(POSITION, seed=8, blocks=40, thetas=PADS, psi=shifted)
    bare = SimpleNamespace(**{f: getattr(other, f) for f in ("blocks", "residuals")}, faults=())
    expected_score, expected_information = scores(bare, known, k, 40)
    assert score == pytest.approx(expected_score, rel=1e-6, abs=1e-6)
    assert information == pytest.approx(expected_information, rel=1e-6, abs=1e-6)


def test_separability_is_that_of_the_better_sign():
    psi = position_derivatives(40)
    results = results_of(POSITION, seed=9, blocks=40, thetas=PADS, psi=psi)
    names, matrix = separability(results, np.array([0.5, 0.5, 1.0]))
    offset, wear = names.index("position_offset"), names.index("wear")
    assert matrix[offset, wear] < 0.01 < 3.0 < matrix[offset, -1]
    assert matrix[wear, offset] < 0.01
