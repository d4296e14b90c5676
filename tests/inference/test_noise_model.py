"""The colour of noise: found, and divided out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from clutchest.inference.noise_model import FEWEST, GAP, ORDER, NoiseModel, Stretches
from clutchest.signals import Floats

FIRST, SECOND = 1.2, -0.4  # x_k = FIRST x_{k−1} + SECOND x_{k−2} + e_k
PERIOD = 0.01
SURE = 0.999  # of every bound here


def ar2(n: int, rng: np.random.Generator) -> Floats:
    """A stretch of the process that has run for long, driven by noise of deviation 1."""
    return lfilter([1.0], [1.0, -FIRST, -SECOND], rng.standard_normal(n + 500))[500:]


def ar2_deviation() -> float:
    """Of the process itself."""
    variance = (1 - SECOND) / ((1 + SECOND) * ((1 - SECOND) ** 2 - FIRST**2))
    return float(np.sqrt(variance))


def one(n: int, sensor: int = 0, row: int = 0) -> Stretches:
    """``n`` readings of one sensor without a hole."""
    return Stretches.of(np.arange(n) * PERIOD, np.full(n, sensor), np.full(n, row))


def correlations(e: Floats, lags: int) -> Floats:
    return np.array([e[lag:] @ e[:-lag] for lag in range(1, lags + 1)]) / (e @ e)


def test_coefficients_of_an_ar2_process():
    """Over 20 draws: no bias, and a scatter no wider than a fit of ``ORDER`` weights makes."""
    n, seeds = 8000, 20
    found = []
    for seed in range(seeds):
        noise_model = NoiseModel.fit([one(n)], [ar2(n, np.random.default_rng(seed))])
        found.append([*noise_model.weights[0, ORDER, :2], noise_model.level[0, ORDER]])
    error = np.array(found) - [FIRST, SECOND, 1.0]
    # what a fit of the full order would scatter by at most: 1/√n times the inverse covariance
    impulse = lfilter([1.0], [1.0, -FIRST, -SECOND], np.eye(1, 400)[0])
    lags = np.array([impulse[k:] @ impulse[: len(impulse) - k] for k in range(ORDER)])
    covariance = lags[np.abs(np.subtract.outer(range(ORDER), range(ORDER)))]
    widest = np.sqrt(np.diag(np.linalg.inv(covariance))[:2] / n)
    std = np.array([*widest, np.sqrt(0.5 / n)])
    assert np.all(np.sum((error / std) ** 2, axis=0) < chi2.ppf(SURE, seeds))
    assert np.all(np.abs(error.mean(axis=0)) < 3.3 * std / np.sqrt(seeds))


def test_what_is_left_is_white():
    """Other draws of the process than the one the colour was learned from."""
    lags, n, seeds = 5, 4000, 20
    noise_model = NoiseModel.fit([one(200_000)], [ar2(200_000, np.random.default_rng(99))])
    total, squares = 0.0, 0.0
    for seed in range(seeds):
        white = noise_model.whiten(one(n), ar2(n, np.random.default_rng(seed)))
        total += n * np.sum(correlations(white, lags) ** 2)
        squares += white @ white
    assert total < chi2.ppf(SURE, lags * seeds)
    assert abs(squares / (n * seeds) - 1.0) < 3.3 * np.sqrt(2 / (n * seeds)) + 0.005


def test_white_noise_stays_as_it_is():
    """Weights are no larger than chance makes them, and the level is the noise's own."""
    n = 20_000
    noise = 2.5 * np.random.default_rng(4).standard_normal(n)
    noise_model = NoiseModel.fit([one(n)], [noise])
    assert n * np.sum(noise_model.weights[0, ORDER] ** 2) < chi2.ppf(SURE, ORDER)
    assert noise_model.level[0, ORDER] == pytest.approx(2.5, rel=3.3 * np.sqrt(0.5 / n))


