"""Torque that nothing asks for is a fault; less than is asked for, and short excess, is none."""

from dataclasses import replace

import numpy as np
import pytest

from clutchest.diagnosis.streams import StreamTests, between
from clutchest.signals import Signal, Signals
from clutchest.vehicle import load_vehicle

NAME = "demand:engine_torque"
BEGIN, END = 200.0, 220.0


def mapped(truck, *names):
    like = truck.signals["engine_torque"]
    more = {name: replace(like, name=name, noise_source="guess") for name in names}
    return replace(truck, signals={**truck.signals, **more})


@pytest.fixture(scope="module")
def truck():
    return load_vehicle("truck")


def drive(seed=1, end=400.0):
    """Demand and torque of a driver who changes his mind; the torque follows in 0.2 s, and for
    half a second of each gear change there is none, or a burst."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, end, 0.02)
    steps = np.repeat(rng.uniform(-800.0, 2500.0, 1 + int(end / 4.0)), 200)[: len(time)]
    demand = np.maximum(steps, 0.0)
    torque = np.empty(len(time))
    torque[0] = demand[0]
    for k in range(1, len(time)):
        torque[k] = torque[k - 1] + 0.1 * (demand[k] - torque[k - 1])
    shift = (time % 20.0) < 0.5
    torque[shift] = np.where((time[shift] // 20.0) % 2 == 0, 0.0, 1200.0)
    return time, demand, torque + rng.normal(0.0, 15.0, len(time))


def detected(vehicle, step=None, **columns):
    time = columns.pop("time")
    signals = Signals(
        {name: Signal.of(name, "Nm", time, value) for name, value in columns.items()},
        end=float(time[-1]),
    )
    streams = StreamTests(vehicle)
    for begin in np.arange(0.0, signals.end, step or 1e9):
        streams.take(between(signals, begin, begin + (step or 1e9)), begin + (step or 1e9))
    (test,) = (t for t in streams.tests if t.name == NAME)
    return test


@pytest.mark.parametrize("step", [None, 0.25])
def test_torque_at_no_demand_is_detected(truck, step):
    time, demand, torque = drive()
    attack = (time > BEGIN) & (time < END)
    demand[attack], torque[attack] = 0.0, 0.85 * 3500.0
    test = detected(
        mapped(truck, "engine_torque_demand"),
        step,
        time=time,
        engine_torque=torque,
        engine_torque_demand=demand,
    )
    (alarm,) = test.alarms
    assert BEGIN - 0.5 <= alarm.begun <= BEGIN + 2.0
    assert alarm.detected < BEGIN + 4.0
    assert alarm.ended is not None and alarm.ended > END
    assert "more than engine torque demand asks for" in alarm.what


@pytest.mark.parametrize("seed", range(5))
def test_gear_changes_and_limits_are_no_fault(truck, seed):
    time, demand, torque = drive(seed)
    limited = (time > BEGIN) & (time < END)
    torque[limited] = np.minimum(torque[limited], 300.0)
    test = detected(
        mapped(truck, "engine_torque_demand"),
        time=time,
        engine_torque=torque,
        engine_torque_demand=demand,
    )
    assert not test.alarms and test.threshold is not None


def test_what_another_unit_asks_for_is_allowed(truck):
    time, demand, torque = drive()
    asked = np.where((time > BEGIN) & (time < END), 3000.0, np.nan)
    torque[~np.isnan(asked)] = 3000.0
    both = mapped(truck, "engine_torque_demand", "engine_torque_request")
    columns = {"time": time, "engine_torque": torque, "engine_torque_demand": demand}
    assert not detected(both, engine_torque_request=asked, **columns).alarms
    assert detected(both, engine_torque_request=np.full(len(time), np.nan), **columns).alarms


def test_a_released_pedal_asks_for_nothing(truck):
    time, demand, torque = drive()
    pedal = 100.0 * demand / 2500.0
    attack = (time > BEGIN) & (time < END)
    vehicle = mapped(truck, "accelerator_pedal")
    assert not detected(vehicle, time=time, engine_torque=torque, accelerator_pedal=pedal).alarms
    pedal[attack], torque[attack] = 0.0, 2500.0
    (alarm,) = detected(vehicle, time=time, engine_torque=torque, accelerator_pedal=pedal).alarms
    assert alarm.detected == pytest.approx(BEGIN + 2.0, abs=2.5)


def test_without_samples_of_both_it_does_not_run(truck):
    time, _, torque = drive(end=20.0)
    test = detected(mapped(truck, "engine_torque_demand"), time=time, engine_torque=torque)
    assert test.threshold is None and "no time with samples" in test.why
