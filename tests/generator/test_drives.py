"""What the scenarios must show."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.generator import SCENARIOS, Disturbances

from .conftest import CHANNELS, TRUCK, simulated

EXACT = ("position_origin", "reference_temp", "engine_torque_max", "disc_body_temp_cap")
SPREADS = {key: 0.03 * abs(value) for key, value in TRUCK.items() if key not in EXACT}
SPREADS |= {"zero_position_ref": 0.2, "kiss_point": 0.05}


def _events(columns, least: float = 15e3):
    """(first, last + 1) of every slip event of more than ``least`` J."""
    slipping = columns["mode"] == "slipping"
    edges = np.flatnonzero(np.diff(np.r_[0, slipping, 0]))
    energy = columns["slip_energy"]
    return [
        (a, b)
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b < len(energy) and energy[b] - energy[a] > least
    ]


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("seed", [11, 12])
def test_every_drive_is_plausible(scenario, seed):
    d = simulated(TRUCK, SPREADS, scenario, seed, CHANNELS, duration=300.0)
    c = d.truth.columns
    for name, column in c.items():
        assert name == "mode" or np.isfinite(column).all(), name
    hottest = 370 if scenario == "ramps" else 300  # D1's own disc passes 300 °C
    for name in ("temp_body", "temp_disc", "temp_housing"):
        assert c[name].min() > 2 and c[name].max() < hottest, name
    assert set(np.unique(c["mode"])) <= {"open", "slipping", "locked", "retracted"}
    assert c["engine_speed"].min() > 40 and c["engine_speed"].max() < 260
    assert c["vehicle_speed"].min() >= 0
    assert np.all(np.diff(c["slip_energy"]) >= 0)
    assert d.truth.time[1] == pytest.approx(0.01)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_city_launches_are_modest(drive, seed):
    c = drive("city", seed).truth.columns
    events = _events(c)
    energies = [c["slip_energy"][b] - c["slip_energy"][a] for a, b in events]
    seconds = [(b - a) * 0.02 for a, b in events]
    assert len(events) >= 8
    assert 30e3 < np.median(energies) < 80e3 and max(energies) < 130e3
    assert 1 < np.median(seconds) < 4 and max(seconds) < 5
    assert np.abs(c["clutch_torque"][c["mode"] == "slipping"]).max() < 1300
    for mode, least in (("open", 0.02), ("slipping", 0.02), ("locked", 0.005), ("retracted", 0.5)):
        assert np.mean(c["mode"] == mode) > least, mode


@pytest.mark.parametrize("seed", [1, 2])
def test_launches_are_many_and_some_are_heavy(drive, seed):
    c = drive("launches", seed).truth.columns
    events = _events(c)
    energies = np.array([c["slip_energy"][b] - c["slip_energy"][a] for a, b in events])
    assert 22 <= len(events) <= 26
    assert np.sum(energies > 100e3) >= 2 and energies.max() < 330e3
    between = pairwise(events)
    assert all("retracted" in c["mode"][b:a] for (_, b), (a, _) in between)


def test_lock_up_does_not_chatter(drive):
    c = drive("launches", 1).truth.columns
    for _, end in _events(c):
        second = c["mode"][end : end + 50]
        assert np.isin(second, ("locked", "retracted")).all()
        assert np.all(c["slip_speed"][end : end + 50] == 0)


def test_ramps_drift_as_the_paper_shows(drive):
    """D1: between first and last ramp the torque at one position differs by up to 900 Nm."""
    d = drive("ramps")
    t, c = d.truth.time, d.truth.columns
    position = c["slave_position"] - 38.4
    assert c["temp_body"][0] == 73.0
    at = np.linspace(position[(t > 10) & (t < 15)].max() - 1, 4.22, 200)

    def ramp(begin: float) -> np.ndarray:
        rows = (t > begin + 0.1) & (t < begin + 4.99)
        return np.interp(-at, -position[rows], c["clutch_torque"][rows])

    assert 850 < np.max(ramp(80.0) - ramp(10.0)) < 950
    slip = c["slip_speed"][(t > 12) & (t < 85)]
    assert 146 < slip.mean() < 156 and slip.min() > 135
    assert np.all(c["input_shaft_speed"][(t > 10) & (t < 85)] == 0)
    assert c["mode"][-1] == "retracted"


def test_heating_raises_the_zero_position(drive):
    """D4: 0.3 mm for the first 1.5 MJ, read after the disc has cooled."""
    d = drive("heating")
    t, c = d.truth.time, d.truth.columns
    first = np.flatnonzero(np.diff(c["slip_energy"]) > 0)
    stop = next(k for k in first if c["slip_energy"][k + 3000] == c["slip_energy"][k + 1])
    later = np.searchsorted(t, t[stop] + 4 * 2270 / 126)
    assert 1.4e6 < c["slip_energy"][later] < 1.6e6
    assert c["slave_position"][later] - c["slave_position"][0] == pytest.approx(0.3, abs=0.03)
    assert c["slave_position"][later + 10000] < c["slave_position"][later] - 0.05
    assert c["slip_energy"][-1] > 5e6


def _heatings(columns):
    """(first, last) row of slip of every heating."""
    slips = np.flatnonzero(np.diff(columns["slip_energy"]) > 10.0)  # J: more than a spin-up
    apart = np.flatnonzero(np.diff(slips) > 10_000)
    return list(zip(slips[np.r_[0, apart + 1]], slips[np.r_[apart, -1]], strict=True))


def test_heating_keeps_to_the_axes_of_the_paper(drive):
    """D4: ticks 38.4–39.2 mm over 2500 s, several heatings; x0 read four τ_d after each."""
    d = drive("heating")
    c = d.truth.columns
    heatings = _heatings(c)
    assert len(heatings) == 4
    after = [
        np.searchsorted(d.truth.time, d.truth.time[last] + 4 * 2270 / 126) for _, last in heatings
    ]
    read = [c["slave_position"][row] for row in after if row < len(c["mode"])]
    assert len(read) >= 3 and all(np.diff(read) > 0)
    assert 38.35 < c["slave_position"][0] < 38.45 and 39.0 < read[-1] < 39.25
    energy = c["slip_energy"]
    taken = [energy[last + 1] - energy[first] for first, last in heatings]
    assert taken[0] == pytest.approx(1.5e6, rel=0.05)
    assert taken[1:3] == pytest.approx([1.3e6, 1.3e6], rel=0.05)


@pytest.mark.parametrize("seed", [1, 2])
def test_heating_shows_the_shift_of_the_torque_curve(drive, seed):
    """Near one position the hot clutch passes some 900 Nm more than the cold one."""
    c = drive("heating", seed).truth.columns
    first, last = _heatings(c)[0]
    rows = np.arange(first, last)
    x = c["slave_position"][rows] - 38.4
    there = (np.abs(x - 4.2) < 0.05) & (c["mode"][rows] == "slipping")
    over = (c["temp_disc"] - c["temp_body"])[rows]
    cold = c["clutch_torque"][rows][there & (over < 35)]
    hot = c["clutch_torque"][rows][there & (over > 100)]
    assert len(cold) > 20 and len(hot) > 20
    assert 700 < np.median(hot) - np.median(cold) < 1100
    assert c["clutch_torque"].max() < 1700 and c["temp_disc"].max() < 280
    slipping = (c["mode"] == "slipping") & (c["clutch_torque"] > 300)
    assert 5 < np.median(c["slip_speed"][slipping]) < 60


def test_slip_steps_hold_the_position(drive):
    d = drive("slip-steps")
    c = d.truth.columns
    steps = (c["mode"] == "slipping") & (c["clutch_torque"] > 40) & (c["slip_speed"] > 62)
    assert steps.mean() > 0.05
    assert c["slip_speed"][steps].max() == pytest.approx(136, abs=3)
    assert 40 < np.median(c["clutch_torque"][steps]) < 250
    starts = np.flatnonzero(np.diff(steps.astype(int)) > 0) + 30
    for k in starts[steps[starts + 300]]:
        assert np.ptp(c["slave_position"][k : k + 300]) < 1e-3


def test_closed_and_cooling_never_slip(drive):
    assert drive("closed", 1, 200.0).truth.columns["slip_energy"][-1] == 0
    d = drive("cooldown")
    rest = d.truth.columns["slip_energy"][d.truth.time > 150]
    assert rest[0] > 0.9e6 and np.ptp(rest) < 200  # J: the shaft is spun up once
    assert (d.truth.columns["mode"][d.truth.time > 160] == "retracted").all()
    assert d.truth.columns["temp_disc"].max() > 180


def test_retracted_slave_reads_the_zero_position(drive):
    d = drive("city")
    c = d.truth.columns
    zero = (
        c["zero_position"]
        + 0.0096 * (c["temp_body"] - 70)
        + 0.0094 * np.minimum(c["temp_disc"] - c["temp_body"], 110)
    )
    retracted = c["mode"] == "retracted"
    # recorded a step apart from the temperatures
    assert np.abs(c["slave_position"] - zero)[retracted].max() < 1e-4
    time, motor = d.signals["motor_position"]
    still = np.interp(time, d.truth.time, retracted) == 1
    assert np.all(motor[still] == 0) and motor.max() > 10
    nearly = (c["mode"] == "locked") & (c["slave_position"] - 38.4 < 3)
    assert nearly.any() and np.all(c["slave_position"][nearly] > zero[nearly] - 1e-4)


def test_drives_start_near_rest_at_plausible_temperatures():
    starts = []
    for seed in range(12):
        truth = simulated(TRUCK, {}, "city", seed, (), nominal=True, duration=0.5).truth
        starts.append([truth.columns[n][0] for n in ("temp_body", "temp_housing", "temp_disc")])
    body, housing, disc = np.array(starts).T
    assert 60 < body.mean() < 80 and 1 < body.std() < 6
    assert np.all(housing < body) and np.abs(disc - body).max() < 3


def test_truth_has_its_columns_and_rates(drive):
    states = {
        "temp_body",
        "temp_housing",
        "temp_disc",
        "zero_position",
        "friction",
        "engine_speed",
        "torque_bias",
    }
    extra = {
        "clutch_torque",
        "mode",
        "slip_speed",
        "slip_energy",
        "engine_torque",
        "input_shaft_speed",
        "slave_position",
    }
    d = drive("launches", 1, 60.0)
    assert states | extra <= set(d.truth.columns)
    assert {len(c) for c in d.truth.columns.values()} == {len(d.truth.time)} == {6001}
    assert drive("city").truth.time[1] == pytest.approx(0.02)


def test_a_seed_is_a_drive():
    one, same, other = (
        simulated(TRUCK, SPREADS, "city", seed, CHANNELS, duration=60.0) for seed in (5, 5, 6)
    )
    assert one.parameters == same.parameters != other.parameters
    for name, (time, value) in one.signals.items():
        np.testing.assert_array_equal(time, same.signals[name][0])
        np.testing.assert_array_equal(value, same.signals[name][1])
    assert len(one.signals["engine_speed"][1]) != len(other.signals["engine_speed"][1]) or np.any(
        one.signals["engine_speed"][1] != other.signals["engine_speed"][1]
    )


def test_parameters_are_drawn_with_their_spread():
    draws = [simulated(TRUCK, SPREADS, "closed", seed, (), duration=0.1) for seed in range(80)]
    inertia = [d.parameters["engine_inertia"] for d in draws]
    assert np.std(inertia) == pytest.approx(0.03 * 3.2, rel=0.3)
    assert np.mean(inertia) == pytest.approx(3.2, abs=0.04)
    assert {d.parameters["zero_position_ref"] for d in draws} == {38.4}
    zero = [d.truth.columns["zero_position"][0] for d in draws]
    assert np.std(zero) == pytest.approx(0.2, rel=0.3)
    nominal = simulated(TRUCK, SPREADS, "closed", 1, (), duration=0.1, nominal=True)
    assert nominal.parameters == TRUCK
    assert nominal.truth.columns["zero_position"][0] == 38.4


def test_disturbances_walk_as_stated():
    ends = []
    for seed in range(60):
        c = simulated(
            TRUCK,
            {},
            "closed",
            seed,
            (),
            duration=9.0,
            disturbances=Disturbances(
                torque_bias_walk=2.0,
                torque_bias_std=8.0,
                friction_walk=0.01,
                friction_std=0.05,
            ),
        ).truth.columns
        ends.append(
            [
                c["torque_bias"][0],
                np.ptp(c["torque_bias"][[0, -1]]),
                c["friction"][0],
                np.ptp(c["friction"][[0, -1]]),
            ]
        )
    bias, walked, friction, strayed = np.array(ends).T
    assert np.std(bias) == pytest.approx(8.0, rel=0.35)
    assert np.sqrt(np.mean(walked**2)) == pytest.approx(6.0, rel=0.35)
    assert np.std(friction) == pytest.approx(0.05, rel=0.35)
    assert np.sqrt(np.mean(strayed**2)) == pytest.approx(0.03, rel=0.35)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"scenario": "citty"}, "did you mean 'city'"),
        ({"effects": {"wera": {}}}, "did you mean 'wear'"),
        ({"effects": {"wear": {"rat": 1.0}}}, "did you mean 'rate'"),
        ({"effects": {"wear": {"rate": -1.0}}}, "expected 0 or more"),
        ({"effects": {"friction_slip": {"speed": 0.0}}}, "expected more than 0"),
        ({"duration": 0.0}, "expected more than 0 s"),
        ({"outliers": 1.5}, "share of outliers"),
        ({"parameters": {}}, "is missing"),
    ],
)
def test_bad_input_is_told_in_one_line(change, says):
    arguments = {
        "parameters": TRUCK,
        "spreads": {},
        "scenario": "city",
        "seed": 1,
        "channels": CHANNELS,
        "duration": 1.0,
    } | change
    with pytest.raises(ClutchestError) as told:
        simulated(**arguments)
    assert says in str(told.value) and "\n" not in str(told.value)


@pytest.mark.slow
def test_coolant_and_ambient_wander_slowly():
    coolant, ambient = np.array(
        [
            [
                simulated(TRUCK, {}, "closed", seed, CHANNELS, duration=400.0).signals[name][1]
                for name in ("coolant_temp", "ambient_temp")
            ]
            for seed in range(8)
        ]
    ).swapaxes(0, 1)
    assert coolant.min() > 76 and coolant.max() < 93
    assert 0.5 < np.std(coolant[:, -1] - coolant[:, 0]) < 4
    assert np.abs(np.diff(coolant)).max() < 0.2  # K per second
    assert ambient.min() > -1 and ambient.max() < 29
