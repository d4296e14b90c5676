"""Logs in blocks, and time windows of them."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from clutchest.can import activity, files, log_source
from clutchest.can.files import write_frames
from clutchest.can.frame_filter import FrameFilter
from clutchest.can.frames import Flag, Frames
from clutchest.cli import app
from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.tables import write_signals
from clutchest.reading.window import TimeWindow

START_S = 1_700_000_000


@pytest.fixture
def busy(send, tmp_path: Path) -> Path:
    """Two drives, hours apart, on a bus with much that no one wants."""
    rng = np.random.default_rng(3)
    parts = []
    for start in (0.0, 7200.0):
        speed = send("EEC1", start=start, EngineSpeed=np.linspace(600, 700, 1000))
        noise = Frames.empty(5000)
        noise.t_ns[:] = speed.t_ns[0] - 2_000_000_000 + np.sort(rng.integers(0, 15 * 10**9, 5000))
        noise.id[:] = rng.integers(0, 0x300, 5000)
        noise.flags[::50], noise.flags[1::100] = Flag.REMOTE, Flag.ERROR
        noise.length[:] = 8
        parts += [speed, noise]
    path = tmp_path / "busy.log"
    write_frames(Frames.concatenate(parts).sorted(), path)
    return path


def assert_same_signals(a, b) -> None:
    assert len(a.drives) == len(b.drives)
    for one, other in zip(a.drives, b.drives, strict=True):
        assert one.end == other.end and one.start_ns == other.start_ns
        for name in one:
            np.testing.assert_array_equal(one[name].time, other[name].time)
            np.testing.assert_array_equal(one[name].value, other[name].value)


@pytest.mark.parametrize("block", [2_000, 50_000])
def test_the_size_of_the_blocks_does_not_matter(block, busy, truck, monkeypatch):
    whole = read_log(busy, truck)
    assert [len(drive["engine_speed"]) for drive in whole.drives] == [1000, 1000]
    lost = [
        sum(drive.counts.rejected.get(f"{kind} frame", 0) for drive in whole.drives)
        for kind in ("error", "remote")
    ]
    assert lost == [100, 200]
    monkeypatch.setattr(log_source, "BLOCK", block)
    blocks = read_log(busy, truck)
    assert_same_signals(blocks, whole)
    total = [sum(drive.counts.frames for drive in s.drives) for s in (blocks, whole)]
    assert total == [12_000, 12_000]
    counted = [
        drive.counts.decoded + sum(drive.counts.rejected.values()) for drive in blocks.drives
    ]
    assert sum(counted) == 12_000


def test_little_is_kept_of_what_is_not_wanted(busy, bus):
    needed = FrameFilter([bus.message("EEC1")], 3600 * 10**9)
    kept = Frames.concatenate([needed.kept(block) for block in files.read_blocks(busy)])
    spans = len(np.unique(files.read_frames(busy).t_ns // activity.RESOLUTION_NS))
    assert 2000 < len(kept) < 2000 + 0x300 + 40 + spans < 4400
    assert len(kept) + sum(n for _, n in kept.passed_over) == 12_000
    whole = files.read_frames(busy)
    assert kept.t_ns[0] == whole.t_ns[0] and kept.t_ns[-1] == whole.t_ns[-1]
    assert set(kept.id.tolist()) == set(whole.id.tolist())


@pytest.fixture
def log(send, tmp_path: Path) -> Path:
    write_frames(send("EEC1", EngineSpeed=np.linspace(600, 700, 1000)), tmp_path / "a.log")
    return tmp_path / "a.log"


def test_a_window_by_seconds(log, truck):
    speed = read_log(log, truck, TimeWindow(2.0, 5.0))["engine_speed"]
    whole = read_log(log, truck)["engine_speed"]
    np.testing.assert_array_equal(speed.value, whole.value[200:500])
    assert speed.time[0] == 0.0


def test_a_window_by_the_clock_in_any_zone(log, truck):
    zone = timezone(timedelta(hours=5, minutes=30))
    start, stop = (datetime.fromtimestamp(START_S + s, zone).isoformat() for s in (2, 5))
    given = read_log(log, truck, TimeWindow.parse(start, stop))
    assert len(given["engine_speed"]) == 300 and given.start_ns == (START_S + 2) * 10**9
    assert given.counts.rejected["outside the time window"] == 700
    local = datetime.fromtimestamp(START_S + 9).isoformat()
    assert len(read_log(log, truck, TimeWindow.parse(local, None))["engine_speed"]) == 100


def test_a_window_of_a_table(log, truck, tmp_path):
    write_signals(read_log(log, truck), tmp_path / "a.csv")
    speed = read_log(tmp_path / "a.csv", truck, TimeWindow(2.0, 5.0))["engine_speed"]
    assert len(speed) == 300 and speed.time[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("start", "stop", "message"),
    [
        ("soon", None, r"'soon' is no time; expected seconds .* or a date"),
        ("5", "2", "ends before it starts"),
        ("-3", None, "'-3'; expected seconds from the start of a log, from 0"),
        ("nan", None, "'nan'; expected seconds from the start of a log, from 0"),
        ("60", None, r"no data in the time window.*is from 20\d\d-.*[+-]\d\d:\d\d to"),
    ],
)
def test_a_window_that_cannot_be(start, stop, message, log, truck):
    with pytest.raises(ClutchestError, match=message):
        read_log(log, truck, TimeWindow.parse(start, stop))


def test_a_date_needs_a_clock(send, truck, tmp_path):
    frames = send("EEC1", EngineSpeed=np.linspace(600, 700, 100))
    frames = replace(frames, t_ns=frames.t_ns - frames.t_ns[0], absolute=False)
    write_frames(frames, tmp_path / "a.log")
    with pytest.raises(ClutchestError, match=r"a\.log: its clock only counts from its own start"):
        read_log(tmp_path / "a.log", truck, TimeWindow.parse("2024-01-01", None))


def test_convert_cuts(log, tmp_path, capsys):
    with pytest.raises(SystemExit) as left:
        app(
            [
                "convert",
                str(log),
                "-o",
                str(tmp_path / "b.blf"),
                "--from",
                "1",
                "--to",
                "2",
                "--json",
            ]
        )
    assert left.value.code == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 100
    assert len(files.read_frames(tmp_path / "b.blf")) == 100