def test_every_reading_of_a_short_stretch_has_variance_one():
    """The first readings are predicted from the few before them, with their own deviation."""
    noise_model = NoiseModel.fit([one(200_000)], [ar2(200_000, np.random.default_rng(5))])
    rng, count, length = np.random.default_rng(6), 4000, 5
    t = np.concatenate([10.0 * k + np.arange(length) * PERIOD for k in range(count)])
    several = Stretches.of(t, np.zeros(len(t), int), np.zeros(len(t), int))
    white = noise_model.whiten(several, np.concatenate([ar2(length, rng) for _ in range(count)]))
    squares = np.sum(white.reshape(count, length) ** 2, axis=0)
    bounds = chi2.ppf([1 - SURE, SURE], count)
    assert np.all((squares > 0.99 * bounds[0]) & (squares < 1.01 * bounds[1]))
    assert noise_model.level[0, 0] == pytest.approx(ar2_deviation(), rel=0.02)


def test_columns_are_whitened_alike():
    """Innovations and their derivatives: one linear map."""
    rng, n = np.random.default_rng(7), 600
    noise_model = NoiseModel.fit([one(n)], [ar2(n, rng)])
    table = rng.standard_normal((n, 3))
    together = noise_model.whiten(one(n), table)
    np.testing.assert_allclose(together[:, 1], noise_model.whiten(one(n), table[:, 1]))
    mixed = table @ [1.0, -2.0, 0.5]
    np.testing.assert_allclose(together @ [1.0, -2.0, 0.5], noise_model.whiten(one(n), mixed))


def test_holes_break_stretches():
    t = np.arange(3000) * PERIOD
    t[1000:] += (GAP - 1.1) * PERIOD  # a few readings lost
    t[2000:] += (GAP - 0.9) * PERIOD
    broken = Stretches.of(t, np.zeros(3000, int), np.zeros(3000, int))
    assert broken.place[1000] == 1000
    assert broken.place[2000] == 0 and broken.place[2999] == 999
    rng = np.random.default_rng(8)
    values = ar2(3000, rng)
    noise_model = NoiseModel.fit([broken], [values])
    other = np.where(np.arange(3000) < 2000, rng.standard_normal(3000), values)
    before, after = noise_model.whiten(broken, values), noise_model.whiten(broken, other)
    np.testing.assert_array_equal(before[2000:], after[2000:])
    assert np.any(before[:2000] != after[:2000])


def test_sensors_and_regimes_have_colours_of_their_own():
    """Readings sorted by sensor; a regime that comes and goes begins anew each time."""
    rng, n = np.random.default_rng(9), 6000
    row = np.arange(n) // 500 % 2 * 7
    t = np.concatenate([np.arange(n) * PERIOD] * 2)
    sensor, rows = np.repeat([0, 1], n), np.concatenate([row, np.zeros(n, int)])
    both = Stretches.of(t, sensor, rows)
    assert len(np.unique(both.group)) == 3
    assert np.all(both.place[0:n:500] == 0) and both.place[n] == 0
    assert both.place[2 * n - 1] == n - 1
    coloured = ar2(n, rng)
    values = np.where(
        rows == 7, np.concatenate([coloured, coloured]), 3.0 * rng.standard_normal(2 * n)
    )
    noise_model = NoiseModel.fit([both], [values])
    of = dict(zip(noise_model.groups, range(3), strict=True))
    slip = of[both.group[500]]
    assert noise_model.weights[slip, ORDER, 0] == pytest.approx(FIRST, abs=0.1)
    for other in set(range(3)) - {slip}:
        assert abs(noise_model.weights[other, ORDER, 0]) < 3.3 / np.sqrt(n / 2)
        assert noise_model.level[other, ORDER] == pytest.approx(3.0, rel=0.06)


