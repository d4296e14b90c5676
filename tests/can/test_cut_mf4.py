"""MDF4 files whose logger lost power: what is there is read, what is lost is counted."""

from __future__ import annotations

import gc
import gzip
import struct
import tracemalloc
from contextlib import suppress

import numpy as np
import pytest

import clutchest
from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.reading.inspection import inspect_logs
from clutchest.shipped import locate
from logger_mf4 import PER_BLOCK, logged
from samples import random_frames

N = 3000


def first_of(frames: Frames, given: Frames) -> int:
    """How many of ``frames`` were read, in order and as they are."""
    n = len(given)
    for column in ("t_ns", "channel", "id", "flags", "length"):
        np.testing.assert_array_equal(getattr(given, column), getattr(frames, column)[:n])
    width = given.data.shape[1]
    np.testing.assert_array_equal(given.data, frames.data[:n, :width])
    return n


@pytest.mark.parametrize("zipped_file", [False, True], ids=["", "gz"])
@pytest.mark.parametrize("layout", ["one block", "list", "deflated", "transposed"])
def test_a_cut_costs_what_is_behind_it(layout, zipped_file, tmp_path):
    frames = random_frames(N, seed=3, fd=layout == "list")
    path = tmp_path / "a.mf4"
    content, begins = logged(frames, path, layout)
    path.write_bytes(content)
    assert first_of(frames, read_frames(path)) == N
    for share in (0.02, 0.3, 0.5, 0.77, 0.99):
        end = begins[0] + int(share * (len(content) - begins[0]))
        path.write_bytes(gzip.compress(content[:end]) if zipped_file else content[:end])
        whole = sum(begin < end for begin in begins) - 1
        if layout == "transposed" and whole == 0:  # of every frame a few columns came
            with pytest.raises(ClutchestError, match=f"no CAN frame.*{N} × file ends early"):
                read_frames(path)
            continue
        given = read_frames(path)
        n = first_of(frames, given)
        assert n >= PER_BLOCK * whole
        if layout != "transposed":
            assert abs(n - share * N) < 0.02 * N
        ((reason, lost),) = given.rejected
        seconds = (frames.t_ns[n - 1] - frames.t_ns[0]) / 1e9
        assert lost == N - n
        assert reason == f"file ends early, frames behind {seconds:.3f} s are lost"


@pytest.mark.parametrize("end", [14_700, 20_000, 636_441, 1_000_001, 2_000_003])
def test_a_logger_that_never_finished(real, end, tmp_path, capfd):
    """Frames and, each as a record of its own, their payloads; neither length nor count stated."""
    content = real("j1939_css_idle.mf4").read_bytes()
    begin = 14_632
    path = tmp_path / "a.mf4"
    path.write_bytes(content[:end])
    whole = read_frames(real("j1939_css_idle.mf4"))
    given = read_frames(path)
    n = first_of(whole, given)
    assert abs(n / len(whole) - (end - begin) / (len(content) - begin)) < 0.002
    assert not given.rejected or given.rejected[0][1] == 1
    assert capfd.readouterr() == ("", "")


def test_nothing_is_lost_where_nothing_is_cut(real):
    assert read_frames(real("j1939_css_idle.mf4")).rejected == ()


def test_a_description_that_is_lost_is_told(tmp_path):
    """asammdf writes it last."""
    path = tmp_path / "a.mf4"
    write_frames(random_frames(N, seed=4), path)
    path.write_bytes(path.read_bytes()[:-9000])
    with pytest.raises(ClutchestError, match="ends early, and with its end what describes"):
        read_frames(path)


def test_replay_says_what_was_lost(tmp_path):
    vehicle = clutchest.load_vehicle("truck")
    frames = read_frames(locate("demo", "logs"))
    content, begins = logged(frames, tmp_path / "a.mf4", "deflated")
    end = begins[0] + (len(content) - begins[0]) // 2
    (tmp_path / "a.mf4").write_bytes(content[:end])
    signals = clutchest.read_log(tmp_path / "a.mf4", vehicle)
    (reason,) = [why for why in signals.counts.rejected if "ends early" in why]
    assert signals.counts.frames + signals.counts.rejected[reason] == len(frames)
    assert 0.4 < signals.end / 240 < 0.6


@pytest.mark.parametrize("end", [70, 200, 14_700, -5, None])
@pytest.mark.filterwarnings("error")
def test_nothing_is_heard_of_a_file_that_was_refused(tmp_path, end, capfd):
    """Neither by its reader nor, once it is forgotten, by the library's destructor."""
    path = tmp_path / "a.mf4"
    content = logged(random_frames(N, seed=3), path, "deflated")[0]
    damaged = content[:300] + b"\xff" * 400 + content[700:] if end is None else content[:end]
    path.write_bytes(damaged)
    for read in (lambda: clutchest.read_log(path, "truck"), lambda: inspect_logs([path])):
        with suppress(ClutchestError):
            read()
        gc.collect()
    assert capfd.readouterr().err == ""


def test_more_frames_than_there_are_take_no_room(tmp_path):
    """asammdf makes room for as many as a group states."""
    frames = random_frames(N, seed=5)
    path = tmp_path / "a.mf4"
    content = bytearray(logged(frames, path, "deflated")[0])
    place = content.index(struct.pack("<Q", N), content.index(b"##CG"))
    struct.pack_into("<Q", content, place, 300_000_000)
    path.write_bytes(content)
    tracemalloc.start()
    given = read_frames(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert first_of(frames, given) == N and peak < 50 << 20
    assert given.rejected[0][1] == 300_000_000 - N
