"""The table of log formats: one entry each, and nothing beside it that has to know of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchest.can import formats
from clutchest.can.files import read_frames, write_frames
from clutchest.can.formats import log_formats
from clutchest.can.log_format import LogFormat
from clutchest.errors import ClutchestError
from samples import random_frames

ROOT = Path(__file__).parents[2]
WRITABLE = [entry for entry in log_formats() if entry.writable]

ONE_FILE = '''
"""Frames as numpy saves them."""
import numpy as np
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, begins_with

def read(source):
    t_ns = np.frombuffer(source.everything(1 << 20)[5:], np.int64)
    yield Frames(t_ns, *(getattr(Frames.empty(len(t_ns)), c) for c in
                         ("channel", "id", "flags", "length", "data")))

def lines(frames):
    yield b"TIMES" + frames.t_ns.tobytes()

FORMAT = LogFormat(".times", "times only", read, ".times", begins_with(b"TIMES"), lines=lines)
'''


@pytest.fixture
def one_more(tmp_path, monkeypatch):
    """A format of which there is one file in the folder of formats."""
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "times_only.py").write_text(ONE_FILE)
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(folder)])
    log_formats.cache_clear()
    yield
    log_formats.cache_clear()


def test_a_format_is_one_file(one_more, tmp_path):
    frames = random_frames(20, seed=1)
    for name in ("a.times", "a.times.gz"):
        assert write_frames(frames, tmp_path / name) == ()
        np.testing.assert_array_equal(read_frames(tmp_path / name).t_ns, frames.t_ns)
    with pytest.raises(ClutchestError, match=r"did you mean '\.times'"):
        write_frames(frames, tmp_path / "a.timess")
    (tmp_path / "b.log").write_bytes(b"no log at all")
    with pytest.raises(ClutchestError, match=r"expected .*\.times"):
        read_frames(tmp_path / "b.log")


def test_suffixes_and_titles_are_of_one_format_each():
    assert len({entry.suffix for entry in WRITABLE}) == len(WRITABLE)
    assert len({entry.title for entry in log_formats()}) == len(log_formats())


@pytest.mark.parametrize("entry", WRITABLE, ids=lambda entry: entry.suffix)
def test_content_is_known_whatever_the_suffix(entry: LogFormat, tmp_path):
    frames = random_frames(30, seed=2)
    frames = replace(frames, t_ns=frames.t_ns // 1000 * 1000, channel=np.zeros(30, np.uint8))
    write_frames(frames, tmp_path / f"a{entry.suffix}")
    head = (tmp_path / f"a{entry.suffix}").read_bytes()[:100_000]
    assert [e.suffix for e in log_formats() if e.sniff(head) is not None] == [entry.suffix]
    renamed = (tmp_path / f"a{entry.suffix}").rename(tmp_path / "another.txt")
    given = read_frames(renamed)
    np.testing.assert_array_equal(given.t_ns, frames.t_ns)
    np.testing.assert_array_equal(given.id, frames.id)
    np.testing.assert_array_equal(given.data, frames.data)


def test_the_earliest_content_counts(tmp_path):
    """A comment of a PEAK log that quotes candump, and the other way round."""
    (tmp_path / "a.trc").write_text(
        ";$FILEVERSION=1.1\n;\n(1.5) can0 123#01\n     1)      1.0  Rx  0123  1  07\n"
    )
    assert read_frames(tmp_path / "a.trc").data[0, 0] == 7
    (tmp_path / "a.log").write_text("(1.5) can0 123#01\n;$FILEVERSION=1.1\n")
    assert read_frames(tmp_path / "a.log").data[0, 0] == 1


def test_a_suffix_of_the_table_needs_its_content(tmp_path):
    """python-can would read these by their suffix, whatever stands in them."""
    for entry in WRITABLE:
        path = tmp_path / f"a{entry.suffix}"
        path.write_bytes(b"no log at all")
        with pytest.raises(ClutchestError):
            read_frames(path)


def row(entry: LogFormat) -> str:
    """The entry's row in docs/files.md."""
    suffix = f"`{entry.suffix}`" if entry.suffix else "others"
    losses = "; ".join(loss.what for loss in entry.losses) or "–"
    return f"| {suffix} | {entry.about} | {losses if entry.writable else 'not written'} |"


def test_the_documentation_has_the_table():
    text = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    _, _, behind = text.partition("| suffix | what | cannot carry |\n|---|---|---|\n")
    decoded = "| `.parquet` | decoded signals | frames |"
    assert behind.splitlines()[: len(log_formats()) + 2] == [*map(row, log_formats()), decoded, ""]


def test_the_readme_names_every_suffix():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (paragraph,) = (part for part in text.split("\n\n") if part.startswith("Logs may be candump"))
    named = [entry for entry in WRITABLE if entry.suffix != ".log"]
    assert [entry.suffix for entry in named if f"`{entry.suffix}`" not in paragraph] == []
