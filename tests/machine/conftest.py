"""The example of a user's machine, and drives of it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from clutchest import cli
from clutchest.simulated import write_simulation
from clutchest.vehicle import load_vehicle

SERVO = Path(__file__).parents[2] / "machines" / "servo"


@pytest.fixture(scope="session")
def servo():
    return load_vehicle(SERVO / "servo.toml", trust=True)


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a command line in this process: (exit code, stdout, stderr)."""

    def call(*arguments) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["clutchest", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        return (end.value.code or 0, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def short_log(tmp_path_factory, servo) -> Path:
    """20 s of a healthy motor."""
    path = tmp_path_factory.mktemp("servo") / "short.log"
    write_simulation(path, servo, "mixed", 1, duration=20.0)
    return path


@pytest.fixture(scope="session")
def healthy_log(tmp_path_factory, servo) -> Path:
    """A minute of another one, whose parameters are drawn from their spreads."""
    path = tmp_path_factory.mktemp("servo") / "healthy.log"
    write_simulation(path, servo, "mixed", 5, duration=60.0)
    return path
