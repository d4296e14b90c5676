from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.signals import Signals
from clutchest.simulated import simulate, simulate_frames, write_simulation
from clutchest.vehicle import load_vehicle


@pytest.fixture(scope="module")
def drive(truck) -> Signals:
    return simulate(truck, "launches", 3, nominal=True, duration=60.0)


def test_what_comes_back_is_the_truth_with_the_stated_noise(drive: Signals, truck) -> None:
    truth = drive.truth
    assert truth is not None
    assert set(drive) == set(truck.signals)
    assert drive.warnings == () and drive.counts.rejected == {}
    assert drive.counts.frames == drive.counts.decoded
    steps = {
        "engine_speed": 0.125 * np.pi / 30,
        "slave_position": 0.001,
        "engine_torque": 0.00125 * 3500,
    }
    for name, step in steps.items():
        signal = drive[name]
        error = signal.value - np.interp(signal.time, truth.time, truth.columns[name])
        expected = np.hypot(truck.signals[name].noise, step / np.sqrt(12))
        assert np.std(error) == pytest.approx(expected, rel=0.1), name
        assert abs(np.mean(error)) < 0.3 * expected, name


def test_values_are_whole_steps_of_the_bus(drive: Signals) -> None:
    raw = drive["engine_speed"].value * 30 / np.pi / 0.125
    assert np.max(np.abs(raw - np.rint(raw))) < 1e-6
    percent = drive["engine_torque"].value / 3500 * 100 / 0.125
    assert np.max(np.abs(percent - np.rint(percent))) < 1e-6
    assert np.min(drive["engine_torque"].value) < 0, "the split must hold below zero too"


def test_the_same_seed_gives_the_same_drive(truck, drive: Signals) -> None:
    copy = simulate(truck, "launches", 3, nominal=True, duration=60.0)
    other = simulate(truck, "launches", 4, nominal=True, duration=60.0)
    for name in ("engine_speed", "slave_position"):
        assert np.array_equal(copy[name].value, drive[name].value)
        assert not np.array_equal(other[name].value[:1000], drive[name].value[:1000])
    assert other.start_ns > drive.start_ns


def test_an_effect_of_the_file_and_one_asked_for_both_act(truck, drive: Signals) -> None:
    worn = replace(truck, effects={"wear": {"amount": 0.5}})
    both = simulate(
        worn, "launches", 3, {"position_offset": {"offset": 0.2}}, nominal=True, duration=60.0
    )
    assert drive.truth and both.truth
    lower = drive.truth.columns["zero_position"] - both.truth.columns["zero_position"]
    assert lower == pytest.approx(0.5, abs=1e-9)
    retracted = (drive["motor_position"].value < 0.3) & (both["motor_position"].value < 0.3)
    shift = (both["slave_position"].value - drive["slave_position"].value)[retracted]
    assert np.median(shift) == pytest.approx(0.2 - 0.5, abs=0.02)


def test_outliers_and_coloured_noise_are_passed_on(truck, drive: Signals) -> None:
    rough = simulate(truck, "launches", 3, nominal=True, duration=60.0, outliers=0.01)
    differs = rough["slave_position"].value != drive["slave_position"].value
    assert 0.005 < differs.mean() < 0.02
    slow = simulate(truck, "launches", 3, nominal=True, duration=60.0, noise_ar=0.95)
    assert slow.truth
    position, truth = slow["slave_position"], slow.truth
    error = position.value - np.interp(position.time, truth.time, truth.columns["slave_position"])
    assert np.corrcoef(error[1:], error[:-1])[0, 1] > 0.85


@pytest.mark.parametrize("suffix", [".log", ".csv", ".parquet"])
def test_written_logs_read_back_with_the_truth_on_their_clock(
    tmp_path: Path, truck, drive: Signals, suffix: str
) -> None:
    import pyarrow.parquet as pq

    path = tmp_path / f"drive{suffix}"
    truth_path = write_simulation(path, truck, "launches", 3, nominal=True, duration=60.0)
    signals = read_log(path, truck)
    for name in drive:
        assert np.array_equal(signals[name].value, drive[name].value), name
        assert signals[name].time == pytest.approx(drive[name].time, abs=1e-6), name
    assert truth_path == tmp_path / f"drive{suffix}.truth.parquet"
    table = pq.read_table(truth_path)
    assert {"time", "clutch_torque", "mode", "temp_disc", "zero_position"} <= set(
        table.column_names
    )
    assert drive.truth
    assert np.array_equal(table["temp_disc"].to_numpy(), drive.truth.columns["temp_disc"])
    about = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert (about["scenario"], about["seed"], about["vehicle"]) == ("launches", "3", "truck")
    assert json.loads(about["parameters"])["kiss_point"] == 6.51


def test_frames_and_truth_share_their_first_moment(truck) -> None:
    frames, truth = simulate_frames(truck, "closed", 1, duration=5.0)
    assert np.all(np.diff(frames.t_ns) >= 0)
    assert 0 <= truth.time[0] < 0.02
    assert truth.time[-1] == pytest.approx((frames.t_ns[-1] - frames.t_ns[0]) / 1e9, abs=0.03)


def test_different_drives_never_share_a_clock(truck, tmp_path: Path) -> None:
    for seed in (1, 2):
        write_simulation(tmp_path / f"{seed}.log", truck, "closed", seed, duration=5.0)
    signals = read_log([tmp_path / "1.log", tmp_path / "2.log"], truck)
    assert len(signals.drives) == 2


def test_a_vehicle_on_wheels_goes_through_its_gears_and_back(truck) -> None:
    shaft = replace(truck.signals["input_shaft_speed"], gears=(3.0, 2.0))
    vehicle = replace(truck, signals={**truck.signals, "input_shaft_speed": shaft})
    signals = simulate(vehicle, "launches", 3, nominal=True, duration=60.0)
    assert signals.truth
    speed = signals["input_shaft_speed"]
    truth = np.interp(speed.time, signals.truth.time, signals.truth.columns["input_shaft_speed"])
    assert np.max(np.abs(speed.value - truth)) < 1.0


def test_what_cannot_be_simulated_is_told(truck) -> None:
    with pytest.raises(ClutchestError, match="unknown scenario 'cty'; did you mean 'city'"):
        simulate(truck, "cty", 0)
    with pytest.raises(ClutchestError, match="unknown effect 'waer'; did you mean 'wear'"):
        simulate(truck, "closed", 0, {"waer": {"amount": 1.0}}, duration=1.0)
    with pytest.raises(
        ClutchestError,
        match=r"gt350\.toml: no such DBC.*; the heading of .*gt350\.toml says whose it is",
    ):
        simulate(load_vehicle("gt350"), "closed", 0, duration=1.0)