def test_drives_share_a_colour():
    """Two drives tell as much as one that is twice as long, and nothing leads from one to the
    other."""
    rng = np.random.default_rng(10)
    x, y = ar2(2000, rng), ar2(3000, rng)
    apart = NoiseModel.fit([one(2000), one(3000)], [x, y])
    t = np.concatenate([np.arange(2000) * PERIOD, 100.0 + np.arange(3000) * PERIOD])
    joined = Stretches.of(t, np.zeros(5000, int), np.zeros(5000, int))
    together = NoiseModel.fit([joined], [np.concatenate([x, y])])
    np.testing.assert_allclose(apart.level, together.level, rtol=2e-3)
    np.testing.assert_allclose(apart.weights, together.weights, atol=2e-3)


@pytest.mark.parametrize("far", [30.0, 1000.0])
def test_outliers_do_not_colour(far):
    """Pairs of neighbours far off would make white noise look like a slow one."""
    rng, n, pairs = np.random.default_rng(11), 4000, 8
    noise = rng.standard_normal(n)
    at = rng.choice(n // 2 - 1, pairs, replace=False) * 2
    noise[at] = noise[at + 1] = far
    assert correlations(noise, 1)[0] > 0.35
    noise_model = NoiseModel.fit([one(n)], [noise])
    # each pair may count as one at the edge of what noise makes: 5² of n
    assert np.all(np.abs(noise_model.weights[0, ORDER]) < pairs * 25 / n + 3.3 / np.sqrt(n))
    assert noise_model.level[0, ORDER] < np.sqrt(1 + 2 * pairs * 25 / n) + 0.05


def test_too_few_readings_stay_white():
    rng = np.random.default_rng(12)
    few, enough = (ar2(n, rng) for n in (FEWEST - 1, FEWEST))
    noise_model = NoiseModel.fit([one(FEWEST - 1)], [few])
    assert np.all(noise_model.weights == 0.0)
    of_sensor = (np.sum(few**2) + 1.0) / FEWEST  # the one that is lacking, as loud as stated
    np.testing.assert_allclose(noise_model.level, np.sqrt((np.sum(few**2) + of_sensor) / FEWEST))
    assert np.any(NoiseModel.fit([one(FEWEST)], [enough]).weights != 0.0)


def test_a_reading_alone_is_as_loud_as_the_others_of_its_sensor():
    """One reading of a regime may lie as near 0 as it likes."""
    n, lonely, level = 3000, 1500, 0.6
    rng = np.random.default_rng(21)
    rest, row = level * rng.standard_normal(n), np.zeros(n, int)
    row[lonely], rest[lonely] = 2, 1e-3
    one_sensor = Stretches.of(np.arange(n) * PERIOD, np.zeros(n, int), row)
    noise_model = NoiseModel.fit([one_sensor], [rest])
    white = noise_model.whiten(one_sensor, np.ones(n))
    assert white[lonely] == pytest.approx(1.0 / level, rel=0.05)


def test_readings_too_few_for_a_level_are_as_loud_as_stated():
    few = NoiseModel.fit([one(1)], [np.array([1e-3])])
    assert few.level[0, 0] == pytest.approx(1.0, rel=1.0 / FEWEST)


def test_no_noise_does_no_harm():
    silent = NoiseModel.fit([one(200)], [np.zeros(200)])
    np.testing.assert_array_equal(silent.whiten(one(200), np.ones(200)), np.ones(200))


def test_colour_of_nothing_known_is_white():
    values = np.random.default_rng(13).standard_normal((50, 2))
    np.testing.assert_array_equal(NoiseModel.white([one(50)]).whiten(one(50), values), values)


def test_a_record_without_readings_has_no_noise():
    nothing = Stretches(np.zeros(0, np.int64), np.zeros(0, np.int64))
    assert not len(NoiseModel.fit([nothing], [np.zeros(0)]).groups)


def test_a_product_counts_against_the_squares_of_the_same_two():
    """Two drives with two sensors each, and a hole in one: order 1 by hand, and all readings for
    the power."""
    rng = np.random.default_rng(11)
    time = np.concatenate([np.arange(90), np.arange(100, 140), np.arange(75)]) * PERIOD
    drive = Stretches.of(time, np.repeat([0, 1], [130, 75]), np.zeros(205, np.int64))
    errors = [np.cumsum(rng.standard_normal((205, 3)), axis=0) for _ in range(2)]
    model = NoiseModel.of_columns([drive, drive], errors, np.full(3, 1.0 / 3.0))
    for i, parts in enumerate([[(0, 90), (90, 130)], [(130, 205)]]):
        own = [e[a:b] for e in errors for a, b in parts]
        products = sum(np.sum(e[1:] * e[:-1]) for e in own)
        squares = sum(np.sum(e[1:] ** 2 + e[:-1] ** 2) / 2.0 for e in own)
        power = sum(np.sum(e**2) for e in own) / sum(e.size for e in own)
        assert model.weights[i, 1, 0] == pytest.approx(products / squares)
        assert model.level[i, 0] == pytest.approx(np.sqrt(power))


def test_a_column_taken_away_again_leaves_the_model_as_it_was():
    rng, n = np.random.default_rng(12), 300
    one_column, other = ar2(n, rng)[:, None], np.cumsum(rng.standard_normal((n, 1)), axis=0)
    model = NoiseModel.of_columns([one(n)], [one_column], np.ones(1))
    three = np.column_stack([one_column, other, other])
    same = NoiseModel.of_columns([one(n)], [three], np.array([1.0, 2.0, -2.0]))
    np.testing.assert_allclose(same.weights, model.weights, atol=1e-9)
    np.testing.assert_allclose(same.level, model.level)


SLOW = (np.exp(-1.0 / 60.0),)


@pytest.mark.parametrize(
    ("taps", "stretches", "length"),
    [(SLOW, 6, 150), (SLOW, 15, 40), (SLOW, 60, 15)]
    + [
        (taps, *cut) for taps in ((1.6, -0.9, 0.285), (1.9, -0.905)) for cut in ((6, 150), (15, 40))
    ],
)
def test_slow_noise_in_short_stretches(taps, stretches, length):
    """In 20 records each, whose memory is longer than many a stretch: what is left of
    others of the same noise is white, and as loud as it should be."""
    cut = Stretches(np.zeros(stretches * length, np.int64), np.tile(np.arange(length), stretches))
    inside, slow, squares, bias = cut.place >= len(taps), [], [], []
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal((2, stretches, length + 2000))
        learned, other = lfilter([1.0], [1.0, *-np.array(taps)], noise)[..., 2000:]
        model = NoiseModel.fit([cut], [learned.ravel()])
        white = model.whiten(cut, other.ravel())
        squares.append(np.mean(white[inside] ** 2))
        of_stretches = white.reshape(stretches, length)[:, len(taps) :]
        slow.append(np.mean(of_stretches.sum(axis=1) ** 2) / of_stretches.shape[1])
        bias.append(model.weights[0, ORDER].sum() - sum(taps))
        assert np.abs(np.roots([1.0, *-model.weights[0, ORDER]])).max() < 1.0, "stable"
    assert np.mean(squares) == pytest.approx(1.0, abs=0.05)
    assert np.mean(slow) < 1.3
    assert abs(np.mean(bias)) < 0.003


@pytest.mark.parametrize(("length", "longest"), [(9, 1), (25, 2), (59, 5), (300, ORDER)])
def test_memory_is_a_tenth_of_a_short_stretch_at_most(length, longest):
    """Of a line, which would take all there is: as a ripple that comes again in every stretch."""
    t, rng = np.arange(length), np.random.default_rng(3)
    ripples = np.sin(2.0 * np.pi * 0.4 * t + rng.uniform(0.0, 6.28, (60, 1)))
    values = (ripples + 0.01 * rng.standard_normal(ripples.shape)).ravel()
    cut = Stretches(np.zeros(len(values), np.int64), np.tile(t, 60))
    model = NoiseModel.fit([cut], [values])
    assert np.count_nonzero(model.weights[0, ORDER]) == longest
