"""Whole sessions over a bus that needs no hardware: two monitors at once, one of them killed."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from processes import Bus, wait_for, written_by

pytestmark = pytest.mark.slow


def assert_like_a_replay(out: Path, estimates: pd.DataFrame):
    """Every row is that of a replay of the frames that were received, within design's bound."""
    truck = clutchest.load_vehicle("truck")
    whole = clutchest.replay(clutchest.read_log(out / "received.log", truck), truck).to_pandas()
    same = whole.iloc[: len(estimates)]
    assert np.array_equal(estimates["time"], same["time"])
    assert (estimates["mode"].astype(str) == same["mode"].astype(str)).all()
    assert list(estimates.columns) == list(whole.columns)
    for name in estimates.columns:
        if f"{name}_std" in estimates.columns:
            a, b, std = estimates[name], same[name], same[f"{name}_std"]
            assert (np.abs(a - b) <= 1e-9 * np.maximum(np.abs(b), std)).all(), name
    return whole


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """A log played four times as fast to two monitors; one is interrupted, the other one killed."""
    folder = tmp_path_factory.mktemp("sessions")
    whole, cut = folder / "whole", folder / "cut"
    bus = Bus(folder)
    start, said = bus.start, bus.said
    first = start("first", "monitor", "--vehicle", "truck", "--out", whole, "--json")
    second = start("second", "monitor", "--vehicle", "truck", "--out", cut, "--json")
    start("player", "play", "demo", "--speed", 4)
    try:
        wait_for(lambda: written_by(cut) > 20_000 and said("second"))
        second.kill()
        wait_for(lambda: written_by(whole) > 30_000)
        twice = start("twice", "monitor", "--vehicle", "truck", "--out", whole)
        twice.wait(60)
        first.send_signal(signal.SIGINT)
        first.wait(180)  # last fault tests of the equations, which may have to be compiled
    finally:
        bus.close()
    restarted = start("restarted", "monitor", "--vehicle", "truck", "--out", cut, "--duration", 0.5)
    restarted.wait(60)
    lines = [
        json.loads(line) for line in said("second").splitlines(keepends=True) if line.endswith("\n")
    ]
    return {
        "whole": whole,
        "cut": cut,
        "lines of the killed": lines,
        "refused": said("twice", "err"),
        "words": said("restarted"),
        "errors": said("first", "err"),
        "lines": [json.loads(line) for line in said("first").splitlines()],
        "codes": (first.returncode, restarted.returncode, twice.returncode),
    }


def verified(recording: Path) -> str:
    result = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", recording],
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if result.returncode == 0 else result.stdout + result.stderr


def test_the_estimates_are_those_of_a_replay(sessions):
    out = sessions["whole"]
    estimates = pd.read_parquet(out / "estimates.parquet")
    whole = assert_like_a_replay(out, estimates)
    assert len(estimates) == len(whole) > 80
    assert sessions["codes"] == (0, 0, 1) and not sessions["errors"]
    assert verified(out / "recording.rrd") == ""


def test_lines_and_events_are_the_same(sessions):
    events = [json.loads(line) for line in (sessions["whole"] / "events.jsonl").open()]
    rows = [line for line in sessions["lines"] if line["kind"] == "estimate"]
    others = [line for line in sessions["lines"] if line["kind"] != "estimate"]
    assert [(e["kind"], e["name"], e["time"]) for e in events] == [
        (e["kind"], e["name"], e["time"]) for e in others
    ]
    estimates = pd.read_parquet(sessions["whole"] / "estimates.parquet")
    assert [row["time"] for row in rows] == estimates["time"].tolist()
    assert rows[-1]["data"]["temp_disc"]["value"] == estimates["temp_disc"].iloc[-1]
    kinds = {event["kind"] for event in events}
    assert {"mode", "engagement"} <= kinds
    assert kinds <= {"mode", "engagement", "fault", "gap", "reconnect", "warning"}


def test_files_of_a_killed_session_are_completed_and_reported(sessions):
    assert "was cut off: estimates.parquet" in sessions["words"]
    assert "recording.rrd repaired" in sessions["words"]
    (aside,) = sessions["cut"].glob("until-*")
    estimates = pd.read_parquet(aside / "estimates.parquet")
    whole = assert_like_a_replay(aside, estimates)
    assert len(whole) - len(estimates) <= 20
    shown = [line["time"] for line in sessions["lines of the killed"] if line["kind"] == "estimate"]
    assert shown and shown[-1] <= estimates["time"].iloc[-1], "what was shown is there"
    assert verified(aside / "recording.rrd") == ""


def test_two_sessions_in_one_folder_are_refused(sessions):
    assert "another session writes into this folder" in sessions["refused"]
