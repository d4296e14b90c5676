"""Timelines with the events that tell nothing new left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import clutchest
from clutchest.discovery import search as searching
from clutchest.estimate.timeline import Timeline
from clutchest.inference.decimation import BENT, NEAR, RESTED, SOON, decimated
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.regimes import Mode

SPEED, ZERO = DRY_CLUTCH.sensor("engine_speed"), DRY_CLUTCH.sensor("zero_position")
REST, SLIP = 0, 7  # rows of the table of flags: nothing acts, everything does
NOISE = 0.01  # mm, of one reading of the zero position
PERIOD = 0.01  # s


def timeline(
    stretches: list[tuple[float, float]], slips: list[tuple[float, float]], end: float = 60.0
) -> Timeline:
    """Engine speed every ``PERIOD``; the zero position half a period later within ``stretches``,
    with readings that are all 0; everything acts within ``slips``."""
    speed = np.arange(0.0, end, PERIOD)
    rest = np.concatenate([np.arange(a, b, PERIOD) + PERIOD / 2 for a, b in stretches])
    t = np.concatenate([speed, rest])
    sensor = np.repeat([SPEED, ZERO], [len(speed), len(rest)]).astype(np.int8)
    order = np.argsort(t, kind="stable")
    t, sensor = t[order], sensor[order]
    slipping = np.zeros(len(t), bool)
    for a, b in slips:
        slipping |= (t >= a) & (t <= b)
    zero = sensor == ZERO
    return Timeline(
        t=t,
        sensor=sensor,
        z=np.zeros(len(t)),
        R=np.where(zero, NOISE**2, 4e-3),
        u=np.column_stack([t, np.sin(t)]),
        row=np.where(slipping, SLIP, REST),
        W=np.array([[r >> 2 & 1, r >> 1 & 1, r & 1] for r in range(8)], float),
        Q=np.zeros((8, 2)),
        longest=np.full(8, 0.5),
        mode=np.where(zero, Mode.retracted, Mode.locked).astype(np.uint8),
        emit=np.full(len(t), -1),
        grid=np.zeros(0, bool),
        noise=np.zeros(2),
        variance=np.zeros(2),
        warnings=(),
    )


@pytest.fixture(scope="module")
def line() -> Timeline:
    """Rests of odd lengths, one broken by a hole, and two slips."""
    return timeline(
        [(0.0, 7.3), (9.0, 13.45), (30.0, 41.0), (55.0, 55.02)], [(20.0, 24.0), (45.0, 50.0)]
    )


def test_nothing_is_dropped_near_slips(line):
    short = decimated(line, DRY_CLUTCH)
    reach = NEAR - PERIOD / 4  # whatever rounding makes of the last one
    near = ((line.t >= 20.0 - reach) & (line.t <= 24.0 + reach)) | (
        (line.t >= 45.0 - reach) & (line.t <= 50.0 + reach)
    )
    assert np.isin(line.t[near], short.t).all()
    far = short.sensor[~np.isin(short.t, line.t[near])]
    assert np.sum(far == SPEED) <= 2 + 4  # the first and the last event, and rounding's
    assert short.t[0] <= PERIOD and short.t[-1] == line.t[-1]


def test_what_stays_is_what_it_was(line):
    short = decimated(line, DRY_CLUTCH)
    assert np.all(np.diff(short.t) > 0)
    of = np.searchsorted(line.t, short.t)
    np.testing.assert_array_equal(line.t[of], short.t)
    for name in ("sensor", "u", "row", "mode"):
        np.testing.assert_array_equal(getattr(line, name)[of], getattr(short, name), name)
    plain = short.sensor != ZERO
    np.testing.assert_array_equal(line.z[of][plain], short.z[plain])
    np.testing.assert_array_equal(line.R[of][plain], short.R[plain])


def test_means_lie_within_their_stretch(line):
    """One mean for every ``RESTED`` s of rest, none across the hole or the slips."""
    short = decimated(line, DRY_CLUTCH)
    time, count = short.t[short.sensor == ZERO], 0
    for begin, end in [(0.0, 7.3), (9.0, 13.45), (30.0, 41.0), (55.0, 55.02)]:
        inside = (time >= begin) & (time < end)
        assert inside.sum() == np.ceil((end - begin) / RESTED)
        np.testing.assert_array_equal(
            np.floor((time[inside] - begin) / RESTED), np.arange(inside.sum())
        )
        count += inside.sum()
    assert len(time) == count


def test_every_reading_counts_once(line):
    """Means and variances hold the sum, and the information, of all readings."""
    rng = np.random.default_rng(1)
    zero = line.sensor == ZERO
    line = replace(line, z=np.where(zero, rng.normal(size=len(line.t)), line.z))
    short = decimated(line, DRY_CLUTCH)
    mean = short.sensor == ZERO
    assert np.sum(1 / short.R[mean]) == pytest.approx(np.sum(1 / line.R[zero]))
    assert np.sum(short.z[mean] / short.R[mean]) == pytest.approx(np.sum(line.z[zero]) / NOISE**2)


def test_means_scatter_as_their_variance_says(line):
    rng = np.random.default_rng(2)
    zero = line.sensor == ZERO
    squares, count = 0.0, 0
    for _ in range(100):
        noisy = np.where(zero, NOISE * rng.standard_normal(len(line.t)), 0.0)
        short = decimated(replace(line, z=noisy), DRY_CLUTCH)
        mean = short.sensor == ZERO
        squares += np.sum(short.z[mean] ** 2 / short.R[mean])
        count += int(mean.sum())
    assert abs(squares - count) < 3.3 * np.sqrt(2 * count)  # 99.9 %


def test_a_mean_stands_where_it_holds(line):
    """Of readings that rise evenly: to half a period, the reading at its own time."""
    short = decimated(replace(line, z=line.t.copy()), DRY_CLUTCH)
    mean = short.sensor == ZERO
    np.testing.assert_allclose(short.z[mean], short.t[mean], atol=0.501 * PERIOD)


@pytest.mark.parametrize("turns", [33.1, 33.5, 33.72])
def test_where_readings_turn_means_are_short(line, turns):
    """A mean across a turn is not what its middle shows; the others stay as long as they were."""
    rng = np.random.default_rng(3)
    zero, slope = line.sensor == ZERO, 20.0 * NOISE  # per s
    true = slope * np.maximum(line.t - turns, 0.0)
    bent = replace(line, z=np.where(zero, true + NOISE * rng.standard_normal(len(line.t)), line.z))
    short = decimated(bent, DRY_CLUTCH)
    mean = short.sensor == ZERO
    off = short.z[mean] - slope * np.maximum(short.t[mean] - turns, 0.0)
    assert np.max(np.abs(off) / np.sqrt(short.R[mean])) < 4.0
    usual = np.sum(decimated(line, DRY_CLUTCH).sensor == ZERO)
    shorter = round(RESTED / BENT) - 1  # more of them for every stretch that is cut up
    assert usual + shorter <= mean.sum() <= usual + 3 * shorter


def test_slow_noise_does_not_turn(line):
    """The sample-to-sample correlation of a bus signal makes means scatter more; they stay long."""
    rng = np.random.default_rng(4)
    zero = line.sensor == ZERO
    slow = lfilter([np.sqrt(1 - 0.9**2)], [1.0, -0.9], rng.standard_normal(len(line.t)))
    noisy = replace(line, z=np.where(zero, NOISE * slow, line.z))
    count = [np.sum(decimated(each, DRY_CLUTCH).sensor == ZERO) for each in (line, noisy)]
    assert count[1] <= count[0] + round(RESTED / BENT)


def test_a_drive_without_slip_keeps_its_means():
    line = timeline([(2.0, 12.0)], [], end=20.0)
    short = decimated(line, DRY_CLUTCH)
    assert np.sum(short.sensor == ZERO) == 10.0 / RESTED
    assert np.sum(short.sensor == SPEED) == 2


def test_a_drive_without_rest_stays_whole():
    line = timeline([(5.0, 5.0)], [(0.0, 20.0)], end=20.0)
    short = decimated(line, DRY_CLUTCH)
    np.testing.assert_array_equal(short.t, line.t)


def test_samples_of_inputs_stay_where_no_reading_is_near(line):
    """Between two readings a period apart none is left; in a hole without readings all are."""
    t = np.sort(np.concatenate([line.t, np.arange(0.003, 60.0, PERIOD)]))
    sensor = np.full(len(t), -1, np.int8)
    sensor[np.searchsorted(t, line.t)] = line.sensor
    hole = (t > 46.0) & (t < 47.0)
    sensor[hole] = -1
    row = np.where((t >= 45.0) & (t <= 50.0), SLIP, REST)
    z, R = np.zeros(len(t)), np.full(len(t), NOISE**2)
    mode, emit = np.full(len(t), Mode.locked, np.uint8), np.full(len(t), -1)
    u = np.column_stack([t, t])
    short = decimated(
        replace(line, t=t, sensor=sensor, z=z, R=R, u=u, row=row, mode=mode, emit=emit), DRY_CLUTCH
    )
    bare = short.t[(short.sensor < 0) & (short.t > 45.0) & (short.t < 50.0)]
    inside = (t > 46.0 + SOON) & (t < 47.0 - SOON)
    assert np.sum(inside) > 150
    np.testing.assert_array_equal(bare, bare[(bare > 46.0) & (bare < 47.0)])
    assert set(t[inside]) <= set(bare)


@pytest.mark.parametrize("scenario", ["city", pytest.param("pulses", marks=pytest.mark.slow)])
def test_samples_of_inputs_tell_nothing_beside_readings(scenario, monkeypatch):
    """Every cause's score and information are what they are with all the samples."""
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, scenario, 3, duration=300.0)
    tests, events = [], []
    for soon in (0.0, SOON):
        monkeypatch.setattr("clutchest.inference.decimation.SOON", soon)
        search = searching.begin(
            Problem.of(signals, truck, tuple(machine_of("dry_clutch").effects.values()))
        )
        tests.append(search.null_scores)
        events.append(len(search.problem.drives[0].line.t))
    whole, short = (np.sqrt(np.diag(score_test.information)) for score_test in tests)
    told = whole > 0.1
    assert events[1] < 0.6 * events[0]
    np.testing.assert_allclose(short[told], whole[told], rtol=0.05)
    np.testing.assert_allclose(tests[1].z[told], tests[0].z[told], atol=0.25)
