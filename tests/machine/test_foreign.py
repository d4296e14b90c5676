"""The examples of others' machines: their files, records of their layout, and the real ones."""

from __future__ import annotations

import json
import os
import re
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from clutchest.discovery.holdout_gain import BLOCK, FEWEST, LEAST, block_length
from clutchest.discovery.segmentation import segmented
from clutchest.errors import ClutchestError
from clutchest.estimate.drive_setup import DriveSetup
from clutchest.identify.fitted_machine import FittedMachine
from clutchest.identify.likelihood import problem_of
from clutchest.reading import read_log
from clutchest.vehicle import load_vehicle
from foreign_machines import MACHINES, VEHICLES, module, vehicle

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "foreign"

measured = pytest.mark.skipif(not REAL.is_dir(), reason=f"no measured records in {REAL}")


def result_of(machine: str, data: Path, out: Path) -> dict:
    """What the folder's run.py writes."""
    command = [sys.executable, str(MACHINES / machine / "run.py"), str(data), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ})
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads((out / "result.json").read_text())


@pytest.fixture(scope="module")
def made_up(tmp_path_factory) -> Path:
    """Short records in the layouts of EMPS and tanks."""
    folder = tmp_path_factory.mktemp("made_up")
    module("tanks", "generate").generate(folder, seed=1, count=128)
    module("emps", "generate").generate(folder, seed=1, duration=3.0)
    return folder


@pytest.mark.parametrize("machine", VEHICLES)
def test_every_machine_states_the_regimes_longest_steps(machine):
    """A machine with regimes, none of which is sliding, has one longest step for each."""
    car = vehicle(machine)
    model = car.machine.equations(car.machine.units)
    flags, _, longest = DriveSetup(car, model, 1.0, {}).tables
    assert len(longest) == len(flags)
    assert set(longest) <= set(model.longest)


def test_the_tanks_record_becomes_a_table_that_holds_the_pump(made_up, tmp_path):
    paths = module("tanks", "convert").convert(made_up, tmp_path)
    table = pd.read_parquet(paths[0])
    assert table["level"].count() == 128
    assert len(table) == 2 * 128
    held = table["pump"].to_numpy().reshape(-1, 2)
    assert np.array_equal(held[:, 0], held[:, 1])
    signals = read_log(paths, vehicle("tanks"))
    assert len(signals.drives) == 2


def test_readings_at_the_level_sensors_end_do_not_count(made_up, tmp_path):
    """Nor do they part the record, and the level is judged there all the same."""
    convert = module("tanks", "convert")
    path = convert.convert(made_up, tmp_path)[0]
    table = pd.read_parquet(path)
    full = table["level"].notna() & table["time"].between(100.0, 180.0)
    table.loc[full, "level"] = 10.0
    table.to_parquet(path, index=False)
    signals = read_log([path], vehicle("tanks"))
    count = (table["level"] <= 9.99).sum()
    assert signals["level"].valid.sum() == count <= 128 - full.sum() == 107
    assert len(segmented(signals, vehicle("tanks")).drives) == 1
    ends = convert.with_ends(signals)["level"].value
    np.testing.assert_allclose(ends, table["level"].dropna(), rtol=0.0, atol=0.01)


def test_a_slow_machine_must_state_its_gap(made_up, tmp_path):
    paths = module("tanks", "convert").convert(made_up, tmp_path)
    for name in ("tanks.py", "tanks.toml"):
        text = (MACHINES / "tanks" / name).read_text().replace("gap = 200\n", "gap = 3.95\n")
        (tmp_path / name).write_text(text)
    car = load_vehicle(tmp_path / "tanks.toml", trust=True)
    with pytest.raises(
        ClutchestError, match=r"every 4 s, expected .* every 3.95 s \(\[modes\] gap\)"
    ):
        FittedMachine.of(read_log(paths[:1], car), car)


