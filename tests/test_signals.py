"""Signals between their samples."""

from __future__ import annotations

import numpy as np

from clutchest.signals import LOST, Signal

TIME = np.array([1.0, 2.0, 4.0, 15.0, 15.0, 16.0])
VALUE = np.array([10.0, 20.0, -20.0, 5.0, 7.0, 8.0])


def test_values_between_samples():
    signal = Signal.of("a", "1", TIME, VALUE)
    asked = np.array([0.0, 1.0, 1.25, 2.0, 3.0, 3.5, 4.0, 4.5, 14.9, 15.0, 15.5, 16.0, 99.0])
    # straight, but held over 11 s and behind the end; of two samples at one time the later one
    expected = [10, 10, 12.5, 20, 0, -10, -20, -20, -20, 7, 7.5, 8, 8]
    np.testing.assert_allclose(signal.at(asked), expected, rtol=1e-14)
    order = np.random.default_rng(0).permutation(len(asked))
    np.testing.assert_allclose(signal.at(asked[order]), np.array(expected)[order], rtol=1e-14)


def test_the_gap_that_is_bridged():
    signal = Signal.of("a", "1", np.array([0.0, 4.0]), np.array([0.0, 8.0]))
    assert signal.at(np.array([1.0]), gap=4.0) == 2.0
    assert signal.at(np.array([1.0]), gap=3.9) == 0.0
    for step, middle in ((LOST, 4.0), (LOST * 1.01, 0.0)):
        signal = Signal.of("a", "1", np.array([0.0, step]), np.array([0.0, 8.0]))
        np.testing.assert_allclose(signal.at(np.array([step / 2])), middle)
