"""Logs of two vehicles that are given as one drive, and one that is given twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.can.files import write_frames
from clutchest.reading import read_log
from clutchest.simulated import simulate_frames

MIXED = "of two vehicles, or of one that two loggers recorded?"
TWICE = "one drive that is given twice"


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


@pytest.fixture(scope="module")
def frames(truck):
    return simulate_frames(truck, "launches", 3, duration=20.0)[0]


def late(frames, seconds, jitter_ns=0):
    return replace(frames, t_ns=frames.t_ns + int(seconds * 1e9) + jitter_ns)


def said(truck, folder: Path, **logs) -> list[str]:
    paths = []
    for name, content in logs.items():
        paths.append(folder / f"{name}.asc")
        write_frames(content, paths[-1])
    return [w for w in read_log(paths, truck).warnings if MIXED in w or TWICE in w]


def test_two_trucks_at_once_are_named(truck, frames, tmp_path):
    other = simulate_frames(truck, "launches", 4, duration=20.0)[0]
    begun = (int(frames.t_ns[0]) - int(other.t_ns[0])) / 1e9
    (words,) = said(truck, tmp_path, a=frames, b=late(other, begun + 5.0))
    assert words.startswith(
        "a.asc and b.asc overlap by 15 s, in which both have readings of 7 mess"
    )


def test_pieces_of_one_drive_are_not(truck, frames, tmp_path):
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    first, second = frames.take(t < 12.0), frames.take(t >= 8.0)
    assert said(truck, tmp_path, a=first, b=second) == []
    assert said(truck, tmp_path, a=first, b=frames.take(t >= 12.0)) == []
    assert said(truck, tmp_path, a=frames, b=frames) == []
    engine = ((frames.id >> 8) & 0xFFFF) == 0xF004
    assert said(truck, tmp_path, a=frames.take(engine), b=frames.take(~engine)) == []


def test_one_bus_by_two_loggers_is_named(truck, frames, tmp_path):
    (words,) = said(truck, tmp_path, a=frames, b=late(frames, 0.0, jitter_ns=40_000))
    assert "overlap by 20 s" in words


def test_tables_of_two_trucks_at_once_are_named(truck, tmp_path):
    speed = 80.0 + 10.0 * np.sin(np.arange(400) / 40.0)
    for name, begun in (("a", "10:00:00"), ("b", "10:00:00.007")):
        clock = pd.date_range(f"2024-01-18 {begun}", periods=400, freq="50ms")
        table = pd.DataFrame({"time": clock, "engine_speed": speed})
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    warnings = read_log([tmp_path / "a.csv", tmp_path / "b.csv"], truck).warnings
    assert any("both have readings of 1 signal, not" in words for words in warnings)


def test_a_drive_that_is_given_decoded_too_is_named(truck, frames, tmp_path):
    write_frames(frames, tmp_path / "a.log")
    read_log(tmp_path / "a.log", truck).to_pandas().to_csv(tmp_path / "b.csv", index=False)
    both = read_log([tmp_path / "a.log", tmp_path / "b.csv"], truck)
    assert len(both.drives) == 2
    (words,) = (words for words in both.warnings if TWICE in words)
    assert words.startswith("b.csv has the very samples of a.log")
    alone = read_log(tmp_path / "a.log", truck)
    assert not any(TWICE in words for words in alone.warnings)


def test_a_truck_that_is_parked_twice_is_not(truck):
    parked = pd.DataFrame({"time": np.arange(100) / 100.0, "engine_speed": 0.0})
    assert not any(TWICE in words for words in read_log([parked, parked], truck).warnings)