def test_the_tanks_are_simulated_from_the_start(made_up, tmp_path):
    """Without a reading that renews them, what is predicted is a simulation."""
    car = vehicle("tanks")
    paths = module("tanks", "convert").convert(made_up, tmp_path)
    own, other = (read_log([path], car) for path in paths)
    fitted = FittedMachine.of(own, car)
    [known], [new] = fitted.predicted(own, "level"), fitted.predicted(other, "level")
    record = pd.read_csv(made_up / "cascaded_tanks.csv")
    assert known.measured == pytest.approx(record["yEst"][record["yEst"] <= 9.99])
    assert new.measured == pytest.approx(record["yVal"][record["yVal"] <= 9.99])
    assert np.std(known.error) < 0.7 * np.std(known.measured)
    assert set(fitted.numbers) == {"pump_gain", "outlet_upper", "outlet_lower"}


def test_the_carriage_moves_by_its_filtered_force(made_up, tmp_path):
    """Position and force pass one filter: the balance of forces holds at 100 Hz."""
    paths = module("emps", "convert").convert(made_up, tmp_path)
    table = pd.read_parquet(paths[0])
    moving = table["speed"] > 0.02
    change = np.gradient(table["speed"], table["time"])
    made = 95.0 * change + 180.0 * table["speed"] + 20.0 - 3.0
    assert moving.sum() > 20
    assert np.std((table["force"] - made)[moving]) < 3.0


@pytest.fixture(scope="module")
def loop(made_up, tmp_path_factory) -> tuple:
    """A carriage fitted to a made-up record, and the loop that it moves in."""
    car, folder = vehicle("emps"), tmp_path_factory.mktemp("loop")
    paths = module("emps", "convert").convert(made_up, folder)
    fitted = FittedMachine.of(read_log(paths[:1], car), car)
    return fitted, module("emps", "closed_loop").Loop.of(made_up / "DATA_EMPS.mat", fitted)


def test_the_undisturbed_carriage_moves_as_recorded(loop, made_up, tmp_path):
    """Its controller is that of the record, which another program has made."""
    own = loop[1]
    recorded = pd.read_parquet(module("emps", "convert").convert(made_up, tmp_path)[0])
    made = own.moved(np.zeros(len(own.time)))
    for name, share in (("position", 1e-3), ("speed", 0.01), ("force", 0.03)):
        assert np.std(made[name] - recorded[name]) < share * np.ptp(recorded[name])


def test_a_draw_is_of_the_numbers_that_made_it(loop, tmp_path):
    """In noise of the spectrum that is asked for; a seed is a record."""
    fitted, own = loop
    closed_loop = module("emps", "closed_loop")
    spectrum = np.full(len(closed_loop.FREQUENCIES), 1e-3)
    first, again, other = (own.drawn(spectrum, seed) for seed in (1, 1, 2))
    pd.testing.assert_frame_equal(first, again)
    assert np.std(first["force"] - other["force"]) > 0.1
    first.to_parquet(tmp_path / "draw.parquet", index=False)
    drawn = FittedMachine.of(read_log([tmp_path / "draw.parquet"], fitted.vehicle), fitted.vehicle)
    for name, share in (("mass", 0.01), ("coulomb", 0.05), ("viscous", 0.05)):
        assert drawn.numbers[name] == pytest.approx(fitted.numbers[name], rel=share)


def test_a_drive_that_gives_half_of_its_force_is_no_better(made_up, tmp_path):
    """Nor is the model, where all that it moves is half as heavy: the error is relative to it."""
    emps, text = module("emps", "run"), (MACHINES / "emps" / "emps.toml").read_text()
    (tmp_path / "emps.py").write_text((MACHINES / "emps" / "emps.py").read_text())
    paths = module("emps", "convert").convert(made_up, tmp_path)
    record, errors = emps.motion(pd.read_parquet(paths[0])), []
    curve = 'error_term = "drive"\ncovariate = "force"\nknots = [-200.0, 200.0]\n'
    for size in (0.0, -25.0):
        own = f"{text}\n[effects.curve_1]\n{curve}values = [{size}, {size}]\n"
        (tmp_path / "emps.toml").write_text(own)
        car = load_vehicle(tmp_path / "emps.toml", trust=True)
        fitted = FittedMachine.of(read_log(paths[:1], car), car)
        errors.append(emps.relative_force_error(fitted, record))
    assert np.std(errors[1]) == pytest.approx(np.std(errors[0]), rel=0.1)


