"""A short run of the fuzzer; the long ones are started by hand, see tests/fuzz."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import sleep

import pytest

from clutchest.can import log_source
from fuzz.__main__ import Record, fuzz

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="no alarm to end a hang")


@pytest.fixture(autouse=True)
def blocks_as_before(monkeypatch):
    monkeypatch.setattr(log_source, "BLOCK", log_source.BLOCK)  # the fuzzer makes them small


TEXT = [".log", ".asc", ".blf", ".trc", ".csv", ".crtd", ".pcap", ".txt"]


@pytest.mark.parametrize("suffix", TEXT)
def test_damaged_logs_are_read_or_refused(suffix, tmp_path):
    results = fuzz(300, seed=7, formats=[suffix], seconds=20, keep=tmp_path)
    assert results.total() == 300 and results[f"{suffix} frames"] > 60


def test_a_damaged_sqlite_log_is_read_or_refused(tmp_path):
    results = fuzz(250, seed=7, formats=[".db"], seconds=20, keep=tmp_path)
    assert results.total() == 250 and results[".db frames"] > 25


def test_a_damaged_mf4_is_read_or_refused(tmp_path, capfd):
    assert fuzz(60, seed=7, formats=[".mf4"], seconds=20, keep=tmp_path).total() == 60
    assert capfd.readouterr().err == ""


MORE = {".json": 300, ".parquet": 1000, ".toml": 500, ".dbc": 100, ".table.csv": 500}
MORE |= {".v73.mat": 1000, ".mat": 1000, ".xlsx": 500, ".tdms": 500, ".kcd": 500, ".sym": 500}
MORE |= {".arxml": 500, ".table.mf4": 300}
OTHERS = {".toml": 20, ".dbc": 20, ".table.csv": 30, ".py": 100, ".datagram": 1000}
OTHERS |= {".v73.mat": 30, ".mat": 30, ".xlsx": 15, ".tdms": 30, ".kcd": 30, ".sym": 30}
OTHERS |= {".arxml": 30, ".table.mf4": 20}


@pytest.mark.parametrize("suffix", OTHERS)
def test_damaged_inputs_of_other_kinds_are_read_or_refused(suffix, tmp_path, capfd):
    inputs = OTHERS[suffix]
    results = fuzz(inputs, seed=7, formats=[suffix], seconds=20, keep=tmp_path)
    assert results[f"{suffix} refused"] + results[f"{suffix} read"] == inputs
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_run_that_is_ended_says_its_counts_and_goes_on(tmp_path):
    """By its record: the same inputs, one after another, as of a run that nobody ended."""
    record = tmp_path / "fuzz.json"
    given = {"seed": 3, "formats": [".datagram"]}
    command = ["--seed", "3", "--formats", ".datagram", "--inputs", "1000000000", "--record"]
    path = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
    run = subprocess.Popen(
        [sys.executable, "-m", "fuzz", *command, str(record)],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        text=True,
    )
    while not record.exists() and run.poll() is None:
        sleep(0.05)
    run.send_signal(signal.SIGTERM)
    said = run.communicate(timeout=60)[0]
    begun = Record(record, given)
    done = begun.results.total()
    assert run.returncode == 0 and f"\n{done} inputs, " in said

    def first(inputs, record=None):
        return fuzz(inputs, **given, seconds=20, keep=tmp_path, record=record)

    assert first(done + 50, begun).total() == done + 50
    assert Record(record, given).results == first(done + 50)
    with pytest.raises(SystemExit, match="of another run"):
        Record(record, {**given, "seed": 4})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "inputs"),
    [*((s, 3000) for s in (*TEXT, ".db")), (".mf4", 600), *MORE.items()],
)
def test_many_more_damaged_logs(suffix, inputs, tmp_path):
    assert fuzz(inputs, seed=11, formats=[suffix], seconds=20, keep=tmp_path).total() == inputs


@pytest.mark.slow
def test_no_index_leaves_its_array(tmp_path):
    """The compiled readers again, compiled so that an index outside an array is an error."""
    tests = Path(__file__).parents[1]
    environment = {
        **os.environ,
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(tests), *sys.path]),
    }
    subprocess.run(
        [
            sys.executable,
            "-m",
            "fuzz",
            "--inputs",
            "4000",
            "--seed",
            "8",
            "--keep",
            str(tmp_path),
            "--formats",
            *TEXT,
        ],
        env=environment,
        check=True,
        timeout=600,
    )
