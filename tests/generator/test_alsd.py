"""The generator's active differential: physics that needs no second implementation, every scenario
on both vehicles, every effect, and what the experiments of ID08 are there to show."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.generator import Channel, DriveRequest, Sampled, alsd
from clutchest.generator.alsd import plant
from clutchest.generator.alsd.effects import EFFECTS, numbers
from clutchest.generator.alsd.generate import draw, run
from clutchest.generator.alsd.scenarios import ON_THE_ROAD, RPM
from clutchest.generator.effects import complete
from clutchest.models import machine_of
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

Columns = dict[str, NDArray[np.float64]]
ACTUATOR = ("armature_voltage", "armature_current", "motor_angle", "oil_temp")
RIG = (
    *ACTUATOR,
    "slip_speed",
    "armature_temp",
    "clutch_torque",
    "motor_torque",
    "drive_torque",
    "drive_angle",
)
CAR = (*ACTUATOR, "wheel_speed_left", "wheel_speed_right", "shaft_torque")


def simulated(*arguments: Any, **options: Any) -> Sampled:
    return alsd.generate(DriveRequest(*arguments, **options))


@cache
def rig() -> dict[str, float]:
    return {key: value.value for key, value in load_vehicle("alsd_rig").parameters.items()}


def drive(scenario: str, seed: int = 1, duration: float | None = None, **rest: object) -> Sampled:
    names = CAR if scenario in ON_THE_ROAD else RIG
    channels = [Channel(name, "M", 0.005) for name in names]
    return simulated(
        rig(),
        {},
        scenario,
        seed,
        channels,
        nominal=True,
        duration=duration,
        **rest,
    )


def record(
    profile: NDArray, effects: Mapping[str, Mapping[str, float]] = {}, **changed: float
) -> Columns:
    parameters = {**rig(), **changed}
    active = complete(effects, EFFECTS)
    return run(profile, numbers(parameters, active, parameters["friction_coefficient"], {}))


def held(amps: float, seconds: float = 1.0, rpm: float = 25.0) -> NDArray:
    profile = np.zeros(round(seconds * 1000) + 1, plant.PROFILE)
    profile["oil"], profile["driven"], profile["asked"] = 25.0, rpm * RPM, amps
    profile["asked"][:100] = 0.0
    return profile


# --- the plant ---


def test_a_held_current_is_reached_and_makes_torque() -> None:
    o = record(held(7.0))
    assert o["current"][-1] == pytest.approx(7.0, abs=1e-3)
    potential = rig()["friction_coefficient"] * 10 * 0.065 * o["pack_force"][-1]
    assert o["clutch_torque"][-1] == pytest.approx(potential, rel=1e-6)
    assert o["slip_speed"][-1] == pytest.approx(25 * RPM, rel=1e-3)


def test_stalled_current_is_ohms() -> None:
    profile = held(0.0)
    profile["actuator"], profile["bench"], profile["asked"] = plant.VOLTAGE, plant.ROTOR_HELD, 3.0
    o = record(profile, armature_heat_capacity=1e9)
    assert o["current"][-1] == pytest.approx(3.0 / rig()["armature_resistance"], rel=1e-6)
    assert o["motor_speed"][-1] == 0.0


def test_a_motor_alone_turns_until_its_voltage_is_its_speeds() -> None:
    profile = held(0.0, 2.0)
    profile["actuator"], profile["bench"], profile["asked"] = plant.VOLTAGE, plant.MOTOR_ALONE, 6.0
    o = record(profile, armature_heat_capacity=1e9)
    back = 6.0 - rig()["armature_resistance"] * o["current"][-1]
    assert o["motor_speed"][-1] == pytest.approx(back / rig()["back_emf_constant"], rel=1e-4)


def test_heat_of_the_clutch_is_torque_times_slip() -> None:
    o = record(held(7.0), pack_oil_conductance=0.0)
    power = o["clutch_torque"] * o["slip_speed"]
    energy = np.sum(power[1:] + power[:-1]) / 2 * 1e-3
    assert o["energy"][-1] == pytest.approx(energy, rel=1e-3)
    warmer = o["temp_pack"][-1] - o["temp_pack"][0]
    assert warmer == pytest.approx(o["energy"][-1] / rig()["pack_heat_capacity"], rel=1e-6)


def test_without_slip_the_clutch_winds_up_no_further() -> None:
    o = record(held(12.0, rpm=0.0))
    assert o["pack_force"][-1] > 20e3
    assert abs(o["clutch_torque"][-1]) < 1.0
    assert o["mode"][-1] == plant.MODES.index("locked")


# --- scenarios and effects ---


@pytest.mark.parametrize("scenario", alsd.SCENARIOS)
def test_every_scenario_runs_and_is_the_same_again(scenario: str) -> None:
    a, b = (drive(scenario, duration=2.0) for _ in range(2))
    assert set(a.signals) == set(CAR if scenario in ON_THE_ROAD else RIG)
    for name, (time, value) in a.signals.items():
        assert np.array_equal(value, b.signals[name][1]) and np.all(np.diff(time) > 0)
    other = drive(scenario, seed=2, duration=2.0)
    assert not np.array_equal(a.signals["motor_angle"][0], other.signals["motor_angle"][0])


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_absent_at_zero_and_seen_otherwise(name: str) -> None:
    """Seen in a drive that slips both ways, warms up and has a warm oil."""
    effect = EFFECTS[name]
    gains = {k: v for k, v in effect.parameters.items() if v == 0.0}
    channels = [Channel(n, "M", 0.005) for n in (*CAR, "armature_temp", "clutch_torque")]

    def signals(values: Mapping[str, float]) -> Columns:
        found = simulated(
            rig(), {}, "car", 3, channels, nominal=True, duration=6.0, effects={name: values}
        )
        return {n: value for n, (_, value) in found.signals.items()}

    without, absent = signals({}), signals(dict.fromkeys(gains, 0.0))
    small = {
        "change": 1e-3,
        "growth": 1e-5,
        "rate": 1e-3,
        "resistance": 0.02,
        "offset": 0.01,
        "slope": 0.1,
        "coefficient": 5.0,
    }
    present = signals({key: small[key] for key in gains})
    for column in without:
        assert np.array_equal(without[column], absent[column])
    assert any(not np.allclose(without[n], present[n], rtol=0, atol=1e-9) for n in without)


@pytest.mark.parametrize(
    ("name", "values"),
    [("angle_offset", {"offset": 0.1}), ("motor_friction", {"change": 1.0})],
)
def test_an_effect_begins_within_a_drive(name: str, values: Mapping[str, float]) -> None:
    """Bit by bit the drive without it before its onset, another one after it."""
    without = drive("rig-steps", duration=4.0)
    found = drive("rig-steps", duration=4.0, effects={name: values}, onset=2.5)
    time, angle = found.signals["motor_angle"]
    healthy = without.signals["motor_angle"][1]
    before = time < 2.5
    assert np.array_equal(angle[before], healthy[before])
    assert np.abs(angle - healthy)[~before].max() > 0.05


def test_the_onset_of_an_effect_that_is_none_changes_nothing() -> None:
    """The plant goes on where it was, in every state."""
    whole, cut = (drive("car", duration=3.0, onset=onset) for onset in (0.0, 1.7))
    for name, (_, value) in whole.signals.items():
        assert np.array_equal(value, cut.signals[name][1])
    for name, value in whole.truth.columns.items():
        assert np.array_equal(value, cut.truth.columns[name])


def test_a_pack_worn_at_once_has_the_wider_play_from_then_on() -> None:
    worn = {"free_play_growth": {"growth": 5e-5}}
    truth = drive("rig-steps", duration=4.0, effects=worn, onset=2.0).truth
    free_play = truth.columns["free_play"]
    assert free_play[truth.time > 2.01] - free_play[0] == pytest.approx(5e-5)


def test_wear_widens_the_free_play_with_slip_energy() -> None:
    o = record(held(7.0), {"free_play_growth": {"rate": 0.01}})
    grown = o["free_play"] - rig()["free_play"]
    assert np.allclose(grown, 0.01e-6 * o["energy"], rtol=1e-9, atol=1e-18)


def test_friction_fades_as_the_pack_heats() -> None:
    """Sliding, by the temperature beyond the onset, and not below it."""
    slope, onset = 0.4, 25.5
    o = record(held(12.0), {"friction_fade": {"slope": slope, "onset": onset}})
    slides = o["mode"] == 1.0
    without = rig()["friction_coefficient"] * rig()["friction_surfaces"]
    without = without * rig()["equivalent_radius"] * o["pack_force"][slides]
    hot = np.maximum(o["temp_pack"][slides] - onset, 0.0)
    assert hot[0] == 0.0
    assert hot[-1] > 0.5
    kept = o["clutch_torque"][slides] / without
    np.testing.assert_allclose(kept, 1.0 - slope * hot / 100.0, atol=1e-4)


def test_a_sweep_breaks_slip_and_oil_apart() -> None:
    sampled = drive("slip-oil-sweep")
    (_, slip), (_, oil) = (sampled.signals[n] for n in ("slip_speed", "oil_temp"))
    assert oil.min() < -19.0
    assert oil.max() > 119.0
    pressed = sampled.signals["clutch_torque"][1] > 50.0
    assert slip[pressed].min() < 1.0 * RPM
    assert slip[pressed].max() > 110.0 * RPM
    assert abs(np.corrcoef(np.log(slip[pressed]), oil[pressed])[0, 1]) < 0.3


def test_a_clutch_that_coasts_is_open_and_turns_both_ways() -> None:
    sampled = drive("coast")
    torque, slip = (sampled.signals[n][1] for n in ("clutch_torque", "slip_speed"))
    still = np.abs(torque) < 1.0
    assert np.mean(still) > 0.9
    assert slip[still].min() < -100.0 * RPM
    assert slip[still].max() > 100.0 * RPM


@pytest.mark.parametrize("scenario", ["slip-oil-sweep", "coast"])
def test_the_bus_carries_all_of_a_fast_slip(scenario: str) -> None:
    run = simulate("alsd_rig", scenario, 1, duration=12.0)
    assert not [words for words in run.warnings if "slip_speed" in words]
    assert np.abs(run["slip_speed"].value).max() > 115.0 * RPM


def test_bad_requests_are_refused() -> None:
    with pytest.raises(ClutchestError, match=r"unknown scenario 'rig-step'.*rig-steps"):
        drive("rig-step")
    with pytest.raises(ClutchestError, match="unknown scenario 'foo'; valid: ") as refused:
        drive("foo")
    assert "slip-oil-sweep" in str(refused.value) and "car" not in str(refused.value)
    with pytest.raises(ClutchestError, match="scenario 'car' is for a car"):
        simulated(rig(), {}, "car", 1, [Channel("motor_angle", "M", 0.005)])
    with pytest.raises(ClutchestError, match="onset 3 s: expected 0 to the 2 s"):
        drive("rig-steps", duration=2.0, onset=3.0)
    with pytest.raises(ClutchestError, match="unknown effect 'wear'"):
        drive("rig-steps", duration=1.0, effects={"wear": {}})
    with pytest.raises(ClutchestError, match="parameter 'free_play' is missing"):
        simulated({k: v for k, v in rig().items() if k != "free_play"}, {}, "I1", 1, [])


RECORD = numbers(rig(), complete({}, EFFECTS), 0.11, {})[0]


# --- what the experiments are there to show, by the paper's own estimators ---


def series(sampled: Sampled, name: str) -> NDArray[np.float64]:
    return sampled.signals[name][1]


@cache
def experiment(name: str, duration: float | None = None) -> Sampled:
    return drive(name, duration=duration)


def test_i1_shows_resistance_over_temperature() -> None:
    s = experiment("I1", 300.0)
    time = s.signals["armature_voltage"][0]
    settled = (time % 2.0 > 1.0) & (time > 20)
    ratio = series(s, "armature_voltage")[settled] / series(s, "armature_current")[settled]
    warm = series(s, "armature_temp")[settled] - rig()["armature_reference_temp"]
    slope, level = np.polyfit(warm, ratio, 1)
    assert np.ptp(warm) > 60.0
    assert level == pytest.approx(rig()["armature_resistance"], rel=1e-3)
    assert slope / level == pytest.approx(rig()["resistance_temp_coefficient"], rel=1e-2)


def test_i3_shows_the_voltage_constant() -> None:
    s = experiment("I3", 16.0)
    time, angle = s.signals["motor_angle"]
    found = []
    for k in range(8):
        last = (time > 2 * k + 1.2) & (time < 2 * k + 1.9)
        speed = np.polyfit(time[last], angle[last], 1)[0]
        warm = np.mean(series(s, "armature_temp")[last]) - rig()["armature_reference_temp"]
        R = rig()["armature_resistance"] * (1 + rig()["resistance_temp_coefficient"] * warm)
        drop = np.mean(
            series(s, "armature_voltage")[last] - R * series(s, "armature_current")[last]
        )
        found.append(drop / speed)
    assert np.allclose(found, rig()["back_emf_constant"], rtol=2e-3)


def test_i6_shows_a_loop_shifted_by_the_spring() -> None:
    s = experiment("I6")
    time, angle = s.signals["motor_angle"]
    torque, speed = series(s, "motor_torque"), np.gradient(angle, time)
    inside = (angle > 8.0) & (angle < 25.0)
    up = np.median(torque[inside & (speed > 2.0)])
    down = np.median(torque[inside & (speed < -2.0)])
    ramp = rig()["gear_ratio"] * rig()["ball_ramp_ratio"]
    spring = (up + down) / 2 * ramp
    assert spring == pytest.approx(plant.spring(rig()["spring_preload"] + 2e-4, RECORD), rel=0.05)
    friction = (up - down) / 2 - rig()["motor_coulomb_torque"] - rig()["motor_viscous"] * 4.0
    wanted = (
        rig()["ball_ramp_friction"] * rig()["ball_ramp_bore"] / 2 * spring / rig()["gear_ratio"]
    )
    assert friction == pytest.approx(wanted, rel=0.3)  # the film takes its part


def test_i7_shows_free_play_and_a_second_slope_without_it() -> None:
    s = experiment("I7")
    time, angle = s.signals["motor_angle"]
    torque = series(s, "motor_torque")
    reach = [angle[(time < 11)].max(), angle[(time > 12)].max()]
    # with the output fixed nothing but the ball ramp yields: far less travel at the same torque
    assert reach[1] < 0.5 * reach[0]
    first = (time > 12.0) & (time < 14.6)  # of three ramps
    turn = time[first][np.argmax(torque[first])]
    up = first & (time < turn) & (torque > 0.2)
    down = first & (time > turn) & (torque > 0.03) & (torque < 0.13)  # bristles have turned
    slopes = [np.polyfit(angle[way], torque[way], 1)[0] for way in (up, down)]
    assert slopes[0] > slopes[1] * 1.3  # k (1 ± ρ)
    stiffness = np.mean(slopes) * rig()["gear_ratio"] ** 2
    # bristles that lag behind a growing level flatten both slopes a little
    assert stiffness == pytest.approx(rig()["ball_ramp_stiffness"], rel=0.08)


def test_i8_shows_the_torsional_stiffness() -> None:
    s = experiment("I8")
    time, angle = s.signals["drive_angle"]
    torque = series(s, "drive_torque")
    loaded = (time > 2.0) & (torque > 60)
    compliance = np.polyfit(torque[loaded], angle[loaded], 1)[0]  # the angle rings, not the torque
    stiffness = rig()["final_drive_ratio"] ** 2 / compliance
    assert stiffness == pytest.approx(rig()["torsional_stiffness"], rel=0.05)


def test_the_servo_torque_acts_when_it_is_recorded() -> None:
    """In contact J_2 dω_m2/dt + σ_0.c dz(α_m2/K_g2, α_b2)/K_g2 + T_f2 is the torque of that time:
    20 µs off, it would seem to be less friction."""
    profile = held(15.0, 3.0)
    time = np.arange(len(profile)) * 1e-3
    turn = np.maximum(time - 1.0, 0.0) * np.pi
    profile["drive"], profile["driven"] = plant.TORQUE, 250.0 * np.sin(turn)
    o, p = record(profile), rig()
    angle = o["drive_angle"]
    steps = (angle[4:] + angle[:-4], angle[3:-1] + angle[1:-3], angle[2:-2])
    bent = (-steps[0] + 16.0 * steps[1] - 30.0 * steps[2]) / 12.0 / 1e-6
    ratio = p["final_drive_ratio"]
    twist = angle[2:-2] / ratio - p["differential_backlash"]
    left = o["servo_torque"][2:-2] - p["structure_inertia"] * bent - p["driveline_friction"]
    left -= p["torsional_stiffness"] * twist / ratio
    speed = np.gradient(angle, 1e-3)[2:-2]
    loading = (time[2:-2] > 1.2) & (time[2:-2] < 1.5) & (speed > 0.05)
    rate = 250.0 * np.pi * np.cos(turn[2:-2])
    late = np.sum((left * rate)[loading]) / np.sum((rate**2)[loading])
    assert loading.sum() > 50 and abs(late) < 0.2 * plant.STEP


def test_it_knows_the_effects_of_the_models_library() -> None:
    known = machine_of("alsd").effects
    assert set(EFFECTS) == set(known)
    for name, effect in known.items():
        assert set(EFFECTS[name].parameters) == {n.key for n in effect.parameters}
        assert EFFECTS[name].one_sided == all(n.one_sided for n in effect.gains)


def test_what_sticks_holds_as_much_as_what_slides_in_every_specimen():
    """The two spreads know nothing of each other: drawn alone, one in forty would not."""
    spreads = {key: value.spread for key, value in load_vehicle("alsd_rig").parameters.items()}
    drawn = [draw(rig(), spreads, seed) for seed in range(400)]
    over = [each["motor_static_torque"] - each["motor_coulomb_torque"] for each in drawn]
    assert min(over) == 0.0 and np.median(over) > 0.0
