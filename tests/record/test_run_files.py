"""The files of a run, and its words on a terminal."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from errno import EACCES
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from rich.console import Console

from clutchest.errors import ClutchestError
from clutchest.quantity import Quantity
from clutchest.record import rerun as recording
from clutchest.record.files import finished_into, json_text, read_state, write_run
from clutchest.record.report import plus_minus
from clutchest.record.terminal import print_run


def no_constant(name):
    raise AssertionError(f"{name} is not JSON")


def test_files_of_a_run(run, tmp_path):
    written = write_run(run, tmp_path / "new" / "out", innovations=True)
    assert [p.name for p in written] == [
        "estimates.parquet",
        "innovations.parquet",
        "recording.rrd",
        "state.json",
        "summary.json",
    ]
    assert sorted(p.name for p in (tmp_path / "new" / "out").iterdir()) == [p.name for p in written]
    table = pd.read_parquet(written[0])
    pd.testing.assert_frame_equal(table, run.to_pandas())
    metadata = pq.read_schema(written[0]).metadata
    for key, value in run.provenance.items():
        assert metadata[key.encode()].decode() == value
    innovations = pd.read_parquet(written[1])
    assert list(innovations) == ["time", "drive", "sensor", "innovation", "std"]
    of_one = innovations[innovations.sensor == "zero_position"]
    np.testing.assert_array_equal(
        of_one.innovation, run.tracks[0].innovations.of("zero_position")[1]
    )
    state = json.loads(written[3].read_text(), parse_constant=no_constant)
    assert state == read_state(written[3])


def test_json_is_strict(run, tmp_path):
    write_run(run, tmp_path)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    summary = json.loads(text, parse_constant=no_constant)
    assert summary["log_likelihood"] is None  # the run has NaN there
    assert summary["states"]["temp_disc"]["valid"] is True
    assert json.loads(
        json_text({"a": np.float32("inf"), "b": np.arange(2), "c": (np.nan, None)})
    ) == {"a": None, "b": [0, 1], "c": [None, None]}


def test_a_failed_write_keeps_what_was_good(run, tmp_path, monkeypatch):
    write_run(run, tmp_path, innovations=True)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def full(run, path):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(recording, "write_recording", full)
    with pytest.raises(OSError, match="No space left"):
        write_run(replace(run, summary={}), tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_innovations_of_an_earlier_run_do_not_stay(run, tmp_path):
    write_run(run, tmp_path, innovations=True)
    write_run(run, tmp_path)
    assert not (tmp_path / "innovations.parquet").exists()


def test_a_file_is_no_folder(tmp_path):
    target = tmp_path / "results"
    target.write_text("mine")
    with (
        pytest.raises(ClutchestError, match="results: is a file, expected a folder"),
        finished_into(target),
    ):
        pass
    assert target.read_text() == "mine"


def test_a_place_that_takes_no_folder_is_named_as_it_was_given(tmp_path, monkeypatch):
    def refuse(path, *given):
        if tmp_path not in Path(path).parents:
            return make(path, *given)
        raise PermissionError(EACCES, "Permission denied", path)

    make = os.mkdir
    monkeypatch.setattr("os.mkdir", refuse)
    with pytest.raises(PermissionError) as caught, finished_into(tmp_path):
        pass
    assert caught.value.filename == str(tmp_path)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('{"x": 1,\n nope}', "line 2: not JSON"),
        ("[1, 2]", "expected the state.json of an earlier replay"),
    ],
)
def test_a_state_that_is_none(tmp_path, text, complaint):
    path = tmp_path / "state.json"
    path.write_text(text)
    with pytest.raises(ClutchestError, match=complaint):
        read_state(path)
    with pytest.raises(ClutchestError, match=r"gone\.json: cannot be read"):
        read_state(tmp_path / "gone.json")


@pytest.mark.parametrize(
    ("unit", "value", "std", "shown"),
    [
        ("°C", 82.123, 3.41, "82.1 ± 3.4 °C"),
        ("mm", 38.40123, 0.0512, "38.401 ± 0.051 mm"),
        ("rad/s", 62.83185, 0.1, "600.00 ± 0.95 rpm"),
        ("J", 52_000.0, 1_800.0, "52.0 ± 1.8 kJ"),
        ("1", 1.0, 0.03, "1.000 ± 0.030"),
        ("Nm", -3.0, 1234.0, "-3 ± 1234 Nm"),
        ("°C", 70.0, 0.0, "70.00 ± 0.00 °C"),
        ("°C", None, 1.0, "–"),
        ("°C", 1.0, float("nan"), "–"),
    ],
)
def test_digits_follow_the_uncertainty(unit, value, std, shown):
    assert plus_minus(Quantity("q", unit), value, std) == shown


def words(run) -> str:
    console = Console(file=StringIO(), width=110)
    print_run(run, console)
    return console.file.getvalue()


def test_terminal_table(run):
    text = words(run)
    disc = run.summary["states"]["temp_disc"]
    assert f"{disc['value']:.1f} ± {disc['std']:.1f} °C" in text
    assert "Left: 140 MJ [95 %: 36 to 200]." in text
    event = r"1 slip event in 1\.\d s, 52\.0 ± 1\.8 kJ of heat, disc temperature at most 96 °C\."
    assert re.search(event, text)
    assert "warning: parameter 'kiss_point' is a guess" in text


def test_terminal_says_what_was_not_used(run):
    assert "not used" not in words(run)
    summary = {**run.summary, "frames_rejected": {"gzip data end early": 1}}
    assert "not used: 1 × gzip data end early" in words(replace(run, summary=summary))


def test_terminal_says_why_not_valid(run):
    states = dict(run.summary["states"])
    states["friction"] = {
        **states["friction"],
        "value": None,
        "std": None,
        "valid": False,
        "why": "nothing informs it",
        "needs": "a [launch]",
    }
    tracks = tuple(replace(track, engagements=()) for track in run.tracks)
    warnings = [f"warning {k}" for k in range(20)]
    text = words(
        replace(run, tracks=tracks, summary={**run.summary, "states": states, "warnings": warnings})
    )
    assert "nothing informs it; needs a [launch]" in text
    assert "No slip event above 200 J" in text
    assert "… and 12 more warnings" in text


def test_what_a_killed_process_left_unfinished_is_swept(run, tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    alive = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    left = [tmp_path / f".unfinished-{p}-abc" for p in (gone.pid, os.getpid(), alive.pid)]
    for folder in left:
        folder.mkdir()
        (folder / "summary.json").touch()
    with finished_into(tmp_path):
        write_run(run, tmp_path)  # the other one of this process is at work, and stays
        assert len(list(tmp_path.glob(f".unfinished-{os.getpid()}-*"))) == 1
    alive.communicate()
    assert [folder.exists() for folder in left] == [False, False, True]


KILLED = """
import os, signal, sys
from pathlib import Path
from clutchest.record.files import finished_into
out, moved = Path(sys.argv[1]), int(sys.argv[2])
replace = Path.replace
def killed(self, target):
    global moved
    if not moved:
        os.kill(os.getpid(), signal.SIGKILL)
    moved -= 1
    return replace(self, target)
Path.replace = killed
with finished_into(out) as folder:
    for name in "abc":
        (folder / name).write_text("new")
"""


@pytest.mark.parametrize("moved", range(3))
@pytest.mark.skipif(os.name != "posix", reason="locks and signals of POSIX")
def test_files_are_moved_by_the_next_process_where_one_was_killed(tmp_path, moved):
    for name in "abc":
        (tmp_path / name).write_text("old")
    process = subprocess.run([sys.executable, "-c", KILLED, tmp_path, str(moved)], check=False)
    assert process.returncode == -signal.SIGKILL
    assert [(tmp_path / name).read_text() for name in "abc"].count("new") == moved
    with finished_into(tmp_path):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == list("abc")
    assert {(tmp_path / name).read_text() for name in "abc"} == {"new"}
