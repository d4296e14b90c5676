"""MF4 files as other loggers write them: invalid records, lengths by code, ids without a flag."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF
from asammdf.blocks.conversion_utils import from_dict

from clutchest.can.files import read_frames
from clutchest.can.formats.mf4 import _signal
from clutchest.can.frames import LENGTH_CODE, LENGTHS, Flag, Frames
from clutchest.reading.inspection import inspect_logs
from samples import random_frames

KIND = "CAN_DataFrame"


def data_frames(n: int, fd: bool = False) -> Frames:
    frames = random_frames(n, seed=21, fd=fd)
    frames.flags[:] &= np.uint8(Flag.EXTENDED | Flag.FD)
    return replace(frames.sorted(), t_ns=np.arange(n) * 10_000_000)


def written(path: Path, frames: Frames, change=lambda signal, channels: None, without=()) -> Path:
    """``frames`` with what ``change`` does to their signal, and then to its channels."""
    signal = _signal(frames, KIND, 0)
    kept = [name for name in signal.samples.dtype.names if name.split(".")[1] not in without]
    samples = np.zeros(len(frames), [(name, signal.samples.dtype[name]) for name in kept])
    for name in kept:
        samples[name] = signal.samples[name]
    signal.samples = samples
    change(signal, None)
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.fromtimestamp(0, UTC)
        mdf.append(signal)
        change(None, {channel.name: channel for channel in mdf.groups[0].channels})
        mdf.save(path, overwrite=True)
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_records_marked_as_invalid_are_left_out_and_counted(compressed, tmp_path):
    frames, bad = data_frames(200), np.zeros(200, bool)
    bad[[0, 7, *range(100, 150)]] = True

    def change(signal, channels):
        if signal is not None:
            signal.invalidation_bits = bad

    path = written(tmp_path / "a.mf4", frames, change)
    if compressed:
        with MDF(path) as mdf:
            mdf.save(path.with_name("b.mf4"), compression=2)
        path = path.with_name("b.mf4")
    given = read_frames(path)
    assert given.rejected == (("frame is marked as invalid", 52),)
    np.testing.assert_array_equal(given.t_ns, frames.t_ns[~bad])
    np.testing.assert_array_equal(given.id, frames.id[~bad])
    np.testing.assert_array_equal(given.data, frames.data[~bad])


def test_all_of_a_channel_invalid(tmp_path):
    def change(signal, channels):
        if channels is not None:
            channels[f"{KIND}.Dir"].flags |= 1  # cn_flags: all values invalid

    frames = data_frames(20)
    frames.flags[3] |= np.uint8(Flag.SENT)
    given = read_frames(written(tmp_path / "a.mf4", frames, change))
    assert len(given) == 20 and not np.any(given.flags & Flag.SENT)


TABLE = {f"raw_{code}": code for code in range(16)}
TABLE |= {f"phys_{code}": int(length) for code, length in enumerate(LENGTHS)}


@pytest.mark.parametrize("table", [True, False])
def test_data_length_that_is_the_code(table, tmp_path):
    frames = data_frames(300, fd=True)
    assert set(frames.length) >= {12, 20, 64}

    def change(signal, channels):
        if signal is not None:
            signal.samples[f"{KIND}.DataLength"] = LENGTH_CODE[frames.length]
        elif table:
            channels[f"{KIND}.DataLength"].conversion = from_dict(TABLE)

    given = read_frames(written(tmp_path / "a.mf4", frames, change))
    np.testing.assert_array_equal(given.length, frames.length)
    np.testing.assert_array_equal(given.data, frames.data)
    assert given.rejected == ()


def test_a_length_in_words_is_read_by_its_number(tmp_path):
    frames = data_frames(50)
    words = {f"val_{n}": n for n in range(9)} | {f"text_{n}": f"{n} bytes" for n in range(9)}

    def change(signal, channels):
        if channels is not None:
            channels[f"{KIND}.DataLength"].conversion = from_dict(words)

    given = read_frames(written(tmp_path / "a.mf4", frames, change))
    np.testing.assert_array_equal(given.length, frames.length)


def test_ids_without_a_flag_are_extended_by_their_size(tmp_path):
    frames = data_frames(100)
    frames.id[::2] = 0x700 + np.arange(50)
    frames.flags[::2] = 0
    frames.id[1::2] |= 0x800
    frames.flags[1::2] = Flag.EXTENDED
    given = read_frames(written(tmp_path / "a.mf4", frames, without=("IDE",)))
    np.testing.assert_array_equal(given.flags, frames.flags)
    np.testing.assert_array_equal(given.id, frames.id)


@pytest.mark.parametrize(("without", "notes"), [((), 0), (("BusChannel",), 1)])
def test_groups_that_do_not_say_their_bus_are_reported(without, notes, tmp_path):
    """Two groups of data frames, as a logger writes one per bus."""
    frames = data_frames(60)
    signal = _signal(frames, KIND, 0)
    kept = [name for name in signal.samples.dtype.names if name.split(".")[1] not in without]
    signal.samples = signal.samples[kept].copy()
    path = tmp_path / "a.mf4"
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.fromtimestamp(0, UTC)
        mdf.append(signal)
        mdf.append(signal)
        mdf.save(path, overwrite=True)
    given = read_frames(path)
    assert len(given) == 120 and given.rejected == ()
    assert len(given.notes) == notes
    for words in given.notes:
        assert words == f"2 groups of {KIND} have no BusChannel: all are read as channel 0"
    assert given.sorted().take(slice(0, 3)).notes == given.notes
    inspection = inspect_logs([path], model="dry_clutch")
    assert set(given.notes) <= set(inspection.warnings)
