"""Modes from the signals alone."""

import numpy as np
import pytest
from scipy.signal import lfilter

from clutchest.models.alsd.regimes import pressing
from clutchest.models.dry_clutch.regimes import classify
from clutchest.models.regimes import Mode, Regimes
from clutchest.models.thresholds import Thresholds

KISS = 6.5
T = np.arange(0.0, 10.0, 0.01)
NONE_BLIND = np.zeros(len(T), bool)


def modes(slip, position, motor=None, blind=NONE_BLIND, shaft=None, **thresholds) -> Regimes:
    shaft = np.full(len(T), 100.0) if shaft is None else shaft
    beyond = None if position is None else position - KISS
    return classify(T, slip, shaft, beyond, motor, blind, Thresholds(**thresholds))


def launch():
    """Open to 2 s, slipping to 5 s, locked after; the actuator goes home at 7 s."""
    slip = np.where(T < 2, 100.0, np.clip(100.0 * (5 - T) / 3, 0.0, None))
    position = np.where(T < 2, 12.0, np.where(T < 7, 4.5, 0.0))
    motor = np.where(T < 7, 30.0, 0.0)
    return slip, position, motor


def test_a_launch_runs_through_all_modes():
    regimes = modes(*launch())
    assert regimes.mode[50] == Mode.open
    assert regimes.mode[300] == Mode.slipping
    assert regimes.mode[600] == Mode.locked
    assert regimes.mode[900] == Mode.retracted
    assert set(np.diff(regimes.mode.astype(int))) <= {0, 1}  # each entered once, in order


def test_retracted_waits_until_the_actuator_has_settled():
    regimes = modes(*launch(), settle=0.5)
    first = T[np.argmax(regimes.mode == Mode.retracted)]
    assert first == pytest.approx(7.5, abs=0.011)


def test_no_torque_information_around_lock_up():
    regimes = modes(*launch(), guard=0.2, lock_slip=2.0)
    locks = T[np.argmax(regimes.mode == Mode.locked)]
    assert locks == pytest.approx(5 - 2.0 * 3 / 100, abs=0.02)
    assert not regimes.free_running[(T > locks - 0.19) & (T < locks + 1)].any()
    assert regimes.free_running[(T > 2.1) & (T < locks - 0.21)].all()
    assert regimes.sliding[T < locks - 0.02].all()


def test_slip_that_only_passes_zero_is_not_locked():
    slip = 100.0 * np.cos(T)
    regimes = modes(slip, np.full(len(T), 4.5))
    assert (regimes.mode == Mode.slipping).all()
    assert not regimes.free_running[np.abs(slip) < 2.0].any()  # the torque's sign is open there


def test_an_open_clutch_whose_speeds_meet_still_tells_the_engine_torque():
    regimes = modes(100.0 * np.cos(T), np.full(len(T), 12.0))
    assert regimes.free_running.all()
    assert not regimes.engaged.any()


@pytest.mark.parametrize("turned", [False, True])
def test_what_noise_makes_of_no_slip_is_no_sliding(turned):
    """A clutch closed to 5 s that then opens, and one that closes: the noise of AR(1) 0.95 is of
    one sign for tenths of a second."""
    slides, slip = T > 5.0, np.clip(20.0 * (T - 5.0), 0.0, None)
    if turned:
        slides, slip = slides[::-1], slip[::-1]
    for seed in range(20):
        noise = lfilter([0.02], [1.0, -0.95], np.random.default_rng(seed).standard_normal(len(T)))
        regimes = modes(slip + noise, np.full(len(T), 4.5))
        assert np.sum(regimes.sliding[~slides]) <= 1  # the noise is 0.06 rad/s, and BARELY 0.2
        late = slides & (regimes.mode == Mode.locked) & (slip > 0.5)
        assert late.any() and regimes.sliding[late].all(), "slow, but more than noise"


def test_a_shaken_driveline_locks_on_its_mean_slip():
    shaken = np.where(T < 3, 50.0, 8.0 * np.sin(2 * np.pi * 6 * T))
    assert (modes(shaken, None).mode != Mode.locked).all()
    regimes = modes(shaken, None, lock_slip=3.0, lock_average=0.3)
    assert (regimes.mode[(T > 3.3) & (T < 9.8)] == Mode.locked).all()
    assert (regimes.mode[T < 2.8] == Mode.slipping).all()


def test_blind_times_carry_no_torque_information():
    blind = (T > 3) & (T < 4)
    regimes = modes(*launch(), blind=blind)
    assert not regimes.free_running[blind].any()


def standing():
    """Standing to 4 s, a launch to 6 s, rolling with the engine slower than the shaft from 8 s."""
    shaft = np.interp(T, [0, 4, 6, 10], [0, 0, 150, 180])
    engine = np.where(T < 6, 150.0, np.where(T < 8, shaft, 100.0))
    return engine - shaft, shaft


