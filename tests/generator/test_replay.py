"""A drive's signals replayed open loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.generator import EFFECTS, DriveRequest
from clutchest.generator.replay import record, replay, slope
from clutchest.vehicle import load_vehicle

SIZES = {  # of effects, large enough that a replay without them is far off
    "wear": {"amount": 0.1, "rate": 0.5},
    "position_offset": {"offset": 0.2},
    "friction_slip": {"change": -0.2, "speed": 15.0},
    "friction_fade": {"slope": 0.2, "onset": 90.0},
    "torque_bias": {"bias": 40.0},
    "torque_delay": {"delay": 0.1},
    "position_delay": {"delay": 0.1},
    "kiss_point": {"shift": 0.1},
    "torque_curve": {"change": 0.05},
    "heat_split": {"fraction": 0.3},
    "transmission_heat_path": {"conductance": 30.0},
    "housing_airflow": {"slope": 5.0},
    "position_hysteresis": {"play": 0.1},
    "centrifugal": {"slope": 0.05},
    "viscous_drag": {"coefficient": 30.0},
    "friction_speed": {"slope": -0.1},
    "friction_temperature": {"slope": -0.2},
}


def request(**more) -> DriveRequest:
    truck = load_vehicle("truck")
    parameters = {key: p.value for key, p in truck.parameters.items()}
    spreads = {key: p.spread for key, p in truck.parameters.items()}
    return DriveRequest(parameters, spreads, "launches", 7, (), duration=150.0, **more)


def misfit(recorded, replayed) -> tuple[float, float]:
    """By how many rad/s and mm readings and replay are apart at most: speeds from the beginning of
    each time at which the clutch is not locked, zero positions with the actuator retracted."""
    free = np.flatnonzero(np.diff(np.r_[0, ~recorded.locked, 0])).reshape(-1, 2)
    off = recorded.signals["engine_speed"] - replayed.speed
    speed = max(np.ptp(off[a + 1 : b - 1]) for a, b in free if b - a > 10)
    rest = recorded.signals["slave_position"] - replayed.zero_position
    return float(speed), float(np.abs(rest[recorded.retracted]).max())


@pytest.mark.parametrize("effect", sorted(EFFECTS))
def test_a_replay_with_what_is_hidden_gives_the_drive_back(effect):
    """Whatever driver and control unit made of it; without the effect it does not."""
    hidden = {effect: SIZES.get(effect, {"change": -0.2})}
    recorded, own = record(request(effects=hidden))
    if effect == "wear":  # the truth begins with the worn pads
        own = replace(own, start={**own.start, "zero_position": own.start["zero_position"] + 0.1})
    elif effect == "friction_level":
        own = replace(own, start={**own.start, "friction": own.start["friction"] / 0.8})
    elif effect == "torque_bias":
        own = replace(own, start={**own.start, "torque_bias": own.start["torque_bias"] - 40.0})
    speed, rest = misfit(recorded, replay(recorded, own, hidden))
    assert speed < 0.02 and rest < 1e-3
    without = misfit(recorded, replay(recorded, own))
    assert without[0] > 10.0 * speed or without[1] > 10.0 * rest


def test_derivatives_are_those_that_can_be_written_down():
    """Under the same signals a torque bias moves the speed by its time integral over the inertia;
    a share of the friction does so by the torque, and by nothing else at once."""
    recorded, own = record(request())
    base, step = replay(recorded, own), np.diff(recorded.time)
    inertia = own.parameters["engine_inertia"]
    free = ~(recorded.locked[1:] | recorded.locked[:-1])
    biased = replay(recorded, own.moved({"torque_bias": 3.0})).speed - base.speed
    assert biased[1:] == pytest.approx(np.cumsum(-3.0 / inertia * step * free), abs=1e-9)
    gain = replay(recorded, own, {"friction_level": {"change": 1e-6}})
    carried = 0.5 * (base.torque[1:] + base.torque[:-1])
    moved = np.diff(gain.speed - base.speed) / 1e-6
    first = np.flatnonzero(base.torque)[0]  # of the first slip: no heat has come of it yet
    early = slice(first, first + 100)
    expected = (-carried / inertia * step * free)[early]
    assert moved[early] == pytest.approx(expected, rel=2e-3, abs=1e-6)
    nudged = replay(recorded, own.moved({"kiss_point": 1e-6})).torque - base.torque
    shown = -slope(recorded, own)[early]
    assert nudged[early] / 1e-6 == pytest.approx(shown, rel=5e-3, abs=1.0)


def test_late_signals_are_put_right():
    """A delay that is known of gives the punctual signals back."""
    recorded, own = record(request())
    late = dict(recorded.signals)
    late["engine_torque"] = np.interp(recorded.time - 0.05, recorded.time, late["engine_torque"])
    behind = replace(recorded, signals=late)
    speed, _ = misfit(recorded, replay(behind, own, late={"engine_torque": 0.05}))
    assert speed < 0.03 < misfit(recorded, replay(behind, own))[0] / 10.0


def test_all_rows_are_kept_that_tell():
    """One per step of the generator's record unless the clutch is locked, hardly any amid that."""
    recorded, _ = record(request())
    steps = np.diff(recorded.time)
    assert np.all(steps[~recorded.locked[1:]] < 0.0021)
    assert steps.max() == pytest.approx(0.1) and len(steps) < 0.5 * 150.0 / 0.002
    assert recorded.time[0] == 0.0 and recorded.time[-1] == pytest.approx(150.0, abs=0.1)
