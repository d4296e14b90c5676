"""What nobody foresaw is one line with a file to send; output fits into any encoding."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from clutchest import cache, cli
from clutchest.cli import terminal


def test_an_unforeseen_error_is_one_line_with_a_file(monkeypatch, capsys):
    def broken() -> None:
        raise KeyError("out of the blue")

    monkeypatch.setattr(cli, "app", broken)
    with pytest.raises(SystemExit) as end:
        cli.main()
    error = capsys.readouterr().err
    assert end.value.code == 1 and len(error.splitlines()) == 1
    assert "unexpected error: KeyError" in error and "please report it with " in error
    file = Path(error.rsplit("with ", 1)[1].strip())
    text = file.read_text(encoding="utf-8")
    file.unlink()
    assert "out of the blue" in text and "in broken" in text


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux has a disk that is full")
def test_an_output_that_takes_nothing_is_one_line():
    with open("/dev/full", "w") as full:  # noqa: PTH123 - a device
        done = subprocess.run(
            [sys.executable, "-m", "clutchest", "--help"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (1, "clutchest: No space left on device\n")


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_what_is_loaded_meanwhile_and_fails_says_nothing():
    """As where a log is missing, and the program ends before the modules are there."""
    before = set(threading.enumerate())
    terminal.meanwhile("no_module_of_this_name")
    for thread in set(threading.enumerate()) - before:
        thread.join()


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp437"])
def test_what_an_encoding_lacks_has_a_form_in_ascii(monkeypatch, encoding):
    stream = TextIOWrapper(BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", TextIOWrapper(BytesIO(), encoding=encoding))
    terminal.printable()
    stream.write("82.1 ± 3.4 − ≥ Δ 漢 ┏━┓")
    stream.flush()
    text = stream.buffer.getvalue().decode(encoding)
    assert text.startswith("82.1 ") and " 3.4 " in text and "?" in text


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders of a user are the user's there")
def test_a_cache_that_others_may_write_to_is_not_used(tmp_path, monkeypatch, capsys):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("CLUTCHEST_CACHE", str(shared))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    used = cache.cache_folder()
    assert used != shared and used.stat().st_mode & 0o077 == 0
    assert cache.cache_folder() == used
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1 and "others may write there" in error


def test_a_damaged_entry_is_made_anew_and_said(tmp_path, capsys):
    path = cache.kept(tmp_path, "entry.py", "x = 1\n")
    assert cache.kept(tmp_path, "entry.py", "x = 1\n") == path
    assert capsys.readouterr().err == ""
    for content in (b"", b"x = 2\n", b"x"):
        path.write_bytes(content)
        assert cache.kept(tmp_path, "entry.py", "x = 1\n").read_text() == "x = 1\n"
        assert "damaged, made anew" in capsys.readouterr().err


@pytest.mark.slow
def test_no_encoding_ends_in_an_error(tmp_path):
    command = [sys.executable, "-m", "clutchest", "replay", "demo", "--vehicle", "truck"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [*command, "--out", str(tmp_path)], env=environment, capture_output=True, check=False
    )
    assert done.returncode == 0 and not done.stderr
    assert b"+/-" in done.stdout
