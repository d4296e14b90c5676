"""Drives drawn from the filter's own model: the statistics they claim, and the filter's on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from bench import Bench
from clutchest.errors import ClutchestError
from clutchest.estimate import whole_log
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, FilterOptions, first_belief
from compute import linear
from drawn import Driver, draw

BenchOf = Callable[[str], Bench]
DRAWS = 400
pytestmark = pytest.mark.slow  # of the compiler that draws


@pytest.fixture(scope="module")
def tanks() -> tuple[Compiled, Timeline, Belief]:
    """Two tanks: two seconds in which they are gauged now and then."""
    digest, functions = linear.compiled()
    compiled = Compiled(
        linear.MACHINE,
        linear.TANKS,
        functions,
        digest,
        linear.NUMBERS,
        np.zeros(0),
        (),
        np.zeros(0),
    )
    K = 60
    line = Timeline(
        t=np.linspace(0.0, 2.0, K),
        sensor=np.resize([-1, 0, 1], K).astype(np.int8),
        z=np.zeros(K),
        R=np.full(K, 0.04),
        u=np.ones((K, 1)),
        row=np.zeros(K, np.int64),
        W=np.zeros((1, 0)),
        Q=np.array([[0.1, 0.02, 0.0, 0.0]]),
        longest=np.array([0.02]),
        mode=np.zeros(K, np.uint8),
        emit=np.arange(K),
        grid=np.ones(K, bool),
        noise=np.array([0.3]),
        variance=np.array([0.2]),
        warnings=(),
    )
    prior = first_belief(np.array([2.0, 1.0]), np.array([[2.0, 0.3], [0.3, 1.0]]), np.zeros((2, 0)))
    return compiled, line, prior


def test_without_measurements_they_spread_as_the_model_says(
    tanks: tuple[Compiled, Timeline, Belief],
) -> None:
    compiled, line, prior = tanks
    blind = replace(line, sensor=np.full(len(line.t), -1, np.int8))
    predicted = whole_log.run(compiled, blind, prior)
    drawn = [draw(compiled, blind, prior, seed, driver=None) for seed in range(DRAWS)]
    last = np.array([d.x[-1] for d in drawn]) - predicted.x[-1]
    np.testing.assert_allclose(drawn[0].bound, np.einsum("kii->ki", predicted.P), rtol=1e-9)
    d2 = np.einsum("di,ij,dj->d", last, np.linalg.inv(predicted.P[-1]), last)
    assert stats.kstest(d2, stats.chi2(2).cdf).pvalue > 1e-3
    assert np.all(np.abs(last.mean(0)) < 4 * last.std(0) / np.sqrt(DRAWS))


def test_slip_energy_makes_noise(tanks: tuple[Compiled, Timeline, Belief]) -> None:
    """Only the noise per joule: what the upper tank gathers is in proportion to its energy."""
    compiled, line, prior = tanks
    quiet = replace(
        line,
        sensor=np.full(len(line.t), -1, np.int8),
        noise=np.zeros(1),
        Q=np.array([[0.0, 0.0, 0.02, 0.0]]),
    )
    sure = first_belief(prior.x, 1e-12 * np.eye(2), prior.S)
    predicted = whole_log.run(compiled, quiet, sure)
    gathered = [
        draw(compiled, quiet, sure, s, driver=None).x[-1, 0] - predicted.x[-1, 0]
        for s in range(DRAWS)
    ]
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], DRAWS) / DRAWS
    assert low < np.mean(np.square(gathered)) / predicted.P[-1, 0, 0] < high


def test_on_a_linear_model_the_filter_attains_the_bound(
    tanks: tuple[Compiled, Timeline, Belief],
) -> None:
    compiled, line, prior = tanks
    errors, nis = [], []
    for seed in range(DRAWS):
        drawn = draw(compiled, line, prior, seed, driver=None)
        filtered = whole_log.run(compiled, drawn.timeline, prior, FilterOptions(limit=1e9))
        np.testing.assert_allclose(drawn.bound, np.einsum("kii->ki", filtered.P), rtol=1e-9)
        errors.append(filtered.x[-1] - drawn.x[-1])
        seen = line.sensor >= 0
        nis.append(np.mean(filtered.innovation[seen, 0] ** 2 / filtered.innovation[seen, 1]))
    nees = np.mean(np.einsum("di,ij,dj->d", errors, np.linalg.inv(filtered.P[-1]), errors))
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], 2 * DRAWS) / DRAWS
    assert low < nees < high
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], DRAWS * seen.sum()) / (DRAWS * seen.sum())
    assert low < np.mean(nis) < high


def test_a_driver_answers_to_the_last_reading_and_to_no_truth(
    tanks: tuple[Compiled, Timeline, Belief],
) -> None:
    compiled, line, prior = tanks
    held = replace(line, z=np.full(len(line.t), 5.0))
    drawn = draw(compiled, held, prior, 1, driver=Driver("upper_level", {"inflow": 0.5}))
    read = np.flatnonzero(line.sensor == 0)
    answer = drawn.timeline.u[:, 0] - held.u[:, 0]
    assert np.all(answer[: read[0] + 1] == 0.0)
    for a, b in zip(read, [*read[1:], len(line.t) - 1], strict=True):
        np.testing.assert_allclose(answer[a + 1 : b + 1], 0.5 * (5.0 - drawn.timeline.z[a]))
    assert np.all(held.u == 1.0), "the plan stays as it was"


def test_the_same_seed_is_the_same_drive(tanks: tuple[Compiled, Timeline, Belief]) -> None:
    a, b, other = (draw(*tanks, seed, driver=None) for seed in (3, 3, 4))
    assert np.array_equal(a.x, b.x)
    assert np.array_equal(a.timeline.z, b.timeline.z)
    assert not np.array_equal(a.x, other.x)


def test_a_model_that_jumps_is_refused(bench: BenchOf) -> None:
    full = bench("dry_clutch").full
    line = bench("dry_clutch").timeline(full)
    with pytest.raises(ClutchestError, match="jumps"):
        draw(full, line, bench("dry_clutch").belief(full, line), 0)
