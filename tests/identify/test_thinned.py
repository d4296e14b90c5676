"""Timelines with means where signals run straight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.estimate.modes import Mode
from clutchest.estimate.timeline import Timeline
from clutchest.identify.thinned import BLOCK, NEAR, thinned
from clutchest.models.dry_clutch import DRY_CLUTCH

SPEED, ZERO = DRY_CLUTCH.sensor("engine_speed"), DRY_CLUTCH.sensor("zero_position")
TORQUE, POSITION = DRY_CLUTCH.input("engine_torque"), DRY_CLUTCH.input("slave_position")
NOISE = {"engine_speed": 0.1, "engine_torque": 15.0, "slave_position": 0.01}
PERIOD, END = 0.01, 20.0  # s
REST, SLIP = 0, 7  # rows of the table of flags
BEGIN = 5.0  # s, of the slip


def timeline() -> Timeline:
    """A slip from ``BEGIN`` on: speed and inputs in turn every ``PERIOD``, all straight."""
    speed = np.arange(0.0, END, PERIOD)
    t = np.sort(np.concatenate([speed, speed + PERIOD / 3]))
    sensor = np.where(np.arange(len(t)) % 2 == 0, SPEED, -1).astype(np.int8)
    u = np.zeros((len(t), len(DRY_CLUTCH.inputs)))
    u[:, TORQUE], u[:, POSITION] = 100.0 + 20.0 * t, 3.0 - 0.1 * t
    return Timeline(
        t=t, sensor=sensor, z=80.0 + 5.0 * t, R=np.full(len(t), NOISE["engine_speed"] ** 2), u=u,
        row=np.where(t < BEGIN, REST, SLIP), W=np.ones((8, 3)), Q=np.zeros((8, 2)),
        longest=np.full(8, 0.5), mode=np.full(len(t), Mode.slipping, np.uint8),
        emit=np.full(len(t), -1), grid=np.zeros(0, bool), noise=np.zeros(2), variance=np.zeros(2),
        warnings=(),
    )  # fmt: skip


@pytest.fixture
def line() -> Timeline:
    return timeline()


def test_straight_lines_stay_the_same_with_fewer_events(line):
    short, means = thinned(line, DRY_CLUTCH, NOISE)
    far = short.t > BEGIN + NEAR + 2 * BLOCK
    assert np.sum(far) == pytest.approx((END - BEGIN - NEAR) / BLOCK, abs=4 * BLOCK / PERIOD)
    assert means[far & (short.t < END - BLOCK)].all()
    np.testing.assert_allclose(short.z[means], 80.0 + 5.0 * short.t[means], rtol=1e-12)
    np.testing.assert_allclose(short.u[:, TORQUE], 100.0 + 20.0 * short.t, rtol=1e-12)
    np.testing.assert_allclose(short.u[:, POSITION], 3.0 - 0.1 * short.t, rtol=1e-12)
    assert np.all(np.diff(short.t) > 0)


def test_nothing_changes_near_a_change_of_regime(line):
    short, means = thinned(line, DRY_CLUTCH, NOISE)
    near = np.abs(line.t - BEGIN) < NEAR
    np.testing.assert_array_equal(line.t[near], short.t[np.abs(short.t - BEGIN) < NEAR])
    assert not means[np.abs(short.t - BEGIN) < NEAR].any()


@pytest.mark.parametrize("signal", ["slave_position", "engine_torque", "engine_speed"])
def test_a_block_in_which_a_signal_bends_stays_whole(line, signal):
    """A step of ten standard deviations in the middle of a block."""
    at = 10.0 + BLOCK / 2 - 1e-6
    after, step = line.t > at, 10.0 * NOISE[signal]
    if signal == "engine_speed":
        bent = replace(line, z=line.z + step * after)
    else:
        u = line.u.copy()
        u[after, DRY_CLUTCH.input(signal)] += step
        bent = replace(line, u=u)
    short, means = thinned(bent, DRY_CLUTCH, NOISE)
    inside = (line.t >= 10.0) & (line.t < 10.0 + BLOCK)
    assert np.isin(line.t[inside], short.t[~means]).all()
    assert means[(short.t > 10.0 + 2 * BLOCK) & (short.t < END - BLOCK)].all()


def test_means_scatter_as_their_variance_says(line):
    rng = np.random.default_rng(1)
    noisy = replace(line, z=line.z + NOISE["engine_speed"] * rng.standard_normal(len(line.t)))
    short, means = thinned(noisy, DRY_CLUTCH, NOISE)
    z = (short.z[means] - 80.0 - 5.0 * short.t[means]) / np.sqrt(short.R[means])
    count = int(means.sum())
    assert abs(z @ z - count) < 3.3 * np.sqrt(2 * count)  # 99.9 %
    # of all information about a constant, what blocks hold that are no means is the rest
    speeds = short.sensor == SPEED
    assert np.sum(1 / short.R[speeds]) == pytest.approx(np.sum(line.sensor == SPEED) * 100.0)


def test_noise_of_an_input_is_averaged_too(line):
    rng, u = np.random.default_rng(2), line.u.copy()
    u[:, TORQUE] += NOISE["engine_torque"] * rng.standard_normal(len(line.t))
    short, means = thinned(replace(line, u=u), DRY_CLUTCH, NOISE)
    left = short.u[means, TORQUE] - 100.0 - 20.0 * short.t[means]
    assert np.std(left) < 0.5 * NOISE["engine_torque"]


def test_readings_of_others_stay(line):
    """A zero position amid a block keeps its value and its time."""
    sensor, z = line.sensor.copy(), line.z.copy()
    sensor[2501], z[2501] = ZERO, 7.25
    short, _ = thinned(replace(line, sensor=sensor, z=z), DRY_CLUTCH, NOISE)
    (at,) = np.flatnonzero(short.sensor == ZERO)
    assert (short.t[at], short.z[at]) == (line.t[2501], 7.25)