def test_standing_and_rolling_disengaged_are_no_slipping():
    slip, shaft = standing()
    always = modes(slip, None, shaft=shaft)
    assert (always.mode[T < 5.9] == Mode.slipping).all(), "unless the vehicle file says more"
    regimes = modes(slip, None, shaft=shaft, longest_engagement=2.5)
    assert (regimes.mode[T < 1.4] == Mode.open).all(), "in neutral, or the pedal pressed"
    assert (regimes.mode[(T > 1.6) & (T < 5.9)] == Mode.slipping).all(), "2.5 s before it turns"
    assert (regimes.mode[(T > 6.1) & (T < 7.9)] == Mode.locked).all()
    assert (regimes.mode[T > 8.1] == Mode.open).all()
    assert not regimes.engaged[(T < 1.4) | (T > 8.1)].any(), "and no heat"


def test_coasting_in_neutral_is_no_slipping_and_creeping_is():
    """The engine idles faster than the shaft: driven or not, its acceleration tells."""
    coasting = np.interp(T, [0, 10], [70, 20])
    regimes = modes(80.0 - coasting, None, shaft=coasting, longest_engagement=1.0)
    assert (regimes.mode[(T > 0.5) & (T < 9.5)] == Mode.open).all()
    assert not regimes.engaged[(T > 0.5) & (T < 9.5)].any(), "and no heat"
    creeping = np.interp(T, [0, 10], [20, 25]) + 0.3 * np.sin(40 * T)
    regimes = modes(80.0 - creeping, None, shaft=creeping, longest_engagement=1.0)
    assert (regimes.mode == Mode.slipping).all()
    braked = np.where(T < 6, coasting, 80.0)  # the clutch closes at 6 s
    regimes = modes(80.0 - braked, None, shaft=braked, longest_engagement=1.0)
    assert (regimes.mode[(T > 5.1) & (T < 5.9)] == Mode.slipping).all(), "up to 1 s before"


@pytest.mark.parametrize("engine", [None, 300.0], ids=["launch", "neutral"])
def test_a_regime_depends_on_nothing_later_than_its_thresholds_say(engine):
    slip, shaft = standing()
    shaft = shaft if engine is None else np.interp(T, [0, 4, 8, 10], [200, 100, 150, 90])
    slip = slip if engine is None else engine - shaft
    for end in (300, 350, 420, 480):
        thresholds = Thresholds(longest_engagement=1.0)
        sure = int((T[end] - thresholds.ahead) / 0.01)
        short = classify(T[:end], slip[:end], shaft[:end], None, None, NONE_BLIND[:end], thresholds)
        whole = classify(T, slip, shaft, None, None, NONE_BLIND, thresholds)
        assert (short.mode[:sure] == whole.mode[:sure]).all()


def test_without_slip_nothing_is_known():
    regimes = modes(None, None)
    assert (regimes.mode == Mode.unknown).all()
    assert not (regimes.free_running | regimes.sliding | regimes.engaged).any()


def test_through_a_long_hole_nothing_is_known():
    lost = (T > 2.5) & (T < 4.0)
    slip, position, motor = launch()
    regimes = classify(
        T, slip, np.full(len(T), 100.0), position - KISS, motor, lost, Thresholds(), lost
    )
    assert np.all(regimes.mode[lost] == Mode.unknown)
    assert not (regimes.sliding | regimes.engaged | regimes.free_running)[lost].any()
    assert regimes.mode[450] == Mode.slipping


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_structure_that_winds_up_is_told_from_surfaces_that_slide(sign: float) -> None:
    """1000 Nm are wound up at a creep over half a second, slide, fall, and hold at no slip."""
    time, yielding = np.arange(0.0, 4.0, 0.005), 1 / 4e4
    slip = sign * np.where(time < 3.0, 0.05, 0.0)
    torque = sign * np.interp(time, (0.5, 1.0, 2.0, 2.5), (0.0, 1000.0, 1000.0, 600.0))
    lost = np.zeros(len(time), bool)
    mode = pressing(time, torque, slip, yielding, lost, 0.1).mode

    def all_of(begin: float, end: float, wanted: Mode) -> bool:
        return bool(np.all(mode[(time > begin) & (time < end)] == wanted))

    assert all_of(0.0, 0.6, Mode.open), "no torque, or hardly any yet"
    assert all_of(0.62, 1.04, Mode.locked), "torque rises as the slip winds the structure up"
    assert all_of(1.06, 2.95, Mode.slipping), "steady and falling torque: the surfaces slide"
    assert all_of(3.1, 4.0, Mode.locked), "without slip nothing says that they do"


def test_without_slip_or_torque_nothing_winds_up() -> None:
    time = np.arange(0.0, 1.0, 0.01)
    torque, lost = np.full(100, 500.0), np.zeros(100, bool)
    without_slip = pressing(time, torque, None, 1 / 4e4, lost, 0.1).mode
    assert np.all(without_slip == Mode.slipping)
    assert np.all(pressing(time, None, torque, 1 / 4e4, lost, 0.1).mode == Mode.open)


def test_an_actuator_about_to_leave_its_home_is_not_retracted():
    slip, position, motor = (column[::-1] for column in launch())
    regimes = modes(slip, position, motor, guard=0.2)
    leaves = T[np.argmax(motor > 0.3)]
    last = T[np.flatnonzero(regimes.mode == Mode.retracted)[-1]]
    assert last == pytest.approx(leaves - 0.2, abs=0.011)
