"""Does the model fit at all: the p-value is uniform for noise of any kind, and each distortion of
it is found and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import kstest

import clutchest
from clutchest.discovery.goodness_of_fit import REJECTED, GoodnessOfFit, of_series
from clutchest.discovery.noise_contrasts import periodograms, windows
from clutchest.discovery.residual_series import ResidualSeries, likeliest_variance
from clutchest.discovery.spectral_lines import _white, lines
from clutchest.inference.score_test import family_wise

Floats = NDArray[np.float64]
Distort = Callable[[ResidualSeries, np.random.Generator], Floats]

MODES = ("open", "slipping", "unknown")
INTERVALS, LONG = 40, 200  # of each mode in turn, and residuals in each
RATE = 100.0  # Hz


def series(noise: Floats) -> ResidualSeries:
    """Residuals in intervals of two modes by turns."""
    mode = np.arange(len(noise)) // LONG % 2
    place = np.arange(len(noise)) % LONG
    return ResidualSeries("speed", "rad/s", noise, 0.1, mode, place, 1.0 / RATE)


def white(random: np.random.Generator) -> Floats:
    return random.standard_normal(INTERVALS * LONG)


def fit(residuals: ResidualSeries, seed: int = 0) -> GoodnessOfFit:
    return of_series([residuals], MODES, np.random.default_rng(seed), draws=300)


def coloured(random: np.random.Generator) -> Floats:
    """Noise as some sensor may have it: of any level and colour, with tails, in steps."""
    ar, tails = random.uniform(0.0, 0.8), random.choice([4.0, 8.0, 1e9])
    noise = random.standard_t(tails, INTERVALS * LONG)
    noise = random.uniform(0.1, 3.0) * lfilter([1.0], [1.0, -ar], noise)
    step = random.choice([0.01, 1.0]) * noise.std()
    return np.asarray(np.rint(noise / step) * step)


@pytest.mark.slow
def test_p_value_of_noise_of_any_kind_is_uniform():
    p = [fit(series(coloured(np.random.default_rng([9, seed])))).p_value for seed in range(60)]
    assert kstest(p, "uniform").pvalue > 0.01


def test_of_readings_in_coarse_steps_only_lines_are_sought():
    """A constant value between two steps is rounded to the same side for as long as it stays."""
    noise = white(np.random.default_rng(3)) * 0.3
    drifting = noise + np.linspace(0.0, 3.0, len(noise))
    residuals = series(np.rint(drifting) - drifting)
    assert {test.kind for test in fit(residuals).tests} > {"spectrum"}
    coarse = replace(residuals, rounding=1.0 / 12.0 / np.var(noise))
    assert {test.kind for test in fit(coarse).tests} == {"spectrum"}


def innovations(random: np.random.Generator) -> Floats:
    """Of a filter whose gain is another in the second mode, as there is more noise by way of the
    inputs; that and the sensor's are autocorrelated, and the mean square is 1 in both modes."""
    slips = np.arange(INTERVALS * LONG) // LONG % 2
    sensor, inputs = (lfilter([np.sqrt(0.75)], [1.0, -0.5], white(random)) for _ in range(2))
    reading = np.cumsum(np.where(slips, 2.0, 0.6) * inputs) + sensor
    gain, estimate, out = np.where(slips, 0.85, 0.65), 0.0, np.zeros(len(reading))
    for k in range(len(out)):
        out[k] = reading[k] - estimate
        estimate += gain[k] * out[k]
    for mode in (0, 1):
        out[slips == mode] /= np.std(out[slips == mode])
    return out


def test_what_a_filter_follows_may_be_coloured_otherwise_in_another_regime():
    healthy = series(innovations(np.random.default_rng(3)))
    assert fit(healthy).tests[0].kind in {"colour", "runs", "spectrum"} and fit(healthy).rejects
    p = [
        fit(replace(series(innovations(np.random.default_rng([5, seed]))), followed=True)).p_value
        for seed in range(12)
    ]
    assert min(p) > REJECTED and kstest(p, "uniform").pvalue > 0.01


def late(residuals: ResidualSeries) -> NDArray[np.bool_]:
    return residuals.place >= LONG // 2


def louder(s: ResidualSeries, random: np.random.Generator) -> Floats:
    return s.value * np.where(s.mode == 1, 1.2, 1.0)


def spiky(s: ResidualSeries, random: np.random.Generator) -> Floats:
    hit = (s.mode == 1) & (random.random(len(s.value)) < 0.05)
    return s.value + hit * random.choice([-5.0, 5.0], len(s.value))


