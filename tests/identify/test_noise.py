"""Noise and delays of a user's own log, as the verb and as a library."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import binomtest

import clutchest
from clutchest import cli
from clutchest.identify import delay, identify_vehicle, sensor_noise
from clutchest.identify.window_likelihood import table, toeplitz_row
from clutchest.models import delay_relations
from clutchest.models.delay_relations import DelayStretch, GriddedSignals
from clutchest.signals import Signal, Signals


def ar1(n: int, ar: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(n)
    for k in range(1, n):
        noise[k] = ar * noise[k - 1] + np.sqrt(1 - ar**2) * noise[k]
    return noise


def read(value: np.ndarray, period: float = 0.01) -> Signal:
    return Signal.of("x", "", np.arange(len(value)) * period, value)


def test_likelihood_is_that_of_the_samples_that_are_there():
    """Second differences and integrated holes against the normal density of the plain samples."""
    n, walk = 12, 0.3
    rng = np.random.default_rng(1)
    cov = 0.7 ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    steps = np.cumsum(np.cumsum(np.eye(n), axis=0), axis=0)
    cov = cov + walk**2 * steps @ steps.T
    line = np.column_stack([np.ones(n), np.arange(n)])
    windows = rng.standard_normal((3, n))
    holes = np.zeros((3, n), bool)
    holes[1, 4], holes[2, [0, 5, 6]] = True, True

    def direct(y, hole):
        x, s = line[~hole], cov[np.ix_(~hole, ~hole)]
        inverse = np.linalg.inv(s)
        middle = np.linalg.inv(x.T @ inverse @ x)
        projected = inverse - inverse @ x @ middle @ x.T @ inverse
        logs = np.linalg.slogdet(s)[1] + np.linalg.slogdet(x.T @ inverse @ x)[1]
        return y[~hole] @ projected @ y[~hole] + logs

    second = np.ascontiguousarray(np.diff(windows, 2, axis=1).T)
    fast = table(toeplitz_row(0.7 ** np.arange(float(n))), np.array([walk]), second, holes)[:, 0]
    slow = np.array([direct(y, hole) for y, hole in zip(windows, holes, strict=True)])
    constant = fast[0] - slow[0]
    np.testing.assert_allclose(fast - slow, constant, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("ar", [0.0, 0.9])
def test_noise_of_a_signal_that_wanders_and_is_rounded(ar):
    n, step = 24 * sensor_noise.WINDOW, 0.2
    course = 3 * np.sin(np.arange(n) / 900) + np.arange(n) * 1e-3
    inside = []
    for seed in range(5):
        value = step * np.rint((course + ar1(n, ar, seed)) / step)
        value[seed::97] += 12.0  # far off
        found = sensor_noise.estimate(sensor_noise.windows_of([read(value)]), step)
        reach = 1.96 * np.sqrt(np.diag(found.covariance))
        inside += [
            abs(np.log(found.noise)) < reach[0],
            abs(np.arctanh(found.ar) - np.arctanh(ar)) < reach[1],
        ]
    assert binomtest(sum(inside), len(inside)).proportion_ci(0.99).high >= 0.95


def test_a_sensor_that_sits_in_one_step_shows_only_rounding():
    value = np.where(np.arange(4000) < 1700, 85.0, 86.0)
    found = sensor_noise.estimate(sensor_noise.windows_of([read(value)]), 1.0)
    assert found.noise < sensor_noise.BELOW_STEP
    assert 1 / np.sqrt(12) <= found.total < 1.3 / np.sqrt(12)


def test_what_moves_all_the_time_is_not_said_to_be_hidden_by_rounding():
    """A motor that steps once in two seconds, its angle sampled at 100 Hz: what the angle does in
    every window passes for all of its noise, twenty times the step's."""
    drive = clutchest.simulate("alsd_rig", "rig-steps", 3, duration=30.0)
    slow = drive["motor_angle"].take(np.arange(0, len(drive["motor_angle"]), 2))
    log = replace(drive, signals={**drive.signals, "motor_angle": slow})
    found = clutchest.identify("noise", log, "alsd_rig").parameters["signals.motor_angle.noise"]
    assert not found.determined and "too little of the log is quiet" in found.why


def test_readings_cut_off_at_zero_are_left_out():
    noise = np.random.default_rng(2).standard_normal(4000)
    value = np.concatenate([np.maximum(noise[:2000], 0.0), 40 + noise[2000:]])
    windows = sensor_noise.windows_of([read(value)])
    assert len(windows) and windows.values.min() > 30


