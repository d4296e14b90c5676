"""What sets a healthy truck apart from its model: absent it changes nothing, present it does what
it says and nothing else."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.stats import kurtosis, skew

from clutchest.errors import ClutchestError
from clutchest.generator import GROUPS, SCENARIOS, DriveRequest, Mismatch, Sampled, generate
from clutchest.generator.effects import complete, numbers
from clutchest.generator.population import Population
from clutchest.generator.sensing import Sensing
from clutchest.generator.situation import FLYWHEEL, REAR, SHAFT_INERTIA, STRETCH
from clutchest.generator.stop_and_go import STOP_AND_GO
from clutchest.generator.structure import CURVE_POINTS, DEEPEST, Structure

from .conftest import CHANNELS, TRUCK, simulated

NOISY = tuple(replace(channel, noise=0.02, noise_ar=0.3) for channel in CHANNELS)
LOGGED = ("noise-level", "noise-colour", "noise-tails", "sampling", "sensor-lag")


def driven(mismatch: Mismatch, channels: Any = NOISY, seconds: float = 90.0) -> Sampled:
    return simulated(
        TRUCK, {}, "launches", 1, channels, nominal=True, duration=seconds, mismatch=mismatch
    )


@pytest.fixture(scope="module")
def plain() -> Sampled:
    return driven(Mismatch())


def test_a_truck_without_mismatch_is_the_truck_that_it_was():
    """Readings and truth of two drives, as they were before there was any mismatch to ask for."""
    changed = {"engine_inertia": 0.1, "kiss_point": 0.02}
    for scenario, seed, expected in (
        ("city", 3, (209820.45522000326, 83.1563379911049, 784.1266161428975, 38.525277606039595)),
        ("pulses", 4, (747138.5254057999, 95.27708056565099, 1.8839999999871553, 38.6407111159409)),
    ):
        d = simulated(TRUCK, changed, scenario, seed, CHANNELS, duration=200.0)
        c = d.truth.columns
        found = (
            c["slip_energy"][-1],
            c["temp_disc"][-1],
            d.signals["engine_torque"][1][-1],
            d.signals["slave_position"][1][-1],
        )
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_none_is_bit_for_bit_none(plain):
    request = DriveRequest(TRUCK, {}, "launches", 1, NOISY, nominal=True, duration=90.0)
    without = generate(request)
    for name, (time, value) in without.signals.items():
        assert np.array_equal(time, plain.signals[name][0])
        assert np.array_equal(value, plain.signals[name][1])
    for name, column in without.truth.columns.items():
        assert np.array_equal(column, plain.truth.columns[name]), name


@pytest.mark.parametrize("group", sorted(set(GROUPS) - {"priors"}))
def test_a_group_changes_the_truck_or_the_log(group, plain):
    """What differs in the log leaves the truck alone; the rest changes what the truck does."""
    wrong = driven(Mismatch.drawn([group], 5))
    names = [name for name, column in plain.truth.columns.items() if column.dtype.kind == "f"]
    same = all(np.array_equal(plain.truth.columns[n], wrong.truth.columns[n]) for n in names)
    assert same == (group in LOGGED)
    shown = [
        name
        for name, (time, value) in plain.signals.items()
        if not np.array_equal(value, wrong.signals[name][1])
        or not np.array_equal(time, wrong.signals[name][0])
    ]
    assert shown
    assert all(np.isfinite(value).all() for _, value in wrong.signals.values())


def test_draws_are_a_truck_s_own():
    assert Mismatch.drawn(GROUPS, 1) == Mismatch.drawn(GROUPS, 1)
    one, other = (Mismatch.drawn(GROUPS, seed) for seed in (1, 2))
    assert one.structure != other.structure and one.sensing != other.sensing
    alone = Mismatch.drawn(["flywheel"], 1).structure
    assert alone.flywheel == one.structure.flywheel > 0.0 == alone.disc_faces
    assert Mismatch.drawn([], 1) == Mismatch()
    with pytest.raises(ClutchestError, match="flywheel"):
        Mismatch.drawn(["flywheels"], 1)


# --- structure -----------------------------------------------------------------------------------

ALL = Mismatch.drawn(GROUPS, 3).structure


def moving(bench: Any, structure: Structure, **situation: float) -> Any:
    """The plant of a truck in parts, held still."""
    b = bench()
    b.p = numbers(TRUCK, TRUCK, complete({}), 38.4, 20e3, structure)[0]
    b.y = np.concatenate([b.y, [20.0, 95.0, 40.0, 380.0, 0.001]])
    for name, value in situation.items():
        b.s[name] = value
    return b


def rates(b: Any) -> np.ndarray:
    out = np.zeros(len(b.y))
    b.plant.rates(b.y, b.s["plate"], b.s, b.p, out)
    return out


def test_heat_in_parts_is_neither_lost_nor_made(bench):
    """What the masses store is the slip power and what coolant and air exchange with them."""
    b = moving(bench, ALL)
    out, y, plant, s = rates(b), b.y, b.plant, ALL
    stored = TRUCK["heat_capacity_disc"] * out[plant.DISC]
    stored += TRUCK["heat_capacity_body"] * (
        (1 - s.flywheel) * out[plant.BODY] + s.flywheel * out[FLYWHEEL]
    )
    stored += TRUCK["heat_capacity_housing"] * (
        (1 - s.housing_rear) * out[plant.HOUSING] + s.housing_rear * out[REAR]
    )
    air = (1 - s.housing_rear) * y[plant.HOUSING] + s.housing_rear * y[REAR] - 15.0
    direct = 1.0 / (1.0 / TRUCK["conductance_engine_body"] - 1.0 / s.flywheel_conductance)
    power = out[plant.ENERGY]
    assert power > 1e4
    assert stored == pytest.approx(power + direct * (85.0 - y[FLYWHEEL]) - 8.0 * air)


def test_one_mass_in_two_equal_parts_goes_as_the_whole(bench):
    """Parts as warm as their neighbours: the sum of what both store is what the one did."""
    b, whole = moving(bench, ALL, held=1), bench()
    b.y[8:11] = 0.0, b.y[b.plant.BODY], b.y[b.plant.HOUSING]
    parts, one = rates(b), whole.rates()
    assert parts[b.plant.DISC] == pytest.approx(one[b.plant.DISC], rel=1e-2)
    rear = ALL.housing_rear
    both = (1 - rear) * parts[b.plant.HOUSING] + rear * parts[REAR]
    assert both == pytest.approx(one[b.plant.HOUSING])


def test_the_body_rests_where_it_would_without_a_flywheel(bench):
    structure = Structure(flywheel=0.4, flywheel_conductance=100.0)
    b, without = moving(bench, structure, locked=1), bench()
    for at in (b, without):
        at.y[[at.plant.BODY, at.plant.HOUSING, at.plant.DISC]] = 80.0, 60.0, 80.0
        at.s["locked"] = 1
    b.plant.settle(b.y, 85.0, 15.0, b.p)
    b.y[b.plant.DISC] = 0.5 * (b.y[b.plant.BODY] + b.y[FLYWHEEL])
    into_body = (1 - 0.4) * rates(b)[b.plant.BODY] + 0.4 * rates(b)[FLYWHEEL]
    assert into_body == pytest.approx(without.rates()[without.plant.BODY], abs=2e-6)


def test_a_soft_driveline_shuffles_at_its_own_frequency(bench):
    """Clutch locked, engine against truck: √(k (1/J + r²/m))/2π, k seen at the gearbox's input."""
    stiffness, ratio, mass = 4e5, 20.0, 20e3
    structure = Structure(driveline_stiffness=stiffness, driveline_damping=10.0)
    b = moving(bench, structure, locked=1, held=0, ratio=ratio)
    plant = b.plant
    b.y[[plant.ENGINE, plant.SHAFT]] = 100.0
    b.y[plant.SPEED], b.y[STRETCH], b.s["request"] = 5.0, 0.02, b.y[plant.TORQUE]
    stretch, work = [], np.empty((5, len(b.y)))
    for _ in range(2000):
        plant.advance(b.y, 1, b.s, b.p, work)
        b.s["locked"] = 1
        stretch.append(b.y[STRETCH])
    level = np.array(stretch) - np.mean(stretch)
    crossings = np.flatnonzero((level[1:] > 0) & (level[:-1] <= 0))
    period = 1e-3 * np.mean(np.diff(crossings))
    inertia = TRUCK["engine_inertia"] + SHAFT_INERTIA  # one while locked
    k = stiffness / ratio**2
    expected = sqrt(k * (1 / inertia + ratio**2 / mass)) / (2 * pi)
    assert 1 / period == pytest.approx(expected, rel=0.03)


