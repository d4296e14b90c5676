"""An edit of the pieces that readers are compiled from is seen by readers compiled before it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import clutchest

READ = """
import sys
from pathlib import Path
from clutchest.can.files import read_frames
print(read_frames(Path(sys.argv[1])).t_ns[0])
"""


@pytest.mark.slow
def test_an_edit_of_a_shared_piece_changes_what_is_read(tmp_path):
    package = tmp_path / "clutchest"
    shutil.copytree(
        Path(clutchest.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    log = tmp_path / "a.log"
    log.write_text("(7.000000) can0 123#01\n")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}

    def first_stamp() -> int:
        command = [sys.executable, "-c", READ, str(log)]
        done = subprocess.run(
            command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return int(done.stdout)

    assert first_stamp() == 7 * 10**9
    pieces = package / "can" / "text_scan.py"
    text = pieces.read_text(encoding="utf-8")
    assert "ns = whole * unit_ns\n" in text
    edited = text.replace("ns = whole * unit_ns\n", "ns = whole * unit_ns + 1\n")
    pieces.write_text(edited, encoding="utf-8")
    assert first_stamp() == 7 * 10**9 + 1
