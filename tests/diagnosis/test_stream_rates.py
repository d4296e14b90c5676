"""Thresholds of frame and signal tests follow the stated false-alarm rate."""

from math import log

import numpy as np
import pytest

from clutchest.diagnosis.faults import Batch
from clutchest.diagnosis.faults.checksum import Checksum
from clutchest.diagnosis.faults.missing import Missing
from clutchest.diagnosis.faults.noise import BLOCK, Noise
from clutchest.diagnosis.faults.repeats import Repeats
from clutchest.diagnosis.sequential import tail_bound, tail_mean
from clutchest.signals import Signal, Traffic
from clutchest.vehicle.vehicle import BusSignal, SignalMap

H_1000 = 3.6e6  # s
rates = pytest.mark.parametrize("rate", [1.0, 10.0, 1000.0])


def traffic(time, sound=None):
    no = np.zeros(len(time), bool)
    return Traffic(time, no, np.full(len(time), -1, np.int16), 0, ~no if sound is None else sound)


@rates
@pytest.mark.parametrize("beyond", [0.99, 1.01])
def test_a_message_is_missing_beyond_the_gap_that_its_tail_reaches(rate, beyond):
    time = np.cumsum(np.random.default_rng(1).uniform(0.08, 0.12, 5000))
    test = Missing("m", rate)
    test.take(Batch({}, {"m": traffic(time)}, {"m": time}, time[-1]))
    assert test.threshold == tail_bound(test.tail, H_1000 / tail_mean(test.tail) / rate)
    until = time[-1] + beyond * test.threshold
    test.take(Batch({}, {"m": traffic(time[:0])}, {"m": time[:0]}, until))
    assert test.failing == (beyond > 1.0)


@rates
def test_a_share_of_wrong_frames_is_held_against_lordens_bound(rate):
    rng, time = np.random.default_rng(3), np.arange(0.0, 1000.0, 0.1)
    test = Checksum("m", rate)
    frames = traffic(time, rng.random(len(time)) > 0.01)
    test.take(Batch({}, {"m": frames}, {"m": time}, 1000.0))
    assert test.threshold == pytest.approx(log(H_1000 / 0.1 / rate), rel=1e-3)
    assert not test.alarms


@rates
def test_noise_is_held_against_the_tail_of_its_level(rate):
    time = np.arange(0.0, 600.0, 0.01)
    value = 0.5 * np.random.default_rng(2).standard_normal(len(time))
    test = Noise(SignalMap("s", BusSignal("m", "s", "1"), 0.5), rate)
    test.take(Batch({"s": Signal.of("s", "", time, value)}, {}))
    assert test.threshold == tail_bound(test.tail, H_1000 / (BLOCK * test.period) / rate)
    assert not test.alarms


UNEVEN = {  # s: of the samples' times, and of their reception; times the noise that is detected
    "sampled late": (2e-5, 0.0, 5.0),
    "received late": (0.0, 2e-4, 20.0),
    "both": (2e-5, 2e-4, 50.0),
    "both alike": (1e-4, 1e-4, 100.0),
}


@pytest.mark.parametrize("uneven", UNEVEN)
@pytest.mark.parametrize("noisy", [False, True])
def test_an_angle_that_turns_steadily_is_as_noisy_as_its_stamps_allow(uneven, noisy):
    """25 rpm of a servo motor, of which 2 µs are the encoder's noise: live, on a bus."""
    rng, even = np.random.default_rng(4), np.arange(0.0, 60.0, 0.005)
    *stds, times = UNEVEN[uneven]
    sampled, received = (std * rng.standard_normal(len(even)) for std in stds)
    noise = 2e-5 * np.where(noisy & (even > 30.0), times, 1.0)
    value = 9.0 * (even + sampled) + noise * rng.standard_normal(len(even))
    test = Noise(SignalMap("s", BusSignal("m", "s", "1"), 2e-5), 1.0)
    test.take(Batch({"s": Signal.of("s", "", even + sampled + received, value)}, {}))
    assert len(test.alarms) == noisy


@rates
def test_equal_samples_fail_beyond_the_longest_run_that_chance_makes(rate):
    """Coarse samples that repeat by chance, then the same one for good."""
    rng = np.random.default_rng(5)
    same = np.append(rng.random(20_000) < 0.3, np.ones(200, bool))
    time = 0.01 * np.arange(len(same))
    repeats = Repeats(rate)
    (alarm,) = repeats.take(time, same, np.ones(len(same), bool))
    begun, detected, ended = alarm
    assert ended == np.inf
    assert round((detected - begun) / 0.01) == pytest.approx(repeats.bound, abs=1.5)
    runs = H_1000 / (0.01 * tail_mean(repeats.tail))
    assert repeats.bound == pytest.approx(tail_bound(repeats.tail, runs / rate))


def test_how_a_signal_of_guessed_noise_changes_is_observed_first():
    """A computed torque that stands at idle is healthy until it has shown that it fluctuates, or
    for half a minute."""
    rng = np.random.default_rng(3)
    lively = rng.random(3000) < 0.5  # the same as before
    resting = np.ones(200, bool)
    same = np.concatenate([resting, lively, resting])
    time = np.arange(len(same)) * 0.01
    found = {guessed: begun(same, time, guessed) for guessed in (False, True)}
    assert found[False][0] < 2.0 and found[True] == pytest.approx([32.0], abs=0.2)
    always = np.ones(4000, bool)
    (alone,) = begun(always, np.arange(4000) * 0.01, True)
    assert alone == 0.0


def begun(same, time, guessed: bool) -> list[float]:
    """When runs that are too long began."""
    repeats = Repeats(1.0, guessed)
    return [b for b, _, end in repeats.take(time, same, np.ones(len(same), bool)) if end == np.inf]
