"""What the differential's experiments are made of: polynomials, plateaus, pre-sliding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

import clutchest
from clutchest.identify.bench_records import bench_records
from clutchest.models.alsd.experiments import armature_heat, path_torque, torsion
from clutchest.models.alsd.experiments.break_away import BreakAway, break_aways
from clutchest.models.alsd.experiments.motion import (
    Polynomial,
    local_polynomial,
    second_derivative_std,
    window_means,
)
from clutchest.models.alsd.experiments.motor_runs import NODES, FrictionRun, friction, runs
from clutchest.models.alsd.experiments.plateaus import centre, plateaus, speed
from clutchest.models.alsd.experiments.torque_constant import torque_constant
from clutchest.models.experiments import BenchRecord
from clutchest.signals import Floats, Signal
from clutchest.vehicle import load_vehicle

RNG = np.random.default_rng(5)
RIG = {key: p.value for key, p in load_vehicle("alsd_rig").parameters.items()}


def signal(time, value) -> Signal:
    return Signal.of("s", "1", np.asarray(time), np.asarray(value))


def test_local_polynomials_are_exact_on_polynomials():
    time = np.sort(RNG.uniform(0.0, 1.0, 60))
    found = local_polynomial(time, 2.0 - 3.0 * time + 5.0 * time**2 - time**3, 7, 3)
    slope, bend = -3.0 + 10.0 * time - 3.0 * time**2, 10.0 - 6.0 * time
    assert found[:, 1] == pytest.approx(slope, rel=1e-6, abs=1e-6)
    assert found[:, 2] == pytest.approx(bend, rel=1e-4, abs=1e-3)
    with pytest.raises(ValueError, match="fewer samples"):
        local_polynomial(time[:5], time[:5], 7, 3)


def test_the_noise_of_a_second_derivative_is_known():
    time = 0.01 * np.arange(20_001)
    found = local_polynomial(time, RNG.standard_normal(len(time)), 7, 4)[10:-10, 2]
    assert np.std(found) == pytest.approx(second_derivative_std(0.01, 7, 4), rel=0.05)


def test_a_polynomial_has_the_covariance_of_its_derivatives():
    time, true = np.linspace(1.0, 2.0, 80), lambda t: 3.0 * t**4
    nodes = np.array([1.2, 1.7])
    random, tries = np.random.default_rng(7), []
    for _ in range(400):
        noisy = signal(time, true(time) + random.standard_normal(len(time)))
        value, covariance = Polynomial.through(noisy, 1.0, 2.01, 5).derivative(nodes, 2)
        tries.append(value - 36.0 * nodes**2)
    # of so many tries an entry of a covariance has a standard deviation of its own
    variance = np.diag(covariance)
    off = np.sqrt((np.multiply.outer(variance, variance) + covariance**2) / 400)
    assert np.all(np.abs(np.cov(np.array(tries).T) - covariance) < 4.0 * off)
    assert np.mean(tries, axis=0) == pytest.approx(0.0, abs=4 * np.sqrt(covariance.max() / 400))


def test_window_means_are_moved_to_the_middle():
    time = np.arange(0.0031, 2.0, 0.005)
    value, count = window_means(signal(time, 7.0 * time), np.arange(0.0, 1.9, 0.02))
    assert value == pytest.approx(7.0 * (np.arange(len(value)) + 0.5) * 0.02)
    assert set(count) <= {3.0, 4.0, 5.0}
    holes, _ = window_means(signal([0.0, 1.0], [1.0, 2.0]), np.array([0.0, 0.4, 0.8]))
    assert np.isnan(holes[1])


def test_plateaus_lie_between_jumps():
    time = np.arange(0.0, 6.0, 0.01)
    level = np.where(time < 2.0, 1.0, np.where(time < 4.5, 3.0, 2.0))
    noisy = signal(time, level + 0.01 * RNG.standard_normal(len(time)))
    record = BenchRecord("", {"u": noisy}, {"u": 0.01}, {"u": 0.0}, {})
    spans = plateaus(record, ["u"], 0.1, 1.6)
    assert np.array(spans) == pytest.approx(np.array([(0.1, 1.99), (2.1, 4.49)]))
    value, count = centre(noisy, *spans[1])
    assert value == pytest.approx(3.0, abs=0.003) and count == 239
    assert record.std_of_mean("u", 100) == pytest.approx(0.001)
    slope, std = speed(signal(time, 4.0 * time), 1.0, 2.0)
    assert slope == pytest.approx(4.0) and 0.2 < std < 0.5


def test_neighbouring_equations_of_i8_share_the_noise_of_their_angles():
    """What is whitened has the unit matrix for its covariance, found here from the polynomials
    themselves; rows with gaps, as reversals leave them."""
    time = np.cumsum(RNG.uniform(0.0049, 0.0051, 30))
    rows = np.array([2, 3, 4, 5, 6, 9, 11, 12, 20, 21, 24])
    sensors = {"drive_torque": 0.5, "drive_angle": 2e-5}
    record = BenchRecord("rig", {}, sensors, {}, RIG)
    noise = torsion._noise(record, time, rows)
    per_angle = np.zeros((len(rows), len(time)))
    for k in range(len(time)):
        impulse = np.eye(len(time))[k]
        value, _, bent = local_polynomial(time, impulse, torsion.WINDOW, torsion.ORDER)[rows].T
        elastic = RIG["torsional_stiffness"] / RIG["final_drive_ratio"] ** 2 * value
        per_angle[:, k] = RIG["structure_inertia"] * bent + elastic
    covariance = 0.5**2 * np.eye(len(rows)) + 2e-5**2 * per_angle @ per_angle.T
    root = np.stack([noise.whitened(column, RIG) for column in np.eye(len(rows))], axis=1)
    assert root @ covariance @ root.T == pytest.approx(np.eye(len(rows)), abs=1e-9)
    assert np.abs(covariance[0, 1]) > 0.3 * covariance[0, 0]  # and they do share it


def lugre(rate: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    """Torque and angle of the full friction model, (3) to (5), under a torque that rises evenly."""
    p, step, z, x, w = RIG, 2e-6, 0.0, 0.0, 0.0
    torque, angle = [], []
    for k in range(int(until / step)):
        over = p["motor_static_torque"] - p["motor_coulomb_torque"]
        bent = (w / p["motor_stribeck_speed"]) ** 2
        level = p["motor_coulomb_torque"] + over * np.exp(-bent)
        dz = w - p["motor_bristle_stiffness"] * abs(w) * z / level
        friction = p["motor_bristle_stiffness"] * z + p["motor_bristle_damping"] * dz
        friction += p["motor_viscous"] * w
        z, x = z + step * dz, x + step * w
        w += step / p["motor_inertia"] * (rate * k * step - friction)
        torque.append(rate * k * step)
        angle.append(x)
    return np.array(torque)[::5000], np.array(angle)[::5000]


def test_the_pre_sliding_curve_is_that_of_the_full_model():
    """To the break-away itself, where the motor has turned nearly three times as far as by bristles
    that do not yield."""
    rate = 0.05
    torque, angle = lugre(rate, 0.33)
    empty = np.zeros(0)
    rise = BreakAway(empty, empty, empty, empty, (1.0, 1.0), 25.0, np.zeros((3, 2)))
    assert torque[-1] >= RIG["motor_static_torque"]
    assert angle[-1] > 2.8 * RIG["motor_static_torque"] / RIG["motor_bristle_stiffness"]
    late = torque > 0.1 * torque[-1]
    assert rise.bend(RIG, torque, rate)[late] == pytest.approx(angle[late], rel=1e-3)
    assert rise.bend(RIG, -torque, -rate) == pytest.approx(-rise.bend(RIG, torque, rate))


def test_where_a_rise_of_the_current_begins_is_not_chosen_by_its_noise():
    """A current of 0.3 A/s, its noise drawn six hundred times: readings that are known not to be
    zero are too large, and the slope through them was a quarter of its deviation too small."""
    time = np.arange(0.0, 2.6, 0.005)
    rising = np.maximum(0.3 * (time - 1.0), 0.0)
    angle = signal(time, np.maximum(60.0 * (time - 2.4), 0.0))
    noise = {"armature_current": 0.03, "motor_angle": 2e-3, "armature_temp": 0.5}
    random, off = np.random.default_rng(11), []
    for _ in range(600):
        noisy = signal(time, rising + 0.03 * random.standard_normal(len(time)))
        signals = {"motor_angle": angle, "armature_current": noisy, "armature_temp": angle}
        record = BenchRecord("motor-alone", signals, noise, dict.fromkeys(noise, 0.0), RIG)
        for rise in break_aways(record):
            since = rise.current_time - rise.current_time.mean()
            off.append((rise.own[2, 0] - 0.3) * np.sqrt(np.sum(since**2)) / 0.03)
    assert len(off) > 500
    assert np.mean(off) == pytest.approx(0.0, abs=3.5 / np.sqrt(len(off)))


@pytest.mark.parametrize("measured", [True, False], ids=["voltage", "no voltage"])
def test_a_run_whose_current_the_supply_no_longer_holds_is_none(measured):
    """Of a specimen with little friction: its fastest runs meet the limit of the voltage halfway,
    where no polynomial follows the speed; the slow ramp at the end goes up and down."""
    rig = load_vehicle("alsd_rig")
    changed = {"motor_viscous": 1.7e-4, "torque_constant": 0.0407}
    p = {k: replace(v, value=changed.get(k, v.value)) for k, v in rig.parameters.items()}
    vehicle = replace(rig, parameters=p)
    log = clutchest.simulate(vehicle, "I5", 3, nominal=True)
    record = bench_records(log, vehicle).records[0]
    if not measured:
        kept = {k: s for k, s in record.signals.items() if k != "armature_voltage"}
        record = replace(record, signals=kept)
    found = list(runs(record))
    assert len(found) > 15
    most = max(float(np.sum(run.white_errors(record.parameters) ** 2)) for run in found)
    assert most < chi2.isf(1e-3 / len(found), len(NODES))


def test_the_reset_springs_stiffness_is_the_slope_of_its_force():
    numbers = np.array([tuple(RIG[key] for key in path_torque.KEYS)], path_torque._NUMBERS)[0]
    assert path_torque.spring(0.0, numbers)[0] == 0.0
    for s in (1e-4, 5e-4, 2e-3):
        low, high = (path_torque.spring(s + d, numbers)[0] for d in (-1e-8, 1e-8))
        assert path_torque.spring(s, numbers)[1] == pytest.approx((high - low) / 2e-8, rel=1e-6)


@pytest.mark.parametrize("bench", path_torque.BENCH_NUMBERS)
def test_turning_evenly_within_the_play_takes_the_motors_own_friction(bench):
    """Of a bristle that bends towards its level, and of the oil; nothing behind the play yet."""
    time = np.arange(0.0, 0.5, 0.01)
    speed = 0.5 * RIG["gear_backlash"] * RIG["gear_ratio"] / time[-1]
    motion = np.stack([speed * time, np.full(len(time), speed), np.zeros(len(time))], axis=1)
    numbers = np.array([tuple(RIG[key] for key in path_torque.KEYS)], path_torque._NUMBERS)[0]
    torque = np.empty(len(time))
    path_torque.along(time, motion, path_torque.BENCH_NUMBERS[bench], numbers, 0.0, torque)
    over = RIG["motor_static_torque"] - RIG["motor_coulomb_torque"]
    slow = (speed / RIG["motor_stribeck_speed"]) ** RIG["motor_stribeck_exponent"]
    level = RIG["motor_coulomb_torque"] + over * np.exp(-slow)
    straight = np.exp(-RIG["motor_bristle_stiffness"] * motion[-1, 0] / level)
    damping = RIG["motor_bristle_damping"] * straight + RIG["motor_viscous"]
    assert torque[-1] == pytest.approx(level * (1.0 - straight) + damping * speed, rel=1e-9)


def test_an_armature_ends_where_loss_and_conductance_balance():
    temp = np.empty(4000)
    rise, decay, oil, loss = np.array([1e-3, 4e-6]), 0.01, np.full(4000, 60.0), np.full(4000, 50.0)
    armature_heat._heated(20.0, rise, decay, oil, loss, temp)
    balance = (rise[0] * 50.0 + decay * 60.0) / (decay - rise[1] * 50.0)
    assert temp[0] == 20.0 and temp[-1] == pytest.approx(balance, rel=1e-9)


def test_an_output_held_off_its_rest_moves_the_contact():
    """By K_br d: the motor meets the ball ramp so much later."""
    time = np.linspace(0.0, 2.0, 2001)
    angle = 2.0 * time
    motion = np.column_stack([angle, np.full(len(time), 2.0), np.zeros(len(time))])
    numbers = np.array([tuple(RIG[key] for key in path_torque.KEYS)], path_torque._NUMBERS)[0]
    contact = []
    for held in (0.0, 2e-6):
        torque = np.empty(len(time))
        path_torque.along(time, motion, path_torque.OUTPUT_FIXED, numbers, held, torque)
        free = torque[(angle > 0.05) & (angle < 0.15)].mean()
        contact.append(angle[np.argmax(torque > free + 1e-3)] / RIG["gear_ratio"])
    later = RIG["ball_ramp_ratio"] * 2e-6
    assert contact[1] - contact[0] == pytest.approx(later, abs=2e-4)


def test_noise_of_the_acceleration_makes_no_smaller_inertia():
    """Runs whose accelerations are off by a quarter: by a variance that stays as it is where the
    inertia changes, the inertia would be 6 % too small, eight standard deviations."""
    random, loud, quiet, runs = np.random.default_rng(5), 600.0, 1e-3, []
    for _ in range(500):
        true, speed = random.uniform(-4000.0, 4000.0, 4), random.uniform(100.0, 200.0, 4)
        torque = friction(RIG, speed) + RIG["motor_inertia"] * true
        current = torque / torque_constant(RIG, np.array(60.0)) + quiet * random.standard_normal(4)
        read = true + loud * random.standard_normal(4)
        spread = np.eye(4) * loud**2, np.eye(4) * quiet**2
        runs.append(FrictionRun(speed, read, current, 60.0, *spread))

    def errors(share: Floats) -> Floats:
        changed = RIG | {"motor_inertia": float(share[0]) * RIG["motor_inertia"]}
        return np.concatenate([run.white_errors(changed) for run in runs])

    found = least_squares(errors, [0.9])
    std = float(np.linalg.inv(found.jac.T @ found.jac)[0, 0]) ** 0.5
    assert std < 0.01
    assert abs(found.x[0] - 1.0) < 3.0 * std
