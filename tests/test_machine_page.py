"""The page "Your own machine": its blocks, in order, are files and commands that work."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "machine.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def run(block: str, folder: Path) -> None:
    for line in block.strip().splitlines():
        words = shlex.split(line)
        assert words[0] == "clutchest"
        command = [sys.executable, "-m", *words]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, f"{line}\n{done.stderr[-2000:]}"


@pytest.mark.slow
def test_every_block_works(tmp_path):
    for kind, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        first, _, rest = text.partition("\n")
        if kind == "sh":
            run(text, tmp_path)
        elif kind == "dbc":
            (tmp_path / "servo.dbc").write_text(text, encoding="utf-8")
        elif (name := first.removeprefix("# ")) != "pyproject.toml":
            with (tmp_path / name).open("a", encoding="utf-8") as file:
                file.write(rest + "\n")
    causes = json.loads((tmp_path / "causes" / "discovery.json").read_text())
    assert [cause["effect"] for cause in causes["causes"]] == ["stribeck"]
    faults = json.loads((tmp_path / "faults" / "diagnosis.json").read_text())["faults"]
    assert [fault["fault"] for fault in faults] == ["coulomb_change"]
    assert (tmp_path / "draft" / "vehicle.toml").is_file()


def test_the_finished_file_is_the_example():
    """What the page builds is machines/servo/servo.py, effect by effect."""
    blocks = [text for kind, text in BLOCK.findall(PAGE.read_text(encoding="utf-8"))]
    example = (PAGE.parents[1] / "machines" / "servo" / "servo.py").read_text(encoding="utf-8")
    page = "".join(blocks)
    for part in example.split("\n\n\n")[1:]:  # after the imports
        last = part.strip().splitlines()
        assert all(line in page for line in last if line.strip())