def test_the_engine_follows_its_report():
    """The speed of an open engine obeys the torque reported a lag ago."""
    lag = 0.03
    d = driven(Mismatch(structure=Structure(delivery_lag=lag)), CHANNELS)
    c = d.truth.columns
    still = (c["mode"] == "slipping") & (c["clutch_torque"] > 100)
    inside = still[2:] & still[1:-1] & still[:-2]
    needed = (TRUCK["engine_inertia"] * np.gradient(c["engine_speed"], 0.01) + c["clutch_torque"])[
        1:-1
    ][inside]
    reported, t = c["engine_torque"], d.truth.time
    late = np.interp(t - lag, t, reported)[1:-1][inside]
    off = [np.median(np.abs(needed - torque)) for torque in (reported[1:-1][inside], late)]
    assert off[1] < 0.5 * off[0]


def test_a_bent_curve_bends_the_torque(bench):
    bent = tuple(0.01 * np.linspace(0.0, 1.0, CURVE_POINTS))
    for plate in (6.0, 5.0, 3.0):
        plain = bench(plate=plate)
        b = moving(bench, Structure(curve=bent), plate=plate)
        ratio = b.capacity() / plain.capacity()
        growth = 0.0096 * 20.0 + 0.0094 * 60.0
        depth = TRUCK["kiss_point"] - plate + growth
        assert ratio == pytest.approx(1.0 + 0.01 * depth / DEEPEST, rel=1e-9)


