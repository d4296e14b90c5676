"""What befalls a session from outside: full disks, hang-ups, stops, a terminal that is closed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.can.files import read_frames
from processes import Bus, wait_for, written_by

resource = pytest.importorskip("resource", reason="of POSIX")
pytestmark = pytest.mark.slow


@contextmanager
def monitored(folder: Path, out: Path, *more: object, speed: int = 1, **how: object):
    """A bus and a session on it that writes to ``out``: its models are compiled when the shipped
    log begins, so that nothing has piled up."""
    bus = Bus(folder)
    try:
        session = bus.start("session", "monitor", "--vehicle", "truck", "--out", out, *more, **how)
        wait_for((out / "session.json").exists)
        bus.start("player", "play", "demo", "--speed", speed)
        yield bus, session
    finally:
        bus.close()


def rows_of(words: str) -> list[float]:
    """Times of the estimates that a session has shown in whole lines."""
    lines = [line for line in words.splitlines(keepends=True) if line.endswith("\n")]
    return [row["time"] for row in map(json.loads, lines) if row["kind"] == "estimate"]


def assert_kept(out: Path, shown: list[float]) -> pd.DataFrame:
    """What was shown is there, and is that of a replay of what was received; no leftovers."""
    estimates = pd.read_parquet(out / "estimates.parquet")
    assert shown and set(shown) <= set(estimates["time"])
    truck = clutchest.load_vehicle("truck")
    whole = clutchest.replay(clutchest.read_log(out / "received.log", truck), truck).to_pandas()
    same = whole.iloc[: len(estimates)]
    assert np.array_equal(estimates["time"], same["time"])
    assert np.allclose(estimates["temp_disc"], same["temp_disc"], rtol=1e-9)
    for line in (out / "events.jsonl").read_text().splitlines():
        json.loads(line)
    assert not [path.name for path in out.iterdir() if path.name.startswith(".")]
    return estimates


def next_start(bus: Bus, out: Path) -> tuple[str, Path]:
    """What the next session in a folder says, and where the files of the one before are now."""
    bus.start("next", "monitor", "--vehicle", "truck", "--out", out, "--duration", 0.5).wait(240)
    assert not bus.said("next", "err")
    assert not list(out.glob(".unfinished-*"))
    (aside,) = out.glob("until-*")
    return bus.said("next"), aside


def test_files_that_may_not_grow_end_the_session(tmp_path):
    """As on a full disk: a line, exit 1, and nothing that was shown is lost."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))

    out = tmp_path / "out"
    with monitored(tmp_path, out, "--json", preexec_fn=limit) as (bus, session):
        assert session.wait(240) == 1
        (line,) = bus.said("session", "err").splitlines()
        assert str(out) in line and ("File too large" in line or "cannot be written" in line)
        shown = rows_of(bus.said("session"))
        next_start(bus, out)
    (aside,) = out.glob("until-*")
    assert_kept(aside, shown)


@pytest.fixture
def small_disk(tmp_path):
    """A file system of four megabytes."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(place)]
    if sys.platform != "linux" or os.geteuid() or subprocess.run(mount, check=False).returncode:
        pytest.skip("only root can mount a small disk")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_ends_the_session(tmp_path, small_disk):
    out = small_disk / "out"
    with monitored(tmp_path, out, "--json") as (bus, session):
        wait_for(lambda: written_by(out) > 20_000)
        ballast = small_disk / "ballast"
        with pytest.raises(OSError, match="No space left"):
            ballast.write_bytes(bytes(4 * 2**20))
        assert session.wait(240) == 1
        (line,) = bus.said("session", "err").splitlines()
        assert str(out) in line and "Traceback" not in line
        shown = rows_of(bus.said("session"))
        ballast.unlink()
        words, aside = next_start(bus, out)
    assert "was cut off" in words
    assert_kept(aside, shown)


def test_a_replay_onto_a_full_disk_leaves_the_earlier_results(tmp_path, small_disk):
    out = small_disk / "out"
    command = [sys.executable, "-m", "clutchest", "replay", "demo", "--vehicle", "truck"]
    command += ["--out", str(out), "--to"]
    subprocess.run([*command, "30"], check=True, capture_output=True)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    left = os.statvfs(small_disk).f_bavail * os.statvfs(small_disk).f_frsize
    (small_disk / "ballast").write_bytes(bytes(max(left - 50_000, 0)))
    done = subprocess.run([*command, "200"], check=False, capture_output=True, text=True)
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1, done.stderr
    assert "No space left on device" in done.stderr
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM], ids=["hang-up", "terminate"])
def test_a_signal_ends_a_session_as_an_interrupt_does(tmp_path, number):
    out = tmp_path / "out"
    with monitored(tmp_path, out, "--json") as (bus, session):
        wait_for(lambda: written_by(out) > 20_000)
        session.send_signal(number)
        session.send_signal(number)
        assert session.wait(240) == 0 and not bus.said("session", "err")
    assert_kept(out, rows_of(bus.said("session")))
    assert json.loads((out / "state.json").read_text())["model"] == "dry_clutch"


def test_a_session_that_was_stopped_has_every_frame_with_its_own_stamp(tmp_path):
    out = tmp_path / "out"
    with monitored(tmp_path, out, "--json") as (bus, session):
        wait_for(lambda: written_by(out) > 10_000)
        session.send_signal(signal.SIGSTOP)
        before = len(read_frames(out / "received.log"))
        with pytest.raises(subprocess.TimeoutExpired):
            session.wait(12.0)
        session.send_signal(signal.SIGCONT)
        wait_for(lambda: len(read_frames(out / "received.log")) > before + 5000)
        session.send_signal(signal.SIGINT)
        assert session.wait(240) == 0 and not bus.said("session", "err")
    events = [json.loads(line) for line in (out / "events.jsonl").open()]
    lost = [e for e in events if e["kind"] in ("gap", "warning") and e["name"] == "bus"]
    assert not lost, "all of it was in the socket"
    steps = np.diff(read_frames(out / "received.log").t_ns) / 1e9
    assert steps.max() < 2.0, "nothing was stamped as if it had come together after the stop"
    assert_kept(out, rows_of(bus.said("session")))


def answers(address: str) -> bool:
    try:
        with urllib.request.urlopen(address, timeout=5) as page:
            return page.status == 200
    except OSError:
        return False


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["killed", "interrupted"])
def test_no_viewer_is_left_behind(tmp_path, number):
    pytest.importorskip("rerun")
    out, port = tmp_path / "out", 19_000 + os.getpid() % 1000 * 2
    with monitored(tmp_path, out, "--serve", "--port", port) as (bus, session):
        wait_for(lambda: "live viewer: " in bus.said("session", "err"))
        address = bus.said("session", "err").split("live viewer: ")[1].split()[0]
        page = address.split("?")[0]
        wait_for(lambda: answers(page))
        again = ("monitor", "--vehicle", "truck", "--out", tmp_path / "b", "--serve", "--port")
        second = bus.start("second", *again, port)
        assert second.wait(240) == 1
        assert f"port {port - 1} of 127.0.0.1" in bus.said("second", "err")
        until = time.monotonic() + 60.0
        while session.poll() is None and time.monotonic() < until:
            session.send_signal(number)  # the second one skips the last fault tests
            time.sleep(1.0)
        wait_for(lambda: not answers(page), 60)
    assert address.startswith(f"http://127.0.0.1:{port}?url=")
