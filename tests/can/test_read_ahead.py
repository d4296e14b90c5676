"""A log that is read ahead is the log that is read; what cannot be is left to its reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from clutchest.can.files import read_frames
from clutchest.can.frames import Frames
from clutchest.can.read_ahead import read_ahead
from clutchest.errors import ClutchestError
from clutchest.shipped import locate


def test_its_frames_are_those_of_the_log() -> None:
    path = locate("demo", "logs")
    whole = read_frames(path)
    with read_ahead("demo") as begun:
        ahead = Frames.concatenate(begun[path])
    assert np.array_equal(ahead.t_ns, whole.t_ns) and np.array_equal(ahead.data, whole.data)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("gone.log", None),
        ("empty.log", b""),
        ("words.log", b"no log\n"),
        ("table.csv", b"time,a\n"),
    ],
)
def test_what_is_no_log_is_not_begun(tmp_path: Path, name: str, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with read_ahead(str(tmp_path / name)) as begun:
        assert begun == {}


def test_an_error_is_raised_where_its_block_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("clutchest.budgets.LOG_FRAMES", 1)
    log = tmp_path / "short.log"
    log.write_bytes(b"(1.0) can0 1#\n" * 20)
    with read_ahead(str(log)) as begun, pytest.raises(ClutchestError):
        list(begun[log])


def test_what_is_not_taken_ends() -> None:
    with read_ahead("demo") as begun:
        assert len(begun) == 1
