"""What a verb says that it expects, where it was given something else."""

from __future__ import annotations

import sys

import pytest

from clutchest import cli
from clutchest.reading.table_formats import table_formats


@pytest.fixture
def refused(monkeypatch, capsys):
    """What a command line that fails says on stderr."""

    def call(*arguments) -> str:
        monkeypatch.setattr(sys, "argv", ["clutchest", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert end.value.code
        return capsys.readouterr().err

    return call


@pytest.mark.parametrize(
    ("name", "content"), [("log.xyz", b"hello\n"), ("log.xyz", b""), ("log.csv", b"")]
)
@pytest.mark.parametrize(
    "verb",
    [
        ["replay", "LOG", "--vehicle", "truck"],
        ["inspect", "LOG"],
        ["convert", "LOG", "-o", "x.asc"],
    ],
)
def test_tables_are_named_where_they_are_taken(refused, tmp_path, verb, name, content):
    log = tmp_path / name
    log.write_bytes(content)
    said = refused(*(log if part == "LOG" else part for part in verb))
    assert "expected a CAN log" in said and "or a table of decoded signals (" in said
    for suffix in (kind.suffixes[0] for kind in table_formats() if kind.read):
        assert suffix in said.partition("a table of decoded signals")[2], suffix


def test_tables_are_not_named_where_they_are_not_taken(refused, tmp_path):
    log = tmp_path / "log.xyz"
    log.write_bytes(b"hello\n")
    said = refused("play", log, "-i", "virtual", "-c", "x")
    assert "expected a CAN log (" in said and "decoded signals" not in said
