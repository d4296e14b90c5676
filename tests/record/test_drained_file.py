"""A file that is written through a pipe is whole, and a disk that is full stops nobody."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from clutchest.record.drained_file import DrainedFile, open_files

pytestmark = pytest.mark.skipif(open_files() is None, reason="pipes with names, of POSIX")


def drained(path: Path, data: bytes) -> DrainedFile:
    file = DrainedFile(path, open_files())
    with file.entrance() as path:
        entrance = path.open("wb")
    with entrance:
        entrance.write(data)
    file.close(60.0)
    return file


def test_all_that_is_written_is_in_the_file(tmp_path):
    data = np.random.default_rng(1).bytes(3_000_000)
    path = tmp_path / "file"
    assert not drained(path, data).problem
    assert path.read_bytes() == data


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is always full, of Linux")
def test_a_full_disk_is_reported_and_the_writer_goes_on():
    assert drained(Path("/dev/full"), bytes(3_000_000)).problem == os.strerror(errno.ENOSPC)
