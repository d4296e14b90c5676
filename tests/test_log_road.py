"""The log road is quick: ratios within one run, with slack for a busy machine."""

from __future__ import annotations

import runpy
from pathlib import Path
from time import perf_counter

import cantools
import numpy as np
import pytest

import clutchest
from clutchest.can.files import read_frames, write_frames
from clutchest.reading import load_database
from clutchest.reading.wanted import mapped_messages

ROOT = Path(__file__).parents[1]
BENCHMARK = ROOT / "benchmarks" / "log_road"


@pytest.fixture(scope="module")
def frames():
    return read_frames(ROOT / "logs" / "demo.log.gz")


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc"])
def test_signals_come_many_times_quicker_than_by_the_usual_loop(
    suffix, frames, tmp_path, monkeypatch
):
    """Measured: 30 to 60 times; see benchmarks/log_road."""
    monkeypatch.syspath_prepend(BENCHMARK)
    benchmark = runpy.run_path(str(BENCHMARK / "__main__.py"))
    read_and_decode, usual_loop = benchmark["read_and_decode"], benchmark["peers"].read_and_decode

    truck = clutchest.load_vehicle("truck")
    database = load_database(truck)
    wanted = {name: set(layouts) for name, layouts in mapped_messages(truck, database).items()}
    path = tmp_path / f"drive{suffix}"
    write_frames(frames, path)
    assert read_and_decode(path, truck, database) == len(frames)  # compiles
    usual = cantools.database.load_file(database.paths[0])
    part = tmp_path / f"part{suffix}"
    write_frames(frames.take(np.arange(2000)), part)
    ratios = []
    for _ in range(3):
        begin = perf_counter()
        read_and_decode(path, truck, database)
        ours = perf_counter() - begin
        begin = perf_counter()
        assert usual_loop(part, usual, wanted) == 2000
        ratios.append((perf_counter() - begin) / 2000 * len(frames) / ours)
    assert max(ratios) > 10
