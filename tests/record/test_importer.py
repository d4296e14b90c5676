"""The importer that Rerun's viewer starts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from shutil import copyfile

import pytest

from clutchest.can.formats import log_formats
from clutchest.reading.table_formats import read_suffixes
from clutchest.record.importer import NOT_OURS, SUFFIXES, vehicle_of
from clutchest.shipped import locate

COMMAND = [sys.executable, "-m", "clutchest.record.importer"]


def start(*arguments: object, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """As the viewer starts it."""
    known = {name: value for name, value in os.environ.items() if name != "CLUTCHEST_VEHICLE"}
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, env={**known, **environment}
    )


@pytest.mark.parametrize("name", ["scene.glb", "recording.rrd", "drive.log", "not there.log"])
def test_what_is_not_ours_is_left_to_others(tmp_path: Path, name: str) -> None:
    if "not there" not in name:
        (tmp_path / name).write_text("something")
    done = start(tmp_path / name, "--recording-id", "x")
    assert (done.returncode, done.stdout) == (NOT_OURS, b"")


def test_it_takes_every_log_that_can_be_read_but_texts() -> None:
    formats = {entry.suffix for entry in log_formats() if entry.suffix}
    assert SUFFIXES | {".txt"} == formats | read_suffixes()


def test_whose_log_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CLUTCHEST_VEHICLE", raising=False)
    log = tmp_path / "drive.log"
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / "broken.toml").write_text("[[[")
    assert vehicle_of(log) is None
    (tmp_path / "own.toml").write_text('name = "a"\nmodel = "dry_clutch"\n')
    assert vehicle_of(log) == str(tmp_path / "own.toml")
    (tmp_path / "other.toml").write_text('name = "b"\nmodel = "alsd"\n')
    assert vehicle_of(log) is None, "which of two is not known"
    monkeypatch.setenv("CLUTCHEST_VEHICLE", "truck")
    assert vehicle_of(log) == "truck"


def test_a_log_becomes_a_recording(tmp_path: Path) -> None:
    copyfile(locate("demo", "logs"), tmp_path / "demo.log.gz")
    log = tmp_path / "demo.log.gz"
    done = start(log, "--application-id", "a", "--recording-id", "b", CLUTCHEST_VEHICLE="truck")
    assert done.returncode == 0, done.stderr
    (tmp_path / "x.rrd").write_bytes(done.stdout)
    from rerun.chunk import RrdReader

    entities = {chunk.entity_path for chunk in RrdReader(tmp_path / "x.rrd").stream().to_chunks()}
    assert {"/state/temp_disc", "/report"} <= entities