@pytest.mark.slow
def test_innovations_of_draws_are_coloured_as_those_of_the_record(loop, made_up, tmp_path):
    fitted, own = loop
    closed_loop = module("emps", "closed_loop")

    def read(table: pd.DataFrame):
        table.to_parquet(tmp_path / "draw.parquet", index=False)
        return read_log([tmp_path / "draw.parquet"], fitted.vehicle)

    def shown(signals) -> tuple[float, float]:
        [own] = FittedMachine.of(signals, fitted.vehicle).predicted(signals, "speed")
        error = own.error
        return float(np.std(error)), float(error[1:] @ error[:-1] / (error @ error))

    signals = read(pd.read_parquet(module("emps", "convert").convert(made_up, tmp_path)[0]))
    spectrum = closed_loop.spectrum_of(own, fitted, signals, read)
    rms, memory = np.mean([shown(read(own.drawn(spectrum, seed))) for seed in range(8)], axis=0)
    wanted = shown(signals)
    assert rms == pytest.approx(wanted[0], rel=0.3)
    assert memory == pytest.approx(wanted[1], abs=0.2)


def test_an_input_that_moves_no_tracked_state_may_bend(made_up, tmp_path):
    """A position read to a micrometre bends whenever the carriage accelerates, where the mass
    shows; a force that bends between two readings leaves them out."""
    car = vehicle("emps")
    paths = module("emps", "convert").convert(made_up, tmp_path)

    def count(name: str, share: float) -> int:
        signal = replace(car.signals[name], noise=share * car.signals[name].noise)
        finer = replace(car, signals={**car.signals, name: signal})
        return len(problem_of(read_log(paths[:1], finer), finer).drives[0].readings.t)

    assert count("position", 1e-3) == count("position", 1.0)
    assert count("force", 0.1) < 0.8 * count("force", 1.0)


def test_the_force_of_a_curve_over_time_is_that_of_its_time(made_up, tmp_path):
    """The amplifier gives 1 + 0.02 · t/s of the force."""
    text = (MACHINES / "emps" / "emps.toml").read_text()
    curve = 'error_term = "drive"\ncovariate = "time"\nknots = [0.0, 3.0]\nvalues = [0.0, 3.0]\n'
    (tmp_path / "emps.toml").write_text(f"{text}\n[effects.curve_1]\n{curve}")
    (tmp_path / "emps.py").write_text((MACHINES / "emps" / "emps.py").read_text())
    car = load_vehicle(tmp_path / "emps.toml", trust=True)
    emps = module("emps", "run")
    paths = module("emps", "convert").convert(made_up, tmp_path)
    fitted = FittedMachine.of(read_log(paths[:1], car), car)
    record = emps.motion(pd.read_parquet(paths[0]))
    known, speed = fitted.numbers, record["speed"]
    force = record["force"] * (1.0 + 0.02 * (record["time"] - record["time"][0]))
    made = known["mass"] * record["acceleration"] + known["viscous"] * speed + known["offset"]
    made += known["coulomb"] * np.tanh(speed / 2e-4)
    assert emps.force_error(fitted, record) == pytest.approx(force - made, abs=1e-6)


def test_by_exact_inputs_derivatives_are_those_of_the_innovations(made_up, tmp_path):
    """Though the equations are off: no input explains by its noise what they lack."""
    text = (MACHINES / "emps" / "emps.py").read_text()
    (tmp_path / "emps.py").write_text(re.sub(r"(cm\.Input\(.*)\),\n", r"\1, exact=True),\n", text))
    (tmp_path / "emps.toml").write_text((MACHINES / "emps" / "emps.toml").read_text())
    car = load_vehicle(tmp_path / "emps.toml", trust=True)
    paths = module("emps", "convert").convert(made_up, tmp_path)
    problem = problem_of(read_log(paths[:1], car), car)
    names = [str(t) for t in problem.thetas]
    off, mass, step = np.zeros(len(names)), names.index("mass"), 0.02
    off[names.index("coulomb")] = 1.5  # 15 N too much

    def linearised(change: float):
        theta = off.copy()
        theta[mass] += change
        [drive] = problem.linearise(theta, {}, None, problem.implied(theta, {}))
        return drive

    change = (linearised(step).r - linearised(-step).r) / (2.0 * step)
    assert np.std(linearised(0.0).r) > 3.0
    assert linearised(0.0).psi[:, mass] == pytest.approx(change, abs=0.02 * np.abs(change).max())


