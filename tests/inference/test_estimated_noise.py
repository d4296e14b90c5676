"""Scores of slow causes in slow noise, whose colour is estimated from the same short record."""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.signal import lfilter

from clutchest.inference import estimated_noise
from clutchest.inference.estimated_noise import LONGEST, EstimatedNoise, with_estimated_noise
from clutchest.inference.noise_model import FEWEST, NoiseModel, Stretches
from clutchest.inference.score_test import Projection, ScoreTest, score_test
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


def test_innovations_that_come_together_are_drawn_together(monkeypatch):
    monkeypatch.setattr(estimated_noise, "DRAWS", 400)
    loud = np.zeros(READINGS)
    loud[100:120] = 1.0
    sums = estimated_noise.in_blocks(loud, np.random.default_rng(1)).sum(axis=0)
    alone = np.sqrt(20.0 * (1.0 - 20.0 / READINGS))  # standard deviation, drawn one by one
    assert sums.mean() == pytest.approx(20.0, abs=2.0)
    assert sums.std() > 2.5 * alone


def test_more_is_drawn_where_few_draws_do_not_tell(monkeypatch):
    """As many as there are batches, until a p-value is clear."""
    for doubtful, batches in (((0.0, 2.0), 3), ((0.0, 0.0), 1)):
        monkeypatch.setattr(estimated_noise, "DRAWS", 20)
        monkeypatch.setattr(estimated_noise, "MOST", 60)
        monkeypatch.setattr(estimated_noise, "DOUBTFUL", doubtful)
        assert len(Record.drawn(800).calibrated().null) == 20 * batches


def test_of_a_long_record_the_colour_is_known():
    record = Record.drawn(1, LONGEST + 1)
    assert record.calibrated() is record.test


def test_coloured_noise_is_what_whitening_undoes():
    rng = np.random.default_rng(2)
    stretches = Stretches(np.repeat([0, 1], 300), np.tile(np.arange(150), 4))
    slow = lfilter([1.0], [1.0, -1.2, 0.5], rng.standard_normal((600, 3)), axis=0)
    model = NoiseModel.fit([stretches], [slow[:, 0]])
    np.testing.assert_allclose(model.coloured(stretches, model.whiten(stretches, slow)), slow)


def test_scores_of_draws_are_those_of_all_that_is_left_of_each(monkeypatch):
    """By whole information matrices, with nuisances that have a prior and some that have none."""
    monkeypatch.setattr(estimated_noise, "DRAWS", 8)
    record, known = Record.drawn(4), np.repeat([0.0, 2.0], NUISANCES // 2)
    projection = Projection.of(record.lin, np.arange(NUISANCES), known)
    every = np.column_stack([projection.psi, record.columns])
    noise, given = record.noise, (projection, record.columns, every)
    found = noise.scores(*given, np.random.default_rng(6))

    rng = np.random.default_rng(6)
    innovations = estimated_noise.in_blocks(projection.r, rng)
    drawn = noise.restored(projection.r, every).coloured(innovations)
    white = noise.whitened(noise.model, drawn)
    inner = every.T @ every + (1.0 + 1e-9) * np.eye(every.shape[1])
    rest = noise.coloured(white - every @ np.linalg.solve(inner, every.T @ white))
    for score, each, left in zip(found, drawn.T, rest.T, strict=True):
        model = noise.estimated(left)
        r = noise.whitened(model, each[:, None])[:, 0]
        own = noise.whitened(model, noise.coloured(every))
        psi, columns = np.split(own, [NUISANCES], axis=1)
        c = Projection(r, psi, np.zeros(NUISANCES), known, psi.T @ psi).out_of(columns.copy())
        expected = c.score + rng.standard_normal(len(c.away)) @ c.away
        np.testing.assert_allclose(score, expected / np.sqrt(np.diag(c.information)), atol=1e-9)


def test_scores_take_no_product_of_all_causes_with_all(monkeypatch):
    """Of causes by themselves the variance counts, not how they resemble each other."""
    monkeypatch.setattr(estimated_noise, "DRAWS", 3)
    causes, rng = 3000, np.random.default_rng(7)
    stretch = one_stretch(FEWEST)
    r, psi = rng.standard_normal(FEWEST), rng.standard_normal((FEWEST, 2))
    noise = EstimatedNoise(NoiseModel.fit([stretch], [r]), [stretch])
    projection = Projection(r, psi, np.zeros(2), np.ones(2), psi.T @ psi)
    columns = rng.standard_normal((FEWEST, causes))
    tracemalloc.start()
    try:
        noise.scores(projection, columns, psi, rng)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 0.5 * causes**2 * columns.itemsize
