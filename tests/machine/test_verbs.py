"""Every verb on a machine of a user's own: no modes, no slip energy, no clutch torque."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from clutchest.can.files import read_frames
from clutchest.simulated import write_simulation
from clutchest.vehicle import load_vehicle

SERVO = Path(__file__).parents[2] / "machines" / "servo"
VEHICLE = SERVO / "servo.toml"
STATES = ("current", "speed", "temp_winding")


def test_inspect_drafts_a_vehicle_file_that_lacks_only_parameters(run, short_log, tmp_path):
    code, _, _ = run(
        "inspect",
        short_log,
        "--dbc",
        SERVO / "servo.dbc",
        "--model",
        SERVO / "servo.py",
        "--out",
        tmp_path,
    )
    assert code == 0
    missing = json.loads((tmp_path / "inspect.json").read_text())["missing"]
    assert len(missing) == 8 and all(words.startswith("parameters.") for words in missing)
    draft = tmp_path / "vehicle.toml"
    parameters = VEHICLE.read_text(encoding="utf-8").split("[parameters]")[1]
    text = draft.read_text(encoding="utf-8").replace("[parameters]", "")
    draft.write_text(text + "\n[parameters]" + parameters, encoding="utf-8")
    drafted = load_vehicle(draft, trust=True)
    assert drafted.machine.name == "servo"
    assert set(drafted.signals) == {"voltage", "current", "speed", "ambient_temp"}


def test_convert_keeps_every_frame(run, short_log, tmp_path):
    assert run("convert", short_log, "-o", tmp_path / "short.blf")[0] == 0
    before, after = read_frames(short_log), read_frames(tmp_path / "short.blf")
    assert len(before) == len(after) and np.array_equal(before.data, after.data)


def test_simulate_says_that_truth_and_model_are_the_same(run, tmp_path):
    log = tmp_path / "drive.log"
    command = ("simulate", "--vehicle", VEHICLE, "--trust", "--scenario", "mixed", "--seed", 2)
    assert run(*command, "--duration", 5, "-o", log)[0] == 0
    file = pq.read_table(tmp_path / "drive.log.truth.parquet")
    assert b"truth and model are the same" in file.schema.metadata[b"truth"]
    assert file.column_names == ["time", *STATES, "mode"]
    assert set(file["mode"].to_pylist()) == {"running"}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--scenario", "mixt"), "unknown scenario 'mixt'; did you mean 'mixed'?"),
        (
            ("--scenario", "mixed", "--effect", "coulomb:change=1"),
            "unknown effect 'coulomb'; did you mean 'coulomb_change'?",
        ),
        (
            ("--scenario", "mixed", "--effect", "stribeck:chnge=1"),
            "effect 'stribeck' has no 'chnge'; did you mean 'change'",
        ),
        (("--scenario", "mixed", "--disturb", "friction_walk=0.01"), "not without a generator"),
    ],
)
def test_simulate_refuses_what_is_unknown_in_one_line(run, tmp_path, more, words):
    out = tmp_path / "drive.log"
    code, _, error = run("simulate", "--vehicle", VEHICLE, "--trust", "--seed", 1, *more, "-o", out)
    assert code == 1 and words in error and len(error.strip().splitlines()) == 1


EXCITATIONS = {  # what is replaced, by what, and words of the message
    "an input that is missing": ('"voltage": voltage, ', "", "gives no 'voltage'"),
    "an input that is unknown": (
        '"voltage": voltage',
        '"voltag": voltage',
        "gives 'voltag', no input; did you mean 'voltage'?",
    ),
    "no number": (
        '"voltage": voltage',
        '"voltage": np.nan * voltage',
        "'voltage' is no number at every time",
    ),
    "another number of times": (
        '"voltage": voltage',
        '"voltage": voltage[:5]',
        "gives 'voltage' as an array of (5,), expected one number, or one at each of the",
    ),
    "an exception": ("5.0 * np.sin", '"5" + np.sin', "UFuncTypeError"),
}


@pytest.mark.parametrize("what", EXCITATIONS)
def test_a_wrong_excitation_is_one_line(run, tmp_path, what):
    for name in ("servo.toml", "servo.dbc"):
        (tmp_path / name).write_bytes((SERVO / name).read_bytes())
    old, new, words = EXCITATIONS[what]
    text = (SERVO / "servo.py").read_text(encoding="utf-8").replace(old, new)
    (tmp_path / "servo.py").write_text(text, encoding="utf-8")
    command = ("simulate", "--vehicle", tmp_path / "servo.toml", "--trust", "--scenario", "mixed")
    code, _, error = run(*command, "--seed", 1, "-o", tmp_path / "drive.log")
    assert code == 1 and words in error and len(error.strip().splitlines()) == 1
    assert "excitation 'mixed'" in error


def test_replay_estimates_the_states_and_nothing_else(run, short_log, tmp_path):
    assert run("replay", short_log, "--vehicle", VEHICLE, "--trust", "--out", tmp_path)[0] == 0
    estimates = pd.read_parquet(tmp_path / "estimates.parquet")
    each = [f"{state}{what}" for state in STATES for what in ("", "_std", "_valid")]
    assert list(estimates.columns) == ["time", "drive", "log", "timestamp", "mode", *each]
    truth = pd.read_parquet(f"{short_log}.truth.parquet")
    for state in STATES:
        off = estimates[state] - np.interp(estimates.time, truth.time, truth[state])
        within = np.abs(off) < 3.0 * estimates[f"{state}_std"]
        assert within.mean() > 0.98, state
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["engagements"] == [] and summary["wear"] is None
    assert summary["slip_energy_J"] is None and summary["modes_s"]["running"] > 19.0
    assert (tmp_path / "recording.rrd").stat().st_size > 10_000


def test_an_effect_reaches_the_simulated_bus(servo):
    from clutchest.simulated import simulate

    plain = simulate(servo, "mixed", 1, duration=5.0)
    wrong = simulate(servo, "mixed", 1, {"current_gain": {"change": 0.2}}, duration=5.0)
    assert np.array_equal(plain["speed"].value, wrong["speed"].value)
    strong = np.abs(plain["current"].value) > 2.0
    ratio = wrong["current"].value[strong] / plain["current"].value[strong]
    assert np.median(ratio) == pytest.approx(1.2, abs=0.005)


# --- what takes longer ----------------------------------------------------------------------------


@pytest.mark.slow
def test_identify_moves_a_wrong_parameter_to_the_truth(run, healthy_log, tmp_path):
    truth = json.loads(
        pq.read_metadata(f"{healthy_log}.truth.parquet").metadata[b"parameters"].decode()
    )
    wrong = tmp_path / "wrong.toml"
    text = VEHICLE.read_text(encoding="utf-8")
    for name in ("servo.py", "servo.dbc"):
        (tmp_path / name).write_bytes((SERVO / name).read_bytes())
    text = text.replace(
        'value = 4e-4, unit = "kg m²", spread = 1e-5', 'value = 5e-4, unit = "kg m²", spread = 1e-4'
    )
    wrong.write_text(text, encoding="utf-8")
    out = tmp_path / "fitted"
    assert run("identify", "all", healthy_log, "--vehicle", wrong, "--trust", "--out", out)[0] == 0
    fitted = json.loads((out / "fit.json").read_text())["parameters"]
    for key in ("inertia", "torque_constant", "coulomb_torque", "resistance"):
        assert fitted[key]["determined"]
        assert abs(fitted[key]["value"] - truth[key]) < 3.0 * fitted[key]["std"], key


@pytest.mark.slow
def test_identify_determines_the_noise_of_the_sensors(run, healthy_log, tmp_path):
    command = ("identify", "noise", healthy_log, "--vehicle", VEHICLE, "--trust", "--out", tmp_path)
    assert run(*command)[0] == 0
    fitted = json.loads((tmp_path / "fit.json").read_text())["parameters"]
    assert fitted["signals.speed.noise"]["value"] == pytest.approx(0.5, rel=0.1)


@pytest.mark.slow
def test_discover_names_a_hidden_effect_and_nothing_on_a_healthy_drive(
    run, servo, healthy_log, tmp_path
):
    hidden = tmp_path / "hidden.log"
    write_simulation(
        hidden, servo, "mixed", 3, {"stribeck": {"change": 0.5, "speed": 20.0}}, duration=60.0
    )
    verdicts = {}
    for log in (hidden, healthy_log):
        out = tmp_path / log.stem
        assert run("discover", log, "--vehicle", VEHICLE, "--trust", "--out", out)[0] == 0
        verdicts[log.stem] = json.loads((out / "discovery.json").read_text())
    assert verdicts["hidden"]["gain"]["simulation_rmse_after"] < 0.05  # Nm of up to 0.7
    [cause] = verdicts["hidden"]["causes"]
    assert verdicts["hidden"]["verdict"] == "named" and cause["effect"] == "stribeck"
    change = cause["parameters"]["change"]
    assert abs(change["value"] - 0.5) < 3.0 * change["std"]
    assert verdicts["hidden"]["where"]["equation"] == "friction"
    assert verdicts["healthy"]["verdict"] == "none" and verdicts["healthy"]["causes"] == []
    extended = tmp_path / "hidden" / "extended.toml"
    assert run("replay", hidden, "--vehicle", extended, "--out", tmp_path / "again")[0] == 0


@pytest.mark.slow
def test_diagnose_finds_the_declared_fault_and_none_on_a_healthy_drive(
    run, servo, healthy_log, tmp_path
):
    dry = tmp_path / "dry.log"
    write_simulation(dry, servo, "mixed", 4, {"coulomb_change": {"change": 0.8}}, duration=60.0)
    faults = {}
    for log in (dry, healthy_log):
        out = tmp_path / log.stem
        assert run("diagnose", log, "--vehicle", VEHICLE, "--trust", "--out", out)[0] == 0
        faults[log.stem] = json.loads((out / "diagnosis.json").read_text())["faults"]
    [fault] = faults["dry"]
    assert fault["fault"] == "coulomb_change"
    assert fault["freeze_frame"]["clutch_torque"] is None
    assert faults["healthy"] == []


@pytest.mark.slow
def test_monitor_writes_the_states_and_nothing_else(short_log, tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    bus = ("--interface", "udp_multicast", "--channel", "239.74.163.3")
    environment = {**os.environ, "CAN_CONFIG": json.dumps({"port": port})}
    out, command = tmp_path / "live", [sys.executable, "-m", "clutchest"]
    watch = [
        *command,
        "monitor",
        *bus,
        "--vehicle",
        VEHICLE,
        "--trust",
        "--out",
        out,
        "--duration",
        "40",
    ]
    with subprocess.Popen(
        [*map(str, watch), "--json"], stdout=subprocess.PIPE, text=True, env=environment
    ) as monitor:
        subprocess.run([*command, "play", short_log, *bus], env=environment, check=True)
        subprocess.run([*command, "play", short_log, *bus], env=environment, check=True)
        lines, _ = monitor.communicate(timeout=120.0)
    assert monitor.returncode == 0
    said = [json.loads(line) for line in lines.splitlines()]
    estimates = [line for line in said if line["kind"] == "estimate"]
    assert len(estimates) > 50 and set(estimates[0]["data"]) == set(STATES)
    assert {line["name"] for line in estimates} <= {"running", "unknown"}
    columns = pd.read_parquet(out / "estimates.parquet").columns
    assert "clutch_torque" not in columns and "speed" in columns
