"""Gears and thresholds of lock-up, learned from speeds alone."""

import numpy as np
import pytest

from clutchest.reading.gear_ratios import Learned, learn_gears, same_speed

RATIOS = (13.2, 7.9, 5.1, 3.8)
T = np.arange(0.0, 60.0, 0.02)


def drive(shaken: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Standing to 5 s, then 12 s in each gear with an open clutch for 1.5 s before; neutral from
    55 s on: wheel and engine, rad/s."""
    wheel = np.interp(T, [0, 5, 53, 60], [0, 0, 70, 30]) * (1 + 0.02 * np.sin(T))
    number = np.clip(((T - 5) // 12).astype(int), 0, 3)
    engine = wheel * np.array(RATIOS)[number]
    since = np.where(T < 5, 0.0, (T - 5) % 12)
    engine = np.where(since < 1.5, engine + 90.0 * (1.5 - since), engine)
    engine = np.where((T < 5) | (T > 53), np.interp(T, [0, 53, 54, 60], [75, 75, 75, 75]), engine)
    return wheel * (1 + shaken * np.sin(2 * np.pi * 4 * T)), engine


def test_every_gear_is_found_with_its_uncertainty() -> None:
    wheel, engine = drive()
    noise = np.random.default_rng(1)
    found = learn_gears(T, wheel + 0.02 * noise.normal(size=len(T)), engine)
    assert len(found.gears) == 4
    for gear, true in zip(found.gears, RATIOS, strict=True):
        assert gear.ratio == pytest.approx(true, rel=0.01)
        assert 0.0 < gear.std < 0.02 * true and 9.0 < gear.seconds < 11.5
    assert (found.gear[(T > 8) & (T < 16)] == 0).mean() > 0.97
    assert (found.gear[(T < 5) | (T > 54)] == -1).all(), "standing, and rolling in neutral"


def test_a_driveline_that_shuffles_is_judged_by_its_mean() -> None:
    calm, shaken = (learn_gears(T, *drive(by)) for by in (0.0, 0.05))
    assert calm.lock_average == 0.0 and calm.lock_slip == 2.0
    assert [g.ratio for g in shaken.gears] == pytest.approx(RATIOS, rel=0.02)
    assert shaken.lock_average == 0.3 and 2.0 <= shaken.lock_slip < 15.0


def test_single_readings_of_zero_are_in_no_gear() -> None:
    time = np.arange(0.0, 60.0, 0.005)
    wheel, engine = (np.interp(time, T, speed) for speed in drive())
    wheel[2400::1600] = 0.0  # a sensor that drops out for one sample in eight seconds
    found = learn_gears(time, wheel, engine)
    assert [g.ratio for g in found.gears] == pytest.approx(RATIOS, rel=0.02)
    assert np.isfinite(found.scatter) and (found.gear[wheel == 0.0] == -1).all()


def test_rolling_in_neutral_is_no_gear() -> None:
    wheel = np.interp(T, [0, 60], [60.0, 5.0])
    assert learn_gears(T, wheel, np.full(len(T), 75.0)).gears == ()
    steady = learn_gears(T, np.full(len(T), 40.0), np.full(len(T), 75.0))
    assert steady.gears == (), "an engine that idles beside wheels of one speed"


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_too_few_samples_teach_nothing(samples: int) -> None:
    few = T[:samples]
    nothing: Learned = learn_gears(few, few + 50.0, few + 500.0)
    assert nothing.gears == () and len(nothing.gear) == samples


def test_a_shaft_behind_the_clutch_has_one_ratio() -> None:
    engine = np.interp(T, [0, 5, 60], [80, 150, 200])
    shaft = np.minimum(engine, np.interp(T, [0, 5, 60], [0, 150, 200]))
    noisy = shaft + np.random.default_rng(2).normal(size=len(T))
    found = same_speed(T, noisy, engine)
    assert [g.ratio for g in found.gears] == [1.0] and found.seconds > 50.0
    assert 2.0 < found.lock_slip + found.lock_average and found.lock_average == 0.3
