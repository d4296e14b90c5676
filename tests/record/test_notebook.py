"""The viewer in a notebook is given the whole recording."""

from __future__ import annotations

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

import clutchest
from clutchest.record.rerun import write_recording


def entities(path: Path) -> set[str]:
    reader = RrdReader(path)
    if not reader.recordings():  # a blueprint
        return set()
    return {chunk.entity_path for chunk in reader.stream().to_chunks()}


def test_the_viewer_is_given_what_a_recording_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notebook = pytest.importorskip("rerun_notebook")
    sent: list[bytes] = []
    monkeypatch.setattr(notebook.Viewer, "send_rrd", lambda viewer, data: sent.append(data))
    run = clutchest.replay(clutchest.simulate("truck", "launches", seed=3, duration=60), "truck")
    clutchest.view(run)
    shown: set[str] = set()
    for k, part in enumerate(sent):
        (tmp_path / f"{k}.rrd").write_bytes(part)
        shown |= entities(tmp_path / f"{k}.rrd")
    write_recording(run, tmp_path / "written.rrd")
    assert "/state/temp_disc" in shown and entities(tmp_path / "written.rrd") <= shown


def test_without_the_viewer_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("clutchest.extras.installed", lambda library: False)
    run = clutchest.replay(clutchest.simulate("truck", "launches", seed=3, duration=20), "truck")
    with pytest.raises(clutchest.ClutchestError, match=r"clutchest\[notebook\]"):
        clutchest.view(run)
