"""Slip and lock-up without a torque signal: what stays known, and what does not."""

import re
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

import clutchest
from clutchest.models import machine_of
from clutchest.record.report import markdown
from clutchest.record.terminal import print_run


@pytest.fixture(scope="module")
def drive():
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "launches", seed=5, duration=60.0)
    kept = {n: s for n, s in signals.items() if n not in ("engine_torque", "slave_position")}
    return truck, signals, replace(signals, signals=kept)


@pytest.fixture(scope="module")
def run(drive):
    truck, _, kept = drive
    return clutchest.replay(kept, truck)


def test_modes_and_slip_time_are_those_of_the_drive(drive, run):
    truth, track = drive[1].truth, run.tracks[0]
    names = np.array(track.mode_names)[track.mode]
    locked = np.isin(names, ("locked", "retracted"))
    rows = np.clip(np.searchsorted(truth.time, track.time), 0, len(truth.time) - 1)
    truly = np.isin(truth.columns["mode"][rows], ("locked", "retracted"))
    assert np.mean(locked == truly) > 0.95


def test_energy_is_a_band_that_holds_the_truth(drive, run):
    truth, events = drive[1].truth, run.summary["engagements"]
    assert events
    for event in events:
        edges = [event["start_s"], event["start_s"] + event["duration_s"]]
        energy = float(np.diff(np.interp(edges, truth.time, truth.columns["slip_energy"]))[0])
        assert event["energy_std_J"] > 0.2 * abs(event["energy_J"])
        assert abs(event["energy_J"] - energy) < 2.0 * event["energy_std_J"]
        assert event["peak_torque"] is None or np.isnan(event["peak_torque"])


def test_the_peak_slip_is_that_of_the_drive(drive, run):
    truth, events = drive[1].truth, run.summary["engagements"]
    slip = np.abs(truth.columns["engine_speed"] - truth.columns["input_shaft_speed"])
    for event in events:
        inside = (truth.time >= event["start_s"]) & (
            truth.time <= event["start_s"] + event["duration_s"]
        )
        assert event["peak_slip"] == pytest.approx(slip[inside].max(), abs=0.5)
    alone = replace(drive[2], signals={"engine_speed": drive[2]["engine_speed"]})
    assert not clutchest.replay(alone, drive[0]).summary["engagements"]


def test_what_needs_torque_is_invalid_and_says_why(run):
    states = run.summary["states"]
    for name in ("temp_body", "temp_disc", "friction", "zero_position", "torque_bias"):
        assert not states[name]["valid"] and states[name]["value"] is None
        assert states[name]["why"] == "no engine torque signal"
    assert states["engine_speed"]["valid"] and run.summary["contradiction"] is None
    assert np.isnan(run.tracks[0].clutch_torque.value).all()


def test_reports_have_no_number_that_is_not_known(run):
    console = Console(file=StringIO(), width=200)
    print_run(run, console)
    text = console.file.getvalue() + markdown(run)
    assert not re.search(r"\bnan\b", text) and "slip event" in text


def test_an_engine_speed_alone_still_replays(drive):
    truck, signals, _ = drive
    alone = replace(signals, signals={"engine_speed": signals["engine_speed"]})
    run = clutchest.replay(alone, truck)
    assert run.summary["states"]["engine_speed"]["valid"]
    assert run.summary["slip_energy_J"] is None and not run.summary["engagements"]


def test_only_predictions_can_be_contradicted():
    equations = machine_of("dry_clutch").equations
    full = {"engine_speed", "engine_torque", "input_shaft_speed", "slave_position"}
    assert equations(full).predicted == {"engine_speed", "zero_position"}
    # without a position the engine speed follows its own slope: it is no prediction
    assert "engine_speed" not in equations(full - {"slave_position"}).predicted


def test_a_noise_stated_far_too_small_is_no_contradiction(drive):
    truck, signals, _ = drive
    kept = {n: s for n, s in signals.items() if n != "slave_position"}
    noisy = replace(truck.signals["engine_speed"], noise=1e-3)
    vehicle = replace(truck, signals={**truck.signals, "engine_speed": noisy})
    run = clutchest.replay(replace(signals, signals=kept), vehicle)
    assert run.summary["contradiction"] is None
