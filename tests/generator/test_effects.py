"""Every effect does what its row says, and nothing at gain 0."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from clutchest.generator import EFFECTS

from .conftest import CHANNELS, TRUCK, Bench, simulated

EXPANSION = 0.0096 * 20 + 0.0094 * 60  # mm on the bench: body 90 °C, disc 150 °C


def _torque(ratio: float) -> Callable[[Bench, Bench], None]:
    def check(plain: Bench, changed: Bench) -> None:
        assert changed.capacity() == pytest.approx(ratio * plain.capacity(), rel=1e-12)

    return check


def _rate(index: str, factor: float) -> Callable[[Bench, Bench], None]:
    def check(plain: Bench, changed: Bench) -> None:
        k = getattr(plain.plant, index)
        assert changed.rates()[k] == pytest.approx(factor * plain.rates()[k], rel=1e-9)

    return check


def _watts(index: str, capacity: float, watts: float) -> Callable[[Bench, Bench], None]:
    """So many more watts arrive at the thermal mass."""

    def check(plain: Bench, changed: Bench) -> None:
        k = getattr(plain.plant, index)
        more = (changed.rates()[k] - plain.rates()[k]) * capacity
        assert more == pytest.approx(watts, rel=1e-6)

    return check


def _moved(shift: float) -> Callable[[Bench, Bench], None]:
    """As if the plate stood ``shift`` mm closer."""

    def check(plain: Bench, changed: Bench) -> None:
        plain.s["plate"] -= shift
        assert changed.capacity() == pytest.approx(plain.capacity(), rel=1e-12)

    return check


def _drag(plain: Bench, changed: Bench) -> None:
    assert changed.transmitted() - plain.transmitted() == pytest.approx(4.0 * 1.5)
    changed.s["plate"] = 12.0
    assert changed.capacity() == 0 and changed.transmitted() == pytest.approx(6.0)


ON_THE_BENCH = {
    "friction_slip": ({"change": 0.2, "speed": 75.0}, _torque(1 + 0.2 * np.exp(-2.0))),
    "friction_speed": ({"slope": 0.1}, _torque(1.15)),
    "friction_temperature": ({"slope": 0.1}, _torque(1.05)),
    "friction_fade": ({"slope": 0.2, "onset": 120.0}, _torque(1 - 0.2 * 0.3)),
    "torque_curve": ({"change": 0.05}, _torque(1 + 0.05 * (6.51 - 4.6 + EXPANSION))),
    "centrifugal": ({"slope": -0.04}, _torque(1 - 0.04 * 2.25)),
    "kiss_point": ({"shift": 0.15}, _moved(0.15)),
    "expansion_body": ({"change": 0.5}, _moved(0.0096 * 20 * 0.5)),
    "expansion_disc": ({"change": 0.5}, _moved(0.0094 * 60 * 0.5)),
    "engine_inertia": ({"change": 0.25}, _rate("ENGINE", 0.8)),
    "heat_capacity_body": ({"change": 0.25}, _rate("BODY", 0.8)),
    "heat_capacity_disc": ({"change": 0.25}, _rate("DISC", 0.8)),
    "transmission_heat_path": ({"conductance": 5.0}, _watts("BODY", 40500.0, -5.0 * 10)),
    "coolant_coupling": ({"change": 0.4}, _watts("BODY", 40500.0, 0.4 * 22.5 * -5)),
    "housing_airflow": ({"slope": 0.5}, _watts("HOUSING", 15000.0, -0.25 * 8 * 45)),
    "viscous_drag": ({"coefficient": 4.0}, _drag),
}


@pytest.mark.parametrize("name", ON_THE_BENCH)
def test_effect_on_the_bench(bench, name):
    parameters, check = ON_THE_BENCH[name]
    plain, changed = bench(), bench(effects={name: parameters})
    for b in (plain, changed):
        b.y[b.plant.SPEED] = 10.0
    check(plain, changed)


def test_heat_split_moves_power_to_the_body(bench):
    plain, split = bench(), bench(effects={"heat_split": {"fraction": 0.3}})
    power = plain.rates()[plain.plant.ENERGY]
    gain = split.rates() - plain.rates()
    assert gain[plain.plant.BODY] * 40500 == pytest.approx(0.3 * power)
    assert gain[plain.plant.DISC] * 2270 == pytest.approx(-0.3 * power)


def _pair(effects, scenario="launches", duration=60.0):
    """The same drive without and with the effects."""
    return [
        simulated(TRUCK, {}, scenario, 1, CHANNELS, nominal=True, duration=duration, effects=e)
        for e in ({}, effects)
    ]


def test_wear_lowers_the_zero_position_and_the_curve():
    plain, worn = _pair({"wear": {"amount": 0.3, "rate": 2.0}})
    c = worn.truth.columns
    expected = 38.4 - 0.3 - 2.0 * c["slip_energy"] / 1e6
    np.testing.assert_allclose(c["zero_position"], expected, atol=1e-9)
    assert c["slip_energy"][-1] > 30e3
    before, after = (d.signals["slave_position"][1][:100].mean() for d in (plain, worn))
    assert after - before == pytest.approx(-0.3, abs=1e-6)


def test_wear_moves_the_kiss_point(bench):
    plain, worn = bench(), bench(effects={"wear": {"amount": 0.3}})
    worn.s["plate"] -= 0.3
    assert worn.capacity() == pytest.approx(plain.capacity(), rel=1e-12)


def test_position_offset_shows_in_the_zero_position_too():
    plain, off = _pair({"position_offset": {"offset": 0.2}}, duration=5.0)
    shift = off.signals["slave_position"][1] - plain.signals["slave_position"][1]
    np.testing.assert_allclose(shift, 0.2, atol=1e-9)
    np.testing.assert_array_equal(
        off.truth.columns["slave_position"], plain.truth.columns["slave_position"]
    )


def test_friction_level_is_the_truths_friction():
    plain, weak = _pair({"friction_level": {"change": -0.1}})
    np.testing.assert_allclose(weak.truth.columns["friction"], 0.9)
    assert (plain.truth.columns["friction"] == 1).all()


def test_torque_gain_and_bias_change_only_the_report():
    plain, wrong = _pair({"torque_gain": {"change": 0.05}, "torque_bias": {"bias": 30.0}})
    np.testing.assert_allclose(
        wrong.signals["engine_torque"][1], 1.05 * plain.signals["engine_torque"][1] + 30.0
    )
    np.testing.assert_array_equal(
        wrong.truth.columns["engine_torque"], plain.truth.columns["engine_torque"]
    )
    assert (wrong.truth.columns["torque_bias"] == 30.0).all()


@pytest.mark.parametrize(
    ("effect", "signal"), [("torque_delay", "engine_torque"), ("position_delay", "slave_position")]
)
def test_delays_touch_their_signal_only(effect, signal):
    plain, late = _pair({effect: {"delay": 0.05}})
    for name, (time, value) in late.signals.items():
        if name == signal:
            shifted = np.interp(time - 0.05, *plain.signals[name])
            assert np.std(value - shifted) < 0.1 * np.std(value - plain.signals[name][1])
        else:
            np.testing.assert_array_equal(value, plain.signals[name][1])


def test_hysteresis_is_a_play(bench):
    """Positions closing and opening give the torques of positions two half-widths apart."""
    effects = {"position_hysteresis": {"play": 0.1}}
    b = bench(effects=effects)
    b.s["port"] = 0.0
    for goal, last in ((6.0, 0.0), (4.0, 0.1), (5.0, -0.1), (4.95, -0.05)):
        b.s["command"] = goal
        for _ in range(1000):
            b.plant.actuate(b.y, b.s, b.p)
        assert b.s["slave"] == pytest.approx(goal, abs=1e-6)
        if last:
            assert b.s["plate"] - b.s["slave"] == pytest.approx(last, abs=1e-6)


def test_every_effect_has_been_looked_at():
    multistart = {
        "heat_split",
        "wear",
        "position_offset",
        "friction_level",
        "torque_gain",
        "torque_bias",
        "torque_delay",
        "position_delay",
        "position_hysteresis",
    }
    assert set(ON_THE_BENCH) | multistart == set(EFFECTS)
    assert not set(ON_THE_BENCH) & multistart


def test_effects_at_gain_zero_are_absent():
    plain, zero = _pair({name: effect.parameters for name, effect in EFFECTS.items()})
    for name, column in plain.truth.columns.items():
        np.testing.assert_array_equal(column, zero.truth.columns[name])
    for name, (_, value) in plain.signals.items():
        np.testing.assert_array_equal(value, zero.signals[name][1])


@pytest.mark.parametrize("name", EFFECTS)
def test_no_effect_upsets_a_drive(name):
    gains = {
        "wear": 1.0,
        "position_offset": 0.3,
        "torque_delay": 0.1,
        "position_delay": 0.1,
        "torque_bias": 50.0,
        "kiss_point": 0.3,
        "position_hysteresis": 0.1,
        "transmission_heat_path": 10.0,
        "viscous_drag": 10.0,
    }
    gain = next(iter(EFFECTS[name].parameters))
    d, changed = _pair({name: {gain: gains.get(name, 0.15)}}, scenario="city", duration=100.0)
    c = changed.truth.columns
    assert c["engine_speed"].min() > 40 and 20 < c["temp_disc"].max() < 300
    assert (
        any(np.any(value != d.signals[n][1]) for n, (_, value) in changed.signals.items())
        or name == "friction_fade"
    )


def test_a_clutch_too_weak_for_its_engine_is_relieved():
    _, weak = _pair({"torque_curve": {"change": -0.1}}, scenario="city", duration=400.0)
    c = weak.truth.columns
    assert c["clutch_torque"].max() > 1500 and c["engine_speed"].max() < 240
    assert c["temp_disc"].max() < 300
