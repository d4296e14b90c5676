"""Scores of slow causes in slow noise, whose colour is estimated from the same short record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.signal import lfilter

from clutchest.inference.estimated_noise import LONGEST, EstimatedNoise, with_estimated_noise
from clutchest.inference.noise_model import NoiseModel, Stretches
from clutchest.inference.score_test import ScoreTest, score_test
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

READINGS, SLOW = 500, 0.97
NUISANCES, CAUSES = 8, 4


def one_stretch(readings: int) -> Stretches:
    return Stretches(np.zeros(readings, np.int64), np.arange(readings))


@dataclass(frozen=True)
class Record:
    """Readings of slow noise, explained by slow nuisances; no cause acts."""

    test: ScoreTest
    noise: EstimatedNoise
    lin: Linearisation
    columns: Floats

    @classmethod
    def drawn(cls, seed: int, readings: int = READINGS) -> Record:
        rng = np.random.default_rng(seed)
        t = np.linspace(0.0, 1.0, readings)[:, None]
        every = np.cos(np.pi * t * np.arange(NUISANCES + CAUSES))
        error = lfilter([1.0], [1.0, -SLOW], rng.standard_normal(readings))
        inner = every.T @ every + np.eye(every.shape[1])
        rest = error - every @ np.linalg.solve(inner, every.T @ error)
        stretch = one_stretch(readings)
        model = NoiseModel.fit([stretch], [rest])
        psi, columns = np.split(model.whiten(stretch, every), [NUISANCES], axis=1)
        r, prior = model.whiten(stretch, error), np.zeros(NUISANCES)
        theta = np.linalg.lstsq(psi, r, rcond=None)[0]
        lin = Linearisation(-theta, {}, r - psi @ theta, psi, 0.0, (), ())
        free = np.arange(NUISANCES)
        test = score_test(lin, free, prior, columns, (False,) * CAUSES, seed, draws=300)
        return cls(test, EstimatedNoise(model, [stretch]), lin, columns)

    def calibrated(self) -> ScoreTest:
        free, prior = np.arange(NUISANCES), np.zeros(NUISANCES)
        return with_estimated_noise(
            self.test, self.noise, self.lin, free, prior, self.columns, seed=5
        )


def significance(test: ScoreTest) -> float:
    return float(test.p_family_wise(test.p_alone(test.z).min()))


@pytest.mark.statistics
def test_false_alarms_in_slow_noise_are_a_third():
    """Not the nominal share: the colour that draws are made by is estimated as well."""
    records = [Record.drawn(seed) for seed in range(800, 900)]
    as_known = np.mean([significance(record.test) < 0.01 for record in records])
    as_estimated = np.mean([significance(record.calibrated()) < 0.01 for record in records])
    assert as_known > 0.5, "or there is nothing to mend"
    assert as_estimated < as_known / 3.0


def test_a_cause_that_is_strong_stays_significant():
    record = Record.drawn(3)
    strong = record.lin.r - record.columns @ np.full(CAUSES, 12.0 / record.test.std)
    free, prior = np.arange(NUISANCES), np.zeros(NUISANCES)
    lin = Linearisation(record.lin.theta, {}, strong, record.lin.psi, 0.0, (), ())
    test = score_test(lin, free, prior, record.columns, (False,) * CAUSES, 3, draws=300)
    noise = record.noise
    assert (
        significance(with_estimated_noise(test, noise, lin, free, prior, record.columns, seed=5))
        < 1e-3
    )


def test_of_a_long_record_the_colour_is_known():
    record = Record.drawn(1, LONGEST + 1)
    assert record.calibrated() is record.test


def test_coloured_noise_is_what_whitening_undoes():
    rng = np.random.default_rng(2)
    stretches = Stretches(np.repeat([0, 1], 300), np.tile(np.arange(150), 4))
    slow = lfilter([1.0], [1.0, -1.2, 0.5], rng.standard_normal((600, 3)), axis=0)
    model = NoiseModel.fit([stretches], [slow[:, 0]])
    np.testing.assert_allclose(model.coloured(stretches, model.whiten(stretches, slow)), slow)