def test_a_window_is_chosen_by_its_neighbours():
    windows = sensor_noise.Windows(np.zeros((6, sensor_noise.WINDOW)), np.array([0, 1, 2, 3, 5, 6]))
    flag = np.array([True, False, True, True, True, True])
    assert windows.between(flag).tolist() == [False, True, False, False, False, False]


def test_gaps_and_a_clock_that_stutters_do_not_break_it():
    noise = np.random.default_rng(3).standard_normal(6000)
    time = np.cumsum(np.random.default_rng(4).uniform(0.006, 0.014, 6000))
    time[3000:] += 5000.0
    found = sensor_noise.estimate(sensor_noise.windows_of([Signal.of("x", "", time, noise)]), 0.0)
    assert found.noise == pytest.approx(1.0, abs=0.05)


def test_delay_and_its_error():
    late, errors = 0.037, []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        time = np.arange(0, 60, 0.01)
        cause = np.convolve(rng.standard_normal(len(time)), np.hanning(60), mode="same")
        effect = 2 * np.interp(time - late, time, cause) + rng.standard_normal(len(time))
        stretches = []
        for a in range(100, 5800, 400):
            rows = np.arange(a, a + 300, 5)

            def columns(tau, rows=rows, cause=cause, effect=effect, time=time):
                shifted = np.interp(time[rows] - tau, time, cause)
                return effect[rows], np.column_stack([np.ones(len(rows)), shifted])

            stretches.append(DelayStretch(columns))
        found = delay.estimate(stretches)
        errors.append((found.value - late) / found.std)
    assert abs(np.mean(errors)) < 3 / np.sqrt(20)
    assert 0.5 < np.std(errors) < 1.6


def test_noise_by_itself_favours_no_delay():
    """Between two rows of the grid it must be as large as on them."""
    step = delay_relations.STEP
    time = np.arange(0, 100, step)
    noise = gaussian_filter1d(ar1(len(time), 0.0, 1), delay_relations.SMOOTH / step)
    rows = np.arange(200, len(time) - 200, 2)
    drive = GriddedSignals({}, {}, time, np.zeros(len(time), np.uint8))
    columns = drive.stretch(rows, 0 * noise, noise, []).columns
    on, between = (float(np.var(columns(tau)[0])) for tau in (0.0, step / 2))
    assert between == pytest.approx(on, rel=3e-3)  # straight lines: 2 % less


def test_too_few_stretches_are_no_delay():
    assert delay.estimate([]) is None


def test_unknown_procedure():
    truck, nothing = clutchest.load_vehicle("truck"), Signals({}, end=0.0)
    with pytest.raises(clutchest.ClutchestError, match="did you mean 'noise'"):
        identify_vehicle("nois", nothing, truck, lambda text, share: None)
    rig = clutchest.load_vehicle("alsd_rig")
    with pytest.raises(clutchest.ClutchestError, match="'torque-curve'; valid: I1, "):
        identify_vehicle("torque-curve", nothing, rig, lambda text, share: None)


def test_a_short_log_determines_nothing_and_keeps_the_file():
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "city", 1, duration=1.0)
    fit = identify_vehicle("noise", signals, truck, lambda text, share: None)
    assert fit.vehicle == truck
    assert not any(f.determined for f in fit.parameters.values())
    assert all(f.why for f in fit.parameters.values())


@pytest.mark.slow
def test_the_verb(tmp_path, monkeypatch, capsys):
    log, out = tmp_path / "d.csv", tmp_path / "out"
    truck = clutchest.load_vehicle("truck")
    loud = {n: replace(m, noise=3 * m.noise) for n, m in truck.signals.items()}
    from clutchest.simulated import write_simulation

    write_simulation(log, replace(truck, signals=loud), "launches", 2, duration=60.0)
    line = ["clutchest", "identify", "noise", str(log), "--vehicle", "truck", "--out", str(out)]
    monkeypatch.setattr(sys, "argv", [*line, "--json"])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert not end.value.code
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((out / "fit.json").read_text(encoding="utf-8"))
    assert (out / "noise.png").stat().st_size > 10_000
    tuned = clutchest.load_vehicle(out / "vehicle.toml")
    assert replace(tuned, signals=truck.signals) == truck
    speed = printed["parameters"]["signals.engine_speed.noise"]
    assert speed["determined"] and speed["low"] < 0.18 < speed["high"]
    assert tuned.signals["engine_speed"].noise == speed["value"]
    late = printed["parameters"]["signals.coolant_temp.delay"]
    assert not late["determined"] and late["value"] == 0.0 and late["why"]
