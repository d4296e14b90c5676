"""Numbers of experiments are right on average: means of their posterior, however errors depend on
them, and whatever noise enters them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.identify.bench_records import bench_records
from clutchest.identify.equation_errors import fit_errors
from clutchest.identify.posterior_mean import ErrorBlock, mean_less_mode
from clutchest.models.alsd.experiments import I8
from clutchest.models.experiments import NO_OWN, EquationErrors
from clutchest.vehicle import load_vehicle

RIG = load_vehicle("alsd_rig")
KEY = "armature_resistance"
PRIOR = RIG.parameters[KEY]
OWN = (2.0, 0.3)  # of a record's own number


def errors(p, own):
    """Of a product, as of K_t i and all that is a share of something, and of something bent."""
    x, y = (p[KEY] - PRIOR.value) / PRIOR.spread, (own[0] - OWN[0]) / OWN[1]
    product = (0.5 - x - y - 0.08 * x * y) / 0.5
    bent = (0.3 + y + 0.05 * x**2) / 0.4
    return np.array([product, bent])


def by_integration() -> tuple[float, float]:
    """Means of both numbers, in standard deviations of their priors."""
    x = np.linspace(-6.0, 6.0, 601)
    grid = [
        [errors({KEY: PRIOR.value + PRIOR.spread * a}, [OWN[0] + OWN[1] * b]) for b in x] for a in x
    ]
    cost = np.sum(np.square(grid), axis=2) + x[:, None] ** 2 + x**2
    weight = np.exp(-cost / 2)
    return tuple(float((along * weight).sum() / weight.sum()) for along in (x[:, None], x))


def test_what_is_not_linear_is_the_mean_of_its_posterior_not_its_mode():
    part = EquationErrors(errors, np.array([OWN]))
    expected = by_integration()
    off = []
    for mean in (True, False):
        posterior = fit_errors([part], RIG, widened=False, mean=mean)
        (x, _), y = posterior.of(KEY), posterior.own[0][0]
        found = (x - PRIOR.value) / PRIOR.spread, (y - OWN[0]) / OWN[1]
        off.append(np.abs(np.subtract(found, expected)))
    assert np.all(off[1] > 0.02)  # the mode is not the mean, in either number
    assert np.all(off[0] < 0.15 * off[1])


def test_a_first_step_ends_in_no_minimum_far_from_what_was_known():
    """Of a sine, whose slope at the start would lead three periods on."""

    def errors(p, own):
        x = (p[KEY] - PRIOR.value) / PRIOR.spread
        return np.array([(0.932 - np.sin(0.2147 * x + x**2)) / 0.02])

    posterior = fit_errors([EquationErrors(errors, NO_OWN)], RIG, widened=False, mean=False)
    (value, _) = posterior.of(KEY)
    assert (value - PRIOR.value) / PRIOR.spread == pytest.approx(0.99, abs=0.05)


def test_a_mean_far_from_the_mode_is_not_given():
    """There the second order is no approximation."""
    slope = np.array([[1.0]])
    near, far = (ErrorBlock(lambda step, c=c: step + c * step**2, (0,), slope) for c in (0.1, 10.0))
    covariance = np.array([[0.5]])
    # −C t/2 with t = 3 C r' r'' and r'' = 2 c
    assert mean_less_mode([near], covariance) == pytest.approx([-0.5 * 0.5 * 3 * 0.5 * 0.2])
    assert mean_less_mode([far], covariance) == pytest.approx([0.0])


def test_noise_of_the_angle_is_no_smaller_inertia():
    """I8 on one specimen, an encoder three times as noisy, its noise drawn forty times: by a
    variance that knows neither the inertia nor what neighbours share, the inertia came out three
    standard deviations low, and those were twice what they should be."""
    keys = ("structure_inertia", *I8.parameters)
    parameters = {k: p if k in keys else replace(p, spread=0.0) for k, p in RIG.parameters.items()}
    silent = {name: replace(signal, noise=0.0) for name, signal in RIG.signals.items()}
    log = clutchest.simulate(replace(RIG, signals=silent), "I8", 1, nominal=True)
    (record,) = bench_records(log, RIG).records
    noise = {**record.noise, "drive_angle": 3.0 * record.noise["drive_angle"]}
    random, off = np.random.default_rng(4), []
    for _ in range(40):
        noisy = {
            name: replace(s, value=s.value + noise[name] * random.standard_normal(len(s)))
            for name, s in record.signals.items()
            if name in I8.signals
        }
        part = I8.reduce(replace(record, signals=noisy, noise=noise))
        posterior = fit_errors([part], replace(RIG, parameters=parameters), mean=False)
        found = {key: posterior.of(key) for key in keys}
        off.append([(found[key][0] - parameters[key].value) / found[key][1] for key in keys])
    assert np.mean(off, axis=0) == pytest.approx(np.zeros(4), abs=4.0 / np.sqrt(40))
    assert np.std(off, axis=0, ddof=1) == pytest.approx(np.ones(4), abs=3.0 / np.sqrt(80))