# --- log, population, driver ---------------------------------------------------------------------


def test_noise_is_other_than_stated():
    def error(mismatch: Mismatch) -> np.ndarray:
        quiet = tuple(replace(c, noise=0.0) for c in CHANNELS)
        exact = driven(mismatch, quiet).signals["engine_speed"][1]
        return driven(mismatch).signals["engine_speed"][1] - exact

    louder = Mismatch(sensing=Sensing(noise={"engine_speed": 1.3}))
    assert np.std(error(louder)) == pytest.approx(0.02 * 1.3, rel=0.05)
    drawn = Mismatch.drawn(["noise-level"], 5).sensing.noise
    assert set(drawn) >= {channel.name for channel in CHANNELS}
    assert all(0.7 <= times <= 1.3 for times in drawn.values()) and len(set(drawn.values())) > 5
    colour = Mismatch.drawn(["noise-colour"], 5)
    e = error(colour)
    ar = 0.3 + 0.7 * colour.sensing.noise_ar["engine_speed"]
    assert np.mean(e[1:] * e[:-1]) / np.var(e) == pytest.approx(ar, abs=0.05)
    assert kurtosis(error(Mismatch.drawn(["noise-tails"], 5))) > 0.5
    assert abs(kurtosis(error(Mismatch()))) < 0.2


def test_messages_are_off_their_beat():
    time = driven(Mismatch.drawn(["sampling"], 5)).signals["engine_speed"][0]
    assert (np.diff(time) > 0).all()
    assert np.std(np.diff(time)) > 3 * np.std(
        np.diff(driven(Mismatch()).signals["engine_speed"][0])
    )


def test_parameters_scatter_more_widely_and_not_normally():
    random = np.random.default_rng(1)
    wide = Population(1.5, skewed=True)
    drawn = np.array([wide.deviate(random) for _ in range(20_000)])
    assert np.mean(drawn) == pytest.approx(0.0, abs=0.05)
    assert np.std(drawn) == pytest.approx(1.5, rel=0.03)
    assert kurtosis(drawn) > 1.0
    longer = drawn[np.abs(drawn) > 3.0]
    assert min(np.mean(longer > 0), np.mean(longer < 0)) > 0.4, "tails of either side"
    assert abs(skew(np.abs(drawn))) > 1.0
    spreads = {"heat_capacity_body": 1600.0, "kiss_point": 0.02}
    for mismatch in (Mismatch(), Mismatch.drawn(["priors"], 1)):
        found = simulated(
            TRUCK, spreads, "launches", 9, CHANNELS, duration=5.0, mismatch=mismatch
        ).parameters
        assert found["heat_capacity_body"] != TRUCK["heat_capacity_body"]
        assert found["engine_inertia"] == TRUCK["engine_inertia"]


def test_a_driver_of_his_own_does_what_no_scenario_does():
    assert STOP_AND_GO.name not in SCENARIOS
    longest = {"nominal": True, "duration": 600.0}
    city = simulated(TRUCK, {}, "city", 1, CHANNELS, **longest)
    own = Mismatch.drawn(["driver"], 1)
    queue = simulated(TRUCK, {}, "city", 1, CHANNELS, mismatch=own, **longest)
    assert slips(queue) > 1.3 * slips(city)
    speed = queue.truth.columns["vehicle_speed"]
    assert speed.max() < 8.0 < city.truth.columns["vehicle_speed"].max()


def slips(d: Sampled) -> int:
    """Stretches of slip that transmit torque, two seconds apart or more."""
    c = d.truth.columns
    carries = (c["mode"] == "slipping") & (c["clutch_torque"] > 50.0)
    return int(np.sum(np.diff(d.truth.time[carries]) > 2.0)) + 1
