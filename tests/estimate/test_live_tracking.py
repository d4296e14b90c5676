"""Figures of actuations while a drive lasts equal those of a replay of the whole drive."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from clutchest.estimate.drive import Piece
from clutchest.estimate.live_tracking import ASKED, LiveTracking
from clutchest.estimate.replay import replay
from clutchest.estimate.run import Run, Track, TrackingFigures
from clutchest.estimate.tracking import responses
from clutchest.record.tracking import figures_in_words
from clutchest.signals import Signal, Signals
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

RIG = load_vehicle("alsd_rig")
NOISE = {name: mapped.noise for name, mapped in RIG.signals.items()}
SENSOR, DRIVE, REQUEST = "clutch_torque", "armature_current", "torque_request"


@pytest.fixture(scope="module")
def run() -> Run:
    return replay(simulate(RIG, "rig-steps", 3, duration=8.0), RIG, rate=50.0)


def made_up(seed: int, *, stays: bool = False) -> Signals:
    """Actuations of random heights and lengths, some too short to count, some interrupted; where
    the output ``stays``, it never leaves after the first one."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 60.0, 0.005)
    current, asked = np.zeros(len(t)), np.zeros(len(t))
    begin = 2.0
    while begin < 50.0:
        lasts = rng.choice([0.05, 0.5, 3.0, 8.0]) * rng.uniform(0.9, 1.1)
        on = (t >= begin) & (t < begin + lasts)
        current[on] = rng.uniform(2.0, 12.0)
        asked[(t >= begin - 0.06) & (t < begin + lasts)] = 800.0
        if rng.uniform() < 0.3:
            current[(t >= begin + 0.2) & (t < begin + 0.22)] = 0.0
        begin += lasts + rng.choice([0.03, 0.4, 2.0, 14.0])
    lag = np.exp(-np.arange(0.0, 0.6, 0.005) / 0.1)
    torque = 100.0 * np.convolve(current, lag / lag.sum())[: len(t)]
    torque += 50.0 * (stays and np.cumsum(current) > 0.0)
    torque += 5.0 * rng.standard_normal(len(t))
    given = {DRIVE: current, SENSOR: torque, REQUEST: asked}
    return Signals({n: Signal.of(n, "", t, value) for n, value in given.items()}, end=60.0)


def live(signals: Signals, track: Track, seed: int) -> list[TrackingFigures]:
    """All that comes of pieces of random length."""
    tracking, found = LiveTracking(RIG), []
    cuts = np.sort(np.random.default_rng(seed).uniform(0.0, signals.end, 150))
    for k, (a, b) in enumerate(pairwise([-np.inf, *cuts, np.inf])):
        new = {n: s.take((s.time >= a) & (s.time < b)) for n, s in signals.signals.items()}
        rows = (track.time >= a) & (track.time < b)
        torque = track.clutch_torque
        part = replace(
            track,
            time=track.time[rows],
            clutch_torque=replace(
                torque, value=torque.value[rows], std=torque.std[rows], valid=torque.valid[rows]
            ),
        )
        found += tracking.take(Piece(part, None, None, new, k == 0, 0))
    return [*found, *tracking.finish()]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("lacks", [(), (REQUEST,)])
def test_as_a_replay(run: Run, seed: int, lacks: tuple[str, ...]) -> None:
    signals = made_up(seed, stays=seed == 5)
    kept = {n: s for n, s in signals.signals.items() if n not in lacks}
    signals = replace(signals, signals=kept)
    whole = responses(signals, run.tracks[0], RIG.machine.tracking, NOISE)
    assert len(whole) >= 3
    assert live(signals, run.tracks[0], seed) == list(whole)


def test_the_estimated_output(run: Run) -> None:
    signals = replace(run.signals, signals={DRIVE: run.signals[DRIVE]})
    whole = responses(signals, run.tracks[0], RIG.machine.tracking, NOISE)
    assert whole and live(signals, run.tracks[0], 1) == list(whole)


def test_each_as_soon_as_it_is_over(run: Run) -> None:
    """Within half a second of the output's end, while the next actuation is yet to come."""
    signals = run.signals
    tracking, came = LiveTracking(RIG), []
    for k, a in enumerate(np.arange(0.0, signals.end, 0.1)):
        new = {n: s.take((s.time >= a) & (s.time < a + 0.1)) for n, s in signals.signals.items()}
        found = tracking.take(Piece(run.tracks[0], None, None, new, k == 0, 0))
        came += [(a + 0.1, figures) for figures in found]
    assert len(came) >= 3
    assert all(at - f.release_s - f.fall_s < 0.5 for at, f in came)
    assert "delay" in figures_in_words(came[0][1].figures("Nm"))


def test_little_is_held_while_nothing_is_actuated(run: Run) -> None:
    t = np.arange(0.0, 600.0, 0.005)
    still = Signals(
        {n: Signal.of(n, "", t, np.full(len(t), 0.1)) for n in (DRIVE, SENSOR)}
        | {REQUEST: Signal.of(REQUEST, "", t, np.full(len(t), 900.0))},
        end=600.0,
    )
    tracking = LiveTracking(RIG)
    for k, a in enumerate(np.arange(0.0, 600.0, 5.0)):
        new = {n: s.take((s.time >= a) & (s.time < a + 5.0)) for n, s in still.signals.items()}
        assert not tracking.take(Piece(run.tracks[0], None, None, new, k == 0, 0))
    held = sum(len(part) for parts in tracking._parts.values() for part in parts)
    assert held * 0.005 < 3 * (ASKED + 10.0)
