"""Noise, outliers, periods and delays are those that were asked for."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.generator import Channel

from .conftest import TRUCK, simulated


def _sampled(*channels: Channel, **options):
    return simulated(
        TRUCK, {}, "launches", 4, channels, nominal=True, **{"duration": 300.0, **options}
    ).signals


def test_noise_has_its_size_and_colour():
    clean = _sampled(Channel("engine_torque", "EEC1", 0.01))["engine_torque"]
    noisy = _sampled(Channel("engine_torque", "EEC1", 0.01, noise=15.0, noise_ar=0.9))
    np.testing.assert_array_equal(clean[0], noisy["engine_torque"][0])
    error = noisy["engine_torque"][1] - clean[1]
    assert error.std() == pytest.approx(15.0, rel=0.05)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(0.9, abs=0.02)
    white = _sampled(Channel("engine_torque", "EEC1", 0.01, noise=15.0))["engine_torque"][1]
    assert abs(np.corrcoef((white - clean[1])[1:], (white - clean[1])[:-1])[0, 1]) < 0.03


def test_outliers_have_their_share_and_size():
    channel = Channel("slave_position", "CLUTCH", 0.01, noise=0.01)
    clean, dirty = (_sampled(channel, outliers=share)["slave_position"][1] for share in (0, 0.01))
    off = np.abs(dirty - clean) / 0.01
    hit = off > 0
    assert hit.mean() == pytest.approx(0.01, rel=0.2)
    assert off[hit].min() >= 8 - 1e-6 and off[hit].max() <= 20 + 1e-6
    assert 0.3 < np.mean(dirty[hit] > clean[hit]) < 0.7


def test_noise_of_one_signal_leaves_the_rest_alone():
    speed = Channel("engine_speed", "EEC1", 0.01, noise=0.06)
    alone = _sampled(speed)["engine_speed"]
    beside = _sampled(Channel("engine_torque", "EEC1", 0.01, noise=9.0), speed)["engine_speed"]
    np.testing.assert_array_equal(alone[1], beside[1])


def test_messages_beat_at_their_period_with_stamps_that_are_true():
    signals = _sampled(
        Channel("engine_speed", "EEC1", 0.02),
        Channel("engine_torque", "EEC1", 0.02),
        Channel("slave_position", "CLUTCH", 0.01),
    )
    time = signals["engine_speed"][0]
    assert signals["engine_torque"][0] is time
    gaps = np.diff(time)
    assert np.all(gaps > 0) and gaps.mean() == pytest.approx(0.02, rel=1e-3)
    assert 1e-4 < gaps.std() < 1e-3
    other = signals["slave_position"][0]
    assert (time[0] - other[0]) % 0.01 > 1e-5  # no common phase


@pytest.mark.parametrize(
    ("delayed", "effects"),
    [
        (0.037, {}),
        (0.0, {"torque_delay": {"delay": 0.037}}),
        (0.02, {"torque_delay": {"delay": 0.017}}),
    ],
)
def test_delays_are_finer_than_a_sample(delayed, effects):
    channel = Channel("engine_torque", "EEC1", 0.01)
    time, prompt = _sampled(channel)["engine_torque"]
    late = _sampled(Channel("engine_torque", "EEC1", 0.01, delay=delayed), effects=effects)
    late = late["engine_torque"][1]
    shifted = np.interp(time - 0.037, time, prompt)
    rough = np.interp(time - 0.030, time, prompt)
    assert np.std(late - shifted) < 0.1 * np.std(late - rough)


@pytest.mark.parametrize(
    ("channel", "says"),
    [
        (Channel("engine_sped", "EEC1", 0.01), "did you mean 'engine_speed'"),
        (Channel("engine_speed", "EEC1", 0.0), "period 0 s"),
        (Channel("engine_speed", "EEC1", 0.01, noise_ar=1.0), "noise_ar"),
    ],
)
def test_impossible_channels_are_refused(channel, says):
    with pytest.raises(ClutchestError, match=says):
        _sampled(channel, duration=1.0)


def test_one_message_has_one_period():
    with pytest.raises(ClutchestError, match="EEC1"):
        _sampled(
            Channel("engine_speed", "EEC1", 0.01),
            Channel("engine_torque", "EEC1", 0.02),
            duration=1.0,
        )