def redder(s: ResidualSeries, random: np.random.Generator) -> Floats:
    red = lfilter([np.sqrt(1.0 - 0.4**2)], [1.0, -0.4], white(random))
    return np.where(s.mode == 1, red, s.value)


def lifted(s: ResidualSeries, random: np.random.Generator) -> Floats:
    return s.value + 0.3 * (late(s) & (s.mode == 1))


def lopsided(s: ResidualSeries, random: np.random.Generator) -> Floats:
    skewed = random.exponential(size=len(s.value)) - 1.0  # of mean 0: negative more often
    return np.where(s.mode == 1, skewed, s.value)


def judder(s: ResidualSeries, random: np.random.Generator) -> Floats:
    phase = random.uniform(0.0, 2.0 * np.pi, len(s.value) // LONG).repeat(LONG)
    wave = np.sin(2.0 * np.pi * 9.0 / RATE * np.arange(len(s.value)) + phase)
    return s.value + 0.6 * wave * (s.mode == 1)


@pytest.mark.parametrize(
    ("distort", "kind", "words"),
    [
        (louder, "level", "noise in speed while slipping is 1.19 times as large as otherwise"),
        (spiky, "tails", "noise in speed while slipping has larger outliers than otherwise"),
        (redder, "colour", "noise in speed while slipping is more autocorrelated than otherwise"),
        (lifted, "mean", "residuals of speed late while slipping are higher than early"),
        (lopsided, "sign", "residuals of speed while slipping are less often positive than"),
        (redder, "runs", "residuals of speed while slipping change sign less often than"),
        (judder, "spectrum", "noise in speed while slipping has a line at 9 Hz"),
    ],
)
def test_each_distortion_is_found_where_it_is(distort: Distort, kind: str, words: str):
    random = np.random.default_rng(3)
    healthy = series(white(random))
    found = fit(replace(healthy, value=distort(healthy, random)))
    assert found.rejects and found.sensors["speed"] < REJECTED and found.regimes["slipping"] < 0.01
    tests = {(test.regime, test.kind): test for test in found.tests}
    assert tests["slipping", kind].p_value < REJECTED
    assert tests["slipping", kind].words.startswith(words)


def test_a_line_states_its_frequency_and_amplitude():
    random = np.random.default_rng(3)
    healthy = series(white(random))
    shaken = replace(healthy, value=judder(healthy, random))
    line = lines(*shaken.of_mode(1), 300, random)[0]
    best = int(np.argmin(line.log_p))
    assert line.frequency[best] * RATE == pytest.approx(9.0, abs=0.2)
    assert line.amplitude[best] == pytest.approx(0.6, rel=0.1)


def least_p_of_lines(noise: Floats, seed: int) -> float:
    """Of the residuals of a short record in one piece."""
    tables = lines(noise, np.arange(len(noise)), 300, np.random.default_rng(seed))
    null = np.sort(np.exp(np.min([table.null for table in tables], axis=0)))
    least = min(float(table.log_p.min()) for table in tables)
    return float(family_wise(null, np.exp(least)))


@pytest.mark.parametrize("memory", [[0.95], [1.08, 0.18, -0.27]])
def test_p_value_of_lines_is_uniform_however_slow_the_noise(memory):
    """The last is that of the levels of tanks: nearly all of its power lies in two bins."""
    p = []
    for seed in range(150):
        noise = np.random.default_rng([11, seed]).standard_normal(1324)
        slow = lfilter([1.0], [1.0, *(-tap for tap in memory)], noise)[300:]
        p.append(least_p_of_lines(slow, seed))
    assert kstest(p, "uniform").pvalue > 0.01
    assert np.mean(np.array(p) < 0.05) < 0.12


def test_a_line_in_slow_noise_is_found():
    random = np.random.default_rng(4)
    slow = lfilter([1.0], [1.0, -1.08, -0.18, 0.27], random.standard_normal(1324))[300:]
    wave = np.sin(2.0 * np.pi * 0.2 * np.arange(len(slow)))
    assert least_p_of_lines(slow, 0) > 0.01
    assert least_p_of_lines(slow + 0.5 * wave, 0) < REJECTED


def test_noise_in_a_band_wider_than_a_line_is_none():
    random = np.random.default_rng(5)
    broad = lfilter([1.0], [1.0, -1.5, 0.7], white(random))  # a hump of 5 Hz around 7 Hz
    assert fit(series(broad)).p_value > 0.01


def test_white_spectra_are_as_those_of_white_noise():
    """Gamma variates stand for periodograms: the same variance, and neighbours as alike."""
    random, size, count = np.random.default_rng(2), 128, 20
    begins = np.arange(0, (count - 1) * size // 2 + 1, size // 2)
    rows = begins[:, None] + np.arange(size)
    noise = random.standard_normal((2000, begins[-1] + size))
    power = periodograms(noise[:, rows].reshape(-1, size)).reshape(2000, count, -1)
    measured = np.log((power / power.mean(axis=2, keepdims=True)).mean(axis=1))
    drawn = _white(measured.shape[1], count / (1.0 + 2.0 / 36.0), 2000, random)
    assert drawn.std() == pytest.approx(measured.std(), rel=0.03)
    alike = [
        np.mean([np.corrcoef(x[:, j : j + 2].T)[0, 1] for j in range(60)])
        for x in (measured, drawn)
    ]
    assert alike[1] == pytest.approx(alike[0], abs=0.03)


def test_windows_end_with_their_interval():
    place = np.concatenate([np.arange(70), np.arange(31), np.arange(96)])
    begins, side = windows(place, 32)
    assert begins.tolist() == [6, 38, 101, 133, 165]
    assert side[[0, 1, 2, 4]].tolist() == [0.0, 1.0, 0.0, 1.0] and np.isnan(side[3])


def test_too_few_residuals_give_no_p_value():
    few = ResidualSeries("speed", "rad/s", np.ones(40), 1.0, np.zeros(40, int), np.arange(40), 0.1)
    found = fit(few)
    assert found.p_value is None and not found.rejects and found.tests == ()


def tracked(random: np.random.Generator, gains: Floats, walks: float) -> tuple[Floats, ...]:
    """Innovations of a level that is read with noise of variance 1 and corrected by ``gains`` (n),
    while it walks by the share ``walks`` of what the gains suppose; their variances by white noise
    alone, and as supposed."""
    level = estimate = 0.0
    innovation = np.zeros(len(gains))
    for k, gain in enumerate(gains):
        level += random.standard_normal() * gain * np.sqrt(walks / (1.0 - gain))
        innovation[k] = level + random.standard_normal() - estimate
        estimate += gain * innovation[k]
    return innovation, 2.0 / (2.0 - gains), 1.0 / (1.0 - gains)


@pytest.mark.parametrize("walks", [0.0, 0.5, 1.0])
def test_innovations_of_what_is_tracked_are_as_large_at_every_gain(walks):
    """A filter that supposes a walk is corrected more, and its innovations are the larger for it:
    no change of the sensor's noise."""
    gains = np.where(np.arange(60_000) // 500 % 2, 0.15, 0.6)
    innovation, white, supposed = tracked(np.random.default_rng(17), gains, walks)
    z = innovation / np.sqrt(likeliest_variance(innovation, white, supposed))
    assert np.var(z[gains > 0.5]) / np.var(z[gains < 0.5]) == pytest.approx(1.0, abs=0.05)
    by_noise_alone = innovation / np.sqrt(white)
    assert (np.var(by_noise_alone[gains > 0.5]) > 1.15) == (walks > 0.0)


def test_innovations_that_nothing_corrects_keep_their_variance():
    noise, ones = white(np.random.default_rng(4)), np.ones(INTERVALS * LONG)
    np.testing.assert_array_equal(likeliest_variance(noise, ones, ones), ones)


@pytest.mark.slow
def test_noise_far_above_what_is_stated_is_said():
    """An error may pass for it: that no error is detectable is not that the model explains all."""
    truck = clutchest.load_vehicle("truck")
    loud = replace(truck.signals["slave_position"], noise=5 * truck.signals["slave_position"].noise)
    noisy = replace(truck, signals={**truck.signals, "slave_position": loud})
    log = clutchest.simulate(noisy, "ramps", 3)
    found = clutchest.discover(log, truck)
    assert found.verdict == "none"
    assert found.sentence.startswith("No error is detectable, but an error may pass for noise")
    times = float(found.sentence.partition("zero_position ")[2].partition(" times")[0])
    assert 4.0 < times < 6.0


@pytest.mark.parametrize(("explained", "doubted"), [(0.0, True), (20.0, True), (1000.0, False)])
def test_what_is_left_casts_doubt_on_what_explains_less(explained, doubted):
    residuals = white(np.random.default_rng(3))
    bent = np.where(np.arange(len(residuals)) // LONG % 2 == 0, 0.3, -0.3)
    found = fit(series(residuals + bent))
    assert found.rejects and found.outweighs(explained) == doubted


def test_noise_casts_doubt_on_nothing():
    assert not fit(series(white(np.random.default_rng(3)))).outweighs(0.0)
