"""Signals between their samples."""

from __future__ import annotations

import numpy as np

from clutchest.signals import LOST, Signal, Signals

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


def test_a_part_of_a_drive():
    late = Signal.of("late", "1", np.array([15.5]), np.array([1.0]))
    drive = Signals({"a": Signal.of("a", "1", TIME, VALUE), "late": late}, end=16.0)
    part = Signals(drive.signals, end=16.0, later=(drive,)).between(2.0, 15.0)
    assert list(part) == ["a"] and part.end == 15.0 and part.drives == (part,)
    np.testing.assert_array_equal(part["a"].time, [2.0, 4.0])
    np.testing.assert_array_equal(part["a"].value, [20.0, -20.0])
    assert drive.between(end=99.0).end == 16.0
    np.testing.assert_array_equal(drive.between(end=99.0)["a"].value, VALUE)
