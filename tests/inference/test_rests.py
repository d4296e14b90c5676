"""How often surfaces slide, after how long a rest, and how far a quantity is from its mean."""

from __future__ import annotations

import numpy as np

from clutchest.inference.covariates import departure, recent_slip, rests
from clutchest.models.declarations import RECENT


def test_a_rest_is_held_while_surfaces_slide():
    t = np.arange(0.0, 60.0, 0.1)
    slides = ((t >= 10.0) & (t < 15.0)) | ((t >= 45.0) & (t < 50.0))
    slides[(t >= 12.0) & (t < 12.3)] = False  # of the slip's sign, no rest
    rest, engagements = rests(t, slides)
    first, second = (t > 10.05) & (t < 14.95), (t > 45.05) & (t < 49.95)
    assert np.all(np.abs(rest[second] - 30.0) < 0.2)
    assert np.all(rest[first] == rest[second][0])  # it began before the record
    between = (t > 20.0) & (t < 45.0)
    assert np.allclose(rest[between], t[between] - 14.9, atol=0.15)
    assert np.all(engagements[first] == 1.0) and np.all(engagements[second] == 2.0)
    assert np.all(engagements[t < 9.95] == 0.0)


def test_surfaces_that_never_slide_rest():
    t = np.arange(0.0, 5.0, 0.5)
    rest, engagements = rests(t, np.zeros(len(t), bool))
    assert np.array_equal(rest, t) and not engagements.any()


def test_slip_of_late_fades_at_any_distance_from_the_records_begin():
    t = 1e5 + np.sort(np.random.default_rng(7).uniform(0.0, 600.0, 4000))
    slides = np.sin(t / 20.0) > 0.3
    known, state = np.zeros(len(t)), 0.0
    for k in range(1, len(t)):
        kept = np.exp(-(t[k] - t[k - 1]) / RECENT)
        state = known[k] = kept * state + (1.0 - kept) * slides[k]
    assert np.allclose(recent_slip(t, slides), known, rtol=0.0, atol=1e-10)
    assert not recent_slip(t, np.zeros(len(t), bool)).any()
    assert len(recent_slip(t[:0], slides[:0])) == 0


def test_readings_that_are_far_apart_are_no_rests():
    t = np.arange(6) * 4.0
    _, engagements = rests(t, np.ones(6, bool))
    assert np.array_equal(engagements, np.ones(6))


def test_a_departure_is_from_the_mean_of_late_however_readings_come():
    t = np.sort(np.random.default_rng(8).uniform(0.0, 300.0, 3000))
    value = 40.0 + 10.0 * (np.sin(t / 15.0) > 0.0)
    spans = np.diff(t, prepend=t[0])
    for k in (1, 7, 500, 2999):
        share = -np.expm1(-spans[: k + 1] / RECENT) * np.exp((t[: k + 1] - t[k]) / RECENT)
        mean = np.average(value[: k + 1], weights=share)
        assert np.isclose(departure(t, value)[k], value[k] - mean, rtol=0.0, atol=1e-9)
    assert not departure(t, np.full(len(t), 3.0)).round(9).any()
    assert len(departure(t[:0], value[:0])) == 0
