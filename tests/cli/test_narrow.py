"""What verbs print is whole in a terminal of 80 columns: no name and no unit is cut."""

from __future__ import annotations

import sys

import pytest

from clutchest import cli


@pytest.fixture
def printed(monkeypatch, capsys, tmp_path):
    """What a command line prints in this process, 80 columns wide."""

    def call(*arguments: str) -> str:
        monkeypatch.setenv("COLUMNS", "80")
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["clutchest", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert not end.value.code
        return capsys.readouterr().out

    return call


def lies_within(out: str) -> bool:
    """But for the names of files, in a line of their own."""
    lines = [line for line in out.splitlines() if not line.startswith("Written to ")]
    return "…" not in out and all(len(line) <= 80 for line in lines)


@pytest.mark.parametrize("log", ["demo", "alsd"])
def test_an_inspection(printed, log):
    out = printed("inspect", log)
    assert lies_within(out)
    assert "jitter [ms]" in out and "gap [s]" in out
    names = (
        ("ClutchActuator", "18FF1000") if log == "demo" else ("ALSD_Temperatures.OilTemperature",)
    )
    assert all(name in out for name in names)


def test_how_a_torque_followed(printed):
    out = printed("replay", "alsd", "--vehicle", "alsd_rig")
    assert lies_within(out)
    assert all(word in out for word in ("overshoot", "settling", "release", "[ms]", "[Nm]", "[%]"))
