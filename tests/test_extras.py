"""What is left where a library is not installed that only some users need."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from clutchest.extras import EXTRAS

ROOT = Path(__file__).parents[1]
WITHOUT = """
import sys
for library in {without!r}:
    sys.modules[library] = None
from clutchest.cli import main
sys.argv = ["clutchest", *{arguments!r}]
main()
"""


def run(*arguments: str, without: tuple[str, ...]) -> subprocess.CompletedProcess[str]:
    script = WITHOUT.format(without=without, arguments=arguments)
    return subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env={**os.environ}
    )


def test_every_extra_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert set(EXTRAS.values()) <= set(extras)
    (everything,) = extras["all"]
    assert set(everything.partition("[")[2].rstrip("]").split(",")) == set(EXTRAS.values())
    assert not {name.lower() for name in EXTRAS} & {
        line.split(">")[0].split("[")[0] for line in project["dependencies"]
    }


@pytest.mark.slow
def test_a_replay_needs_none_of_them(tmp_path: Path) -> None:
    done = run(
        "replay", "demo", "--vehicle", "truck", "--out", str(tmp_path), without=tuple(EXTRAS)
    )
    assert done.returncode == 0, done.stderr
    names = {path.name for path in tmp_path.iterdir()}
    assert {"estimates.parquet", "summary.json", "state.json"} <= names
    assert "recording.rrd" not in names
    assert "pip install 'clutchest[rerun]'" in done.stdout


@pytest.mark.parametrize(
    ("library", "arguments"),
    [
        ("matplotlib", ["identify", "disc", "demo", "--vehicle", "truck"]),
        ("asammdf", ["convert", "demo", "-o", "{}/x.mf4"]),
        ("openpyxl", ["inspect", "{}/table.xlsx"]),
    ],
)
def test_what_is_missing_is_said(library: str, arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "table.xlsx").write_bytes(b"PK")
    given = [argument.format(tmp_path) for argument in arguments]
    done = run(*given, without=(library,))
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert f"pip install 'clutchest[{EXTRAS[library]}]'" in line
