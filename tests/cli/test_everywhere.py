"""Every verb on a terminal of any encoding, with paths that are no UTF-8."""

from __future__ import annotations

import json
import os
import shutil
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pandas as pd
import pytest

from clutchest import cli
from clutchest.can.files import read_frames, write_frames
from clutchest.shipped import locate

EFFECT = """
from clutchest.machine import Effect, Number
class Humidity(Effect):
    name, model, equation, scales = "humidity", "dry_clutch", "torque", {"clutch_torque": "change"}
    parameters = (Number("change", "1", -0.1, 0.1),)
"""
BUS = ("--interface", "virtual", "--channel", "everywhere")
# verb → arguments, in a folder with the files of `place`
VERBS = {
    "replay": "replay {p}/drive.log --vehicle {p}/v.toml --out {p}/r --state {p}/state.json "
    "--format csv --format xlsx --format mf4 --format mcap --report --innovations",
    "inspect": "inspect {p}/drive.log --dbc {p}/own.dbc --out {p}/i",
    "convert": "convert {p}/drive.log -o {p}/drive.mf4",
    "decode": "convert {p}/drive.log --vehicle {p}/v.toml -o {p}/drive.parquet",
    "simulate": "simulate --vehicle {p}/v.toml --scenario launches --seed 1 --duration 20 "
    "--effects {p}/own.py --effect humidity:change=0.05 -o {p}/simulated.log",
    "identify": "identify noise {p}/drive.log --vehicle {p}/v.toml --out {p}/f",
    "diagnose": "diagnose {p}/drive.log --vehicle {p}/v.toml --out {p}/d --explain",
    "discover": "discover {p}/drive.log --vehicle {p}/v.toml --effects {p}/own.py --out {p}/x",
    "monitor": "monitor --vehicle {p}/v.toml --out {p}/m --state {p}/state.json --duration 0.3 {b}",
    "play": "play {p}/short.log --speed 1000 {b}",
    "export": "export --vehicle {p}/v.toml --c --out {p}/c",
    "fleet": "fleet {p}/logs --vehicle {p}/v.toml --workers 1 --out {p}/fleet",
    "feedforward": "feedforward {p}/request.csv --vehicle alsd_rig --out {p}/plan",
    "trust": "trust {p}/v.toml",
}
SLOW = {"reproduce": "reproduce me12 --out {p}/me12"}


def filled(place: Path) -> Path:
    """Logs, a vehicle with a DBC and an effect of its own, a state, a request."""
    place.mkdir(parents=True, exist_ok=True)
    frames = read_frames(locate("demo", "logs")).sorted()
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    write_frames(frames.take(t < 30.0), place / "drive.log")
    write_frames(frames.take(t < 1.0), place / "short.log")
    (place / "logs" / "truck 1").mkdir(parents=True, exist_ok=True)
    shutil.copy(place / "drive.log", place / "logs" / "truck 1" / "monday.log")
    shutil.copy(locate("hdt_clutch.dbc", "dbc"), place / "own.dbc")
    (place / "own.py").write_text(EFFECT)
    text = locate("truck", "vehicles").read_text(encoding="utf-8")
    text = text.replace('dbc = ["hdt_clutch.dbc"]', 'dbc = ["own.dbc"]')
    (place / "v.toml").write_text(text, encoding="utf-8")
    request = pd.DataFrame({"time": [0.0, 1.0, 2.0], "torque_request": [0.0, 300.0, 100.0]})
    request.to_csv(place / "request.csv", index=False)
    return place


def called(monkeypatch, line: str, place: Path, encoding: str) -> tuple[int, bytes, bytes]:
    """Exit code, stdout and stderr of a command line."""
    words = [word.format(p=place, b="") for word in line.replace("{b}", " ".join(BUS)).split()]
    streams = [TextIOWrapper(BytesIO(), encoding=encoding) for _ in range(2)]
    monkeypatch.setattr(sys, "argv", ["clutchest", *words])
    monkeypatch.setattr(sys, "stdout", streams[0])
    monkeypatch.setattr(sys, "stderr", streams[1])
    with pytest.raises(SystemExit) as end:
        cli.main()
    monkeypatch.undo()
    for stream in streams:
        stream.flush()
    return end.value.code or 0, *(stream.buffer.getvalue() for stream in streams)


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """A folder of ordinary and one of strange names, both with a state."""
    import clutchest
    from clutchest.record.files import json_text

    folder = tmp_path_factory.mktemp("everywhere")
    left = clutchest.replay(clutchest.read_log("demo", "truck"), "truck").final
    made = {}
    for name, path in (
        ("plain", folder / "plain"),
        ("strange", folder / os.fsdecode(b"caf\xe9\xff")),
    ):
        try:
            made[name] = filled(path)
        except OSError:  # this file system has no such names
            continue
        (path / "state.json").write_text(json_text({**left, "time_ns": None}), encoding="utf-8")
    return made


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "cp437", "cp1252"])
@pytest.mark.parametrize("verb", [*VERBS, *SLOW])
def test_every_verb_prints_in_any_encoding(monkeypatch, places, verb, encoding):
    if verb in SLOW and encoding != "ascii":
        pytest.skip("once is enough of what takes a minute")
    line = {**VERBS, **SLOW}[verb]
    code, out, error = called(monkeypatch, line, places["plain"], encoding)
    assert (code, error) == (0, b""), error
    out.decode(encoding)
    if encoding == "ascii":
        code, help_text, error = called(
            monkeypatch, f"{line.split()[0]} --help", places["plain"], "ascii"
        )
        assert (code, error) == (0, b"") and b"Example" in help_text


@pytest.mark.slow
@pytest.mark.parametrize("verb", [*VERBS])
def test_every_verb_takes_paths_that_are_no_utf8(monkeypatch, places, verb):
    if "strange" not in places:
        pytest.skip("this file system has no such names")
    place = places["strange"]
    code, _, error = called(monkeypatch, VERBS[verb], place, "utf-8")
    assert (code, error) == (0, b""), error
    if verb == "export":  # CasADi would write elsewhere without a word
        assert (place / "c" / "truck.c").is_file()
    if verb not in {"convert", "decode", "play", "monitor"}:
        code, out, error = called(monkeypatch, f"{VERBS[verb]} --json", place, "utf-8")
        assert (code, error) == (0, b""), error
        json.loads(out)


@pytest.mark.slow
def test_what_was_written_there_is_read_again(monkeypatch, places):
    """A vehicle file that refers to files there, results in Parquet, a trusted file."""
    if "strange" not in places:
        pytest.skip("this file system has no such names")
    place = places["strange"]
    for line in (
        "identify noise {p}/drive.log --vehicle {p}/v.toml --out {p}/f",
        "replay {p}/drive.log --vehicle {p}/f/vehicle.toml --out {p}/again",
        "convert {p}/drive.log --vehicle {p}/v.toml -o {p}/drive.parquet",
        "replay {p}/drive.parquet --vehicle {p}/v.toml --out {p}/table --state {p}/state.json",
    ):
        code, _, error = called(monkeypatch, line, place, "utf-8")
        assert (code, error) == (0, b""), (line, error)
    with (place / "table" / "estimates.parquet").open("rb") as file:  # Arrow wants UTF-8 names
        assert len(pd.read_parquet(file)) > 100
