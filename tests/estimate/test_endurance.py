"""Covariances that never break: over very many steps, and after gaps, jumps and outliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.estimate import initial_state, timeline, whole_log
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import CONSIDERING, Belief, Compiled, Filtered, FilterOptions
from clutchest.models import machine_of
from clutchest.signals import Floats, Signal, Signals

EVENTS = 10_000_000
TRUCK = clutchest.load_vehicle("truck")


def whole(compiled: Compiled, filtered: Filtered) -> None:
    """Finite, symmetric to the bit, positive definite, in every output row."""
    assert np.all(np.isfinite(filtered.x))
    assert np.all(np.isfinite(filtered.total))
    assert np.array_equal(filtered.P, filtered.P.transpose(0, 2, 1))
    std = np.sqrt(np.einsum("kii->ki", filtered.P))
    assert std.min() > 0.0
    smallest = np.linalg.eigvalsh(filtered.P / std[:, :, None] / std[:, None, :])[:, 0]
    assert smallest.min() > 0.0


def made(signals: Signals) -> tuple[Compiled, Timeline, Belief]:
    compiled = whole_log.compile_model(TRUCK, machine_of(TRUCK.model).equations(set(signals)))
    line = timeline.build(signals, TRUCK, compiled.model, 10.0, {})
    return compiled, line, initial_state.fresh(TRUCK, compiled, line)


@pytest.mark.slow
@pytest.mark.parametrize("consider", [False, True])
def test_ten_million_events(consider: bool) -> None:
    """One drive again and again, each time from where the last one left."""
    compiled, line, belief = made(clutchest.simulate(TRUCK, "city", 5))
    past = 0
    while past < EVENTS:
        filtered = whole_log.run(compiled, line, belief, FilterOptions(consider=consider))
        whole(compiled, filtered)
        belief, past = filtered.final, past + len(line.t)
    # what nothing pins down has spread, what is measured has not
    std = np.sqrt(np.diag(belief.P))
    assert std[compiled.model.state("zero_position")] < 0.2
    assert std[compiled.model.state("engine_speed")] < 1.0


def spoilt(signal: Signal, random: np.random.Generator, how: str) -> Signal:
    """A signal with holes, a jump of its clock, of its value, or with samples far off."""
    time, value = signal.time.copy(), signal.value.copy()
    if how == "gaps":
        for at in random.uniform(0.0, time[-1], 4):
            length = 10.0 ** random.uniform(-1.0, 1.5)
            left = (time < at) | (time > at + length)
            time, value = time[left], value[left]
    elif how == "clock jump":
        time[time > random.uniform(20.0, 60.0)] += 3600.0
    elif how == "level jump":
        value[time > random.uniform(20.0, 60.0)] += 100.0 * np.std(value) + 1.0
    elif how == "outliers":
        hit = random.random(len(value)) < 0.05
        value[hit] += random.standard_cauchy(int(hit.sum())) * 1e4
    elif how == "stuck":
        value[time > random.uniform(20.0, 60.0)] = value[len(value) // 2]
    elif how == "twice":
        time, value = np.repeat(time, 2), np.repeat(value, 2)
    return Signal.of(signal.name, signal.unit, time, value)


@pytest.fixture(scope="module")
def drive() -> Signals:
    return clutchest.simulate(TRUCK, "launches", 9, duration=90.0)


def times(signals: dict[str, Signal]) -> Floats:
    return np.array([s.time[-1] for s in signals.values() if len(s)])


@pytest.mark.parametrize("how", ["gaps", "clock jump", "level jump", "outliers", "stuck", "twice"])
def test_whatever_befalls_the_signals(how: str, drive: Signals) -> None:
    """Each signal alone, then all of them: estimates stay finite, covariances stay covariances."""
    random = np.random.default_rng(4)
    names = ("engine_speed", "engine_torque", "slave_position", "input_shaft_speed")
    for hit in [*([name] for name in names), list(drive)]:
        signals = {n: spoilt(s, random, how) if n in hit else s for n, s in drive.signals.items()}
        spoiled = replace(drive, signals=signals, end=float(times(signals).max()))
        compiled, line, belief = made(spoiled)
        whole(compiled, whole_log.run(compiled, line, belief, CONSIDERING))