def test_a_polynomial_narx_finds_a_linear_filter():
    """The terms that made a record are chosen on two thirds of it, and simulate another."""
    rivals = runpy.run_path(str(MACHINES.parent / "benchmarks" / "rivals.py"))
    rng = np.random.default_rng(0)

    def record() -> object:
        u = rng.standard_normal(150)
        return rivals["Record"](u, lfilter([0.0, 0.3], [1.0, -0.8], u), 1.0)

    task = rivals["Task"](record(), record(), 1.0, "V", np.abs, False)
    _, own, held_out, *_ = rivals["judged"](task, rivals["narx"])
    assert max(float(own), float(held_out)) < 1e-6


def test_a_missing_record_is_named(tmp_path):
    with pytest.raises(SystemExit, match=r"DATA_EMPS\.mat: not there; it is part of"):
        module("emps", "convert").convert(tmp_path, tmp_path)


def test_duty_of_the_servo_has_its_sign():
    """The servo reports tenths of the duty, 10.24 more where it is positive."""
    duty = module("servo", "convert").duty_of(
        np.array([11.64, 11.64, 11.64, 2.83, 2.83, 2.83, 2.83])
    )
    assert duty[0] == pytest.approx(0.14)
    assert duty[-1] == pytest.approx(-0.283)
    assert np.isnan(duty[3])


def test_late_readings_of_the_servo_leave_no_trace():
    """At a constant speed every fourth reading comes late; the table's speed is constant."""
    time = 0.01 * np.arange(200)
    late = np.where(np.arange(200) % 4 == 3, 0.006, 0.0)
    fine = 0.005 * np.arange(399)
    fixed = {"mass_kg": 0.5, "arm_m": 0.1, "supply_V": 12.0, "torque_enabled": 1.0, "torque": 0.0}
    position = np.interp(fine, time, 2.0 * (time - late))
    run = pd.DataFrame({"time_s": fine, "position_rad": position, **fixed})
    speed = module("servo", "convert").table(run)["speed"].to_numpy()[5:-5]
    assert np.std(np.diff(position) / 0.005) > 0.5
    assert speed == pytest.approx(2.0, abs=1e-6)


def test_blocks_fit_the_record():
    hour = np.arange(0.0, 3600.0, 0.01)
    assert block_length(hour) == BLOCK
    short = np.arange(0.0, 24.8, 0.01)
    assert block_length(short) == pytest.approx(short[-1] / FEWEST)
    slow = np.arange(0.0, 4096.0, 4.0)
    assert block_length(slow) == pytest.approx(LEAST * 4.0, rel=0.01)


@pytest.mark.slow
def test_a_spill_is_found_in_a_made_up_record(tmp_path):
    module("tanks", "generate").generate(tmp_path, seed=0)
    result = result_of("tanks", tmp_path, tmp_path / "out")
    assert result["verdict"] in ("named", "ambiguous")
    assert "spill_caught" in [cause["effect"] for cause in result["causes"]]
    assert result["less_ci95"][0] > 0.0


@measured
@pytest.mark.slow
def test_the_tanks_spill(tmp_path):
    result = result_of("tanks", REAL, tmp_path)
    assert "spill_caught" in [cause["effect"] for cause in result["causes"]]
    assert result["gain"]["ci95"][0] > 0.0
    assert result["rmse_after"] < 0.49


@measured
@pytest.mark.slow
def test_the_carriage_has_another_friction_backwards(tmp_path):
    result = result_of("emps", REAL, tmp_path)
    assert "viscous_direction" in [cause["effect"] for cause in result["causes"]]
    assert result["gain"]["ci95"][0] > 0.0
    assert result["held_out_first"]["force_error_percent"]["less_ci95"][0] > 0.0
    assert result["held_out_first"]["simulated_speed_rmse_m_s"]["less_ci95"][0] > 0.0
