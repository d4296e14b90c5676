"""The integrator against another one, and the balances that no integrator may break."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .conftest import CHANNELS, TRUCK, simulated


def _reference(t: float, y: np.ndarray, plate: float, request: float, held: bool) -> list[float]:
    """The same slip, written down a second time (in gear 4.0 rad/m per m/s, 20 t)."""
    k = TRUCK
    body, housing, disc, engine, shaft, _, torque = y
    dx0 = k["expansion_body"] * (body - 70) + k["expansion_disc"] * min(disc - body, 110)
    depth = plate - dx0 - k["kiss_point"]
    friction = k["torque_cubic"] * depth**3 + k["torque_quadratic"] * depth**2 if depth < 0 else 0
    power = friction * (engine - shaft)
    resist = 20e3 * 9.81 * 0.006 + 3.3 * (shaft / 40) ** 2
    return [
        (22.5 * (85 - body) + 22.5 * (housing - body) + 126 * (disc - body)) / 40500,
        (22.5 * (body - housing) + 8 * (15 - housing)) / 15000,
        (126 * (body - disc) + power) / 2270,
        (torque - friction) / 3.2,
        0.0 if held else (friction - resist / 40) * 40**2 / 20e3,
        power,
        (request - torque) / 0.08,
    ]


@pytest.mark.parametrize("held", [True, False])
def test_a_slip_agrees_with_an_adaptive_integrator(bench, held):
    b = bench()
    b.s["held"], b.s["ratio"] = held, 40.0
    start = b.y[[0, 1, 2, 3, 4, 6, 7]]
    b.advance(600)
    expected = solve_ivp(
        _reference,
        (0, 0.6),
        start,
        args=(4.6, 500.0, held),
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
    ).y[:, -1]
    assert expected[3] - expected[4] > 10  # still slipping, both ends of the comparison too
    np.testing.assert_allclose(b.y[[0, 1, 2, 3, 4, 6, 7]], expected, rtol=1e-9)


def test_the_step_is_of_fourth_order(bench):
    def after(h: float) -> np.ndarray:
        b, work = bench(), np.empty((5, 8))
        for _ in range(round(0.4 / h)):
            b.plant.runge_kutta(b.y, 0.0, h, b.s, b.p, work)
            b.y[:] = work[0]
        return b.y

    exact = after(0.001)
    coarse, fine = (np.abs(after(h) - exact)[b] for h, b in ((0.04, 2), (0.02, 2)))
    assert 12 < coarse / fine < 20


def test_halving_the_step_changes_nothing_that_matters(drive, monkeypatch):
    from clutchest.generator import plant

    whole = drive("launches", 1, 60.0).truth.columns
    run = plant.run
    monkeypatch.setattr(plant, "run", lambda begin, end, _, *rest: run(begin, end, 2, *rest))
    half = simulated(TRUCK, {}, "launches", 1, (), nominal=True, duration=60.0).truth.columns
    assert whole["slip_energy"][-1] > 30e3
    for name, worst in (
        ("temp_disc", 1e-4),
        ("temp_body", 1e-5),
        ("engine_speed", 1e-2),
        ("slave_position", 1e-4),
    ):
        assert np.abs(half[name] - whole[name]).max() < worst, name


def test_heat_is_neither_lost_nor_made(drive):
    d = drive("launches", 1, 300.0)
    t, c = d.truth.time, d.truth.columns
    coolant, ambient = (np.interp(t, *d.signals[n]) for n in ("coolant_temp", "ambient_temp"))
    lost = 22.5 * (c["temp_body"] - coolant) + 8.0 * (c["temp_housing"] - ambient)
    lost = np.sum((lost[1:] + lost[:-1]) / 2 * np.diff(t))
    stored = sum(
        TRUCK[f"heat_capacity_{n}"]
        * np.ptp(c[f"temp_{n}"][[0, -1]])
        * np.sign(c[f"temp_{n}"][-1] - c[f"temp_{n}"][0])
        for n in ("body", "housing", "disc")
    )
    assert c["slip_energy"][-1] > 200e3
    assert stored + lost == pytest.approx(c["slip_energy"][-1], rel=1e-3)


def test_slip_energy_is_torque_times_slip(drive):
    d = drive("launches", 1, 300.0)
    power = d.truth.columns["clutch_torque"] * d.truth.columns["slip_speed"]
    energy = np.sum((power[1:] + power[:-1]) / 2) * 0.01
    assert energy == pytest.approx(d.truth.columns["slip_energy"][-1], rel=1e-3)


def test_engine_and_truck_obey_newton(drive):
    d = drive("launches", 1, 300.0)
    c = d.truth.columns
    slipping = (c["mode"] == "slipping") & (c["clutch_torque"] > 100)
    inside = slipping[2:] & slipping[1:-1] & slipping[:-2]
    rate = (c["engine_speed"][2:] - c["engine_speed"][:-2]) / 0.02
    left = (c["engine_torque"] - c["clutch_torque"])[1:-1] / 3.2
    assert inside.sum() > 500
    assert np.abs(rate - left)[inside].max() < 1.5  # rad/s², of up to a hundred
    assert np.abs(left[inside]).max() > 20


def test_megajoules_heat_the_body_by_kelvins(truck):
    """D5: 81 kg of 500 J/(kg K) take 1.5 MJ without cooling: 37 K."""
    truck |= {
        "conductance_engine_body": 0.0,
        "conductance_body_housing": 0.0,
        "conductance_disc_body": 0.0,
        "heat_fraction_body": 1.0,
    }
    c = simulated(truck, {}, "heating", 1, (), nominal=True, duration=300.0).truth.columns
    rise = c["temp_body"][-1] - c["temp_body"][0]
    assert 1.4e6 < c["slip_energy"][-1] < 1.6e6
    assert rise * 1.5e6 / c["slip_energy"][-1] == pytest.approx(37.04, abs=0.02)


def test_the_clutch_sticks_and_breaks_away(bench):
    b = bench(plate=4.6)
    b.s["held"], b.s["ratio"] = 0, 40.0
    b.y[b.plant.SHAFT] = b.y[b.plant.ENGINE] = 100.0
    b.y[b.plant.SPEED] = 2.5
    b.s["locked"] = 1
    b.y[b.plant.TORQUE] = b.s["request"] = 0.5 * b.capacity()
    b.advance(300)
    assert b.s["locked"] and b.y[b.plant.ENGINE] == b.y[b.plant.SHAFT]
    b.s["request"] = 3 * b.capacity()
    b.advance(300)
    assert not b.s["locked"] and b.y[b.plant.ENGINE] > b.y[b.plant.SHAFT] + 5
    b.s["request"] = -300.0
    b.advance(1500)
    assert b.s["locked"]
    assert b.y[b.plant.SPEED] * 40.0 == pytest.approx(b.y[b.plant.SHAFT], abs=1e-9)


def test_torque_follows_the_sign_of_the_slip(bench):
    b = bench()
    forward = b.transmitted()
    b.y[b.plant.ENGINE], b.y[b.plant.SHAFT], b.s["sign"] = 0.0, 150.0, -1.0
    assert forward > 100
    assert b.transmitted() == pytest.approx(-forward)
    assert b.rates()[b.plant.ENERGY] == pytest.approx(forward * 150.0)


def test_channels_are_not_needed():
    assert simulated(TRUCK, {}, "closed", 3, CHANNELS[:0], duration=1.0).signals == {}
