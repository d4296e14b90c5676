"""Logs of several buses, each with a database of its own: one id means something else on each."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest import can
from clutchest.can.database import DatabaseFile, load
from clutchest.can.encode import encode
from clutchest.can.files import write_frames
from clutchest.can.frame_filter import FrameFilter
from clutchest.can.frames import Frames
from clutchest.can.survey import survey
from clutchest.cli import main
from clutchest.errors import ClutchestError
from clutchest.simulated import simulate_frames
from clutchest.vehicle import dump_vehicle, load_vehicle

ENGINE = """VERSION ""
BU_: ECM
BO_ 256 Status: 8 ECM
 SG_ EngineSpeed : 0|16@1+ (0.125,0) [0|8000] "rpm" ECM
 SG_ EngineTorque : 16|16@1+ (0.5,-5000) [-5000|5000] "Nm" ECM
"""
GEARBOX = """VERSION ""
BU_: TCM
BO_ 256 Status: 8 TCM
 SG_ InputShaftSpeed : 0|16@1+ (0.25,0) [0|8000] "rpm" TCM
BO_ 257 Oil: 8 TCM
 SG_ OilTemp : 0|8@1+ (1,-40) [-40|210] "degC" TCM
"""
SIGNALS = """
[signals.engine_speed]
message = "Status@0"
signal = "EngineSpeed"
unit = "rpm"
noise = 0.06
period = 0.01

[signals.engine_torque]
message = "Status@0"
signal = "EngineTorque"
unit = "Nm"
noise = 5.0
period = 0.01

[signals.input_shaft_speed]
message = "Status@3"
signal = "InputShaftSpeed"
unit = "rpm"
noise = 0.06
period = 0.01
"""
HEAD = """name = "car"
model = "dry_clutch"
dbc = [{ file = "engine.dbc", channel = 0 }, { file = "gearbox.dbc", channel = 3 }]
"""
T_NS = 10_000_000 * np.arange(200)
ENGINE_RPM, SHAFT_RPM = np.linspace(800.0, 1600.0, 200), np.linspace(0.0, 1500.0, 200)


@pytest.fixture
def files(tmp_path: Path) -> tuple[DatabaseFile, DatabaseFile]:
    (tmp_path / "engine.dbc").write_text(ENGINE)
    (tmp_path / "gearbox.dbc").write_text(GEARBOX)
    return DatabaseFile(tmp_path / "engine.dbc", 0), DatabaseFile(tmp_path / "gearbox.dbc", 3)


@pytest.fixture
def car(files, tmp_path: Path) -> Path:
    text = load_vehicle("truck").path.read_text(encoding="utf-8")
    path = tmp_path / "car.toml"
    path.write_text(HEAD + SIGNALS + "\n[parameters]" + text.partition("[parameters]")[2])
    return path


@pytest.fixture
def frames(files) -> Frames:
    """Both buses, and a third one on which the same id is sent too."""
    bus = load(files)
    engine = {"EngineSpeed": ENGINE_RPM, "EngineTorque": np.full(200, 100.0)}
    shaft = {"InputShaftSpeed": SHAFT_RPM}
    return Frames.concatenate(
        [
            encode(bus.message("Status@0"), engine, T_NS, channel=0),
            encode(bus.message("Status@3"), shaft, T_NS + 1_000, channel=3),
            encode(bus.message("Oil"), {"OilTemp": np.full(200, 80.0)}, T_NS + 2_000, channel=3),
            encode(
                bus.message("Status@3"), {"InputShaftSpeed": np.full(200, 9.0)}, T_NS, channel=1
            ),
        ]
    ).sorted()


def test_a_name_of_several_channels_becomes_one_for_each(files):
    bus = load(files)
    assert set(bus.messages) == {"Status@0", "Status@3", "Oil"} and bus.warnings == ()
    assert bus.find(256, False, 3).name == "Status@3"
    assert bus.find(256, False, 1) is None
    with pytest.raises(ClutchestError, match="several channels; expected Status@0 or Status@3"):
        bus.message("Status")
    both = load([files[0], replace(files[1], channel=0)])
    assert "is already known, ignored here" in both.warnings[0]


def test_each_channel_is_decoded_by_its_own(files, frames):
    tables = frames.decode({0: files[0].path, 3: [files[1].path]})
    assert set(tables) == {"Status@0", "Status@3", "Oil"}
    np.testing.assert_allclose(tables["Status@0"]["EngineSpeed"], ENGINE_RPM, atol=0.07)
    np.testing.assert_allclose(tables["Status@3"]["InputShaftSpeed"], SHAFT_RPM, atol=0.13)
    assert set(tables["Oil"]["channel"].to_pylist()) == {3}
    rows = survey(frames, [load(files)])
    assert [(r.channel, r.message) for r in rows] == [
        (0, "Status@0"),
        (1, None),
        (3, "Status@3"),
        (3, "Oil"),
    ]


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".mf4"])
def test_a_vehicle_file_names_the_database_of_each_channel(car, frames, suffix, tmp_path):
    log = tmp_path / f"a{suffix}"
    write_frames(frames, log)
    signals = clutchest.read_log(log, car)
    np.testing.assert_allclose(
        signals["engine_speed"].value, ENGINE_RPM * np.pi / 30, atol=0.07 * np.pi / 30
    )
    np.testing.assert_allclose(
        signals["input_shaft_speed"].value, SHAFT_RPM * np.pi / 30, atol=0.13 * np.pi / 30
    )
    assert signals.counts.rejected == {"not mapped": 400}, "the third bus, and the oil"
    assert signals.warnings == ()


def test_frames_of_another_bus_are_not_kept_in_memory(files):
    bus = load(files)
    t_ns = 1_000_000 * np.arange(5000)
    frames = encode(
        bus.message("Status@3"), {"InputShaftSpeed": np.full(5000, 9.0)}, t_ns, channel=1
    )
    kept = FrameFilter([bus.message("Status@0"), bus.message("Status@3")], 10**12).kept(frames)
    assert len(kept) < 500, "those that tell when the bus was active"
    assert dict(kept.passed_over) == {"not mapped": 5000 - len(kept)}


def test_it_is_written_and_read_back(car, tmp_path):
    vehicle = load_vehicle(car)
    (tmp_path / "deep").mkdir()
    dump_vehicle(vehicle, tmp_path / "deep" / "again.toml")
    again = load_vehicle(tmp_path / "deep" / "again.toml")
    assert [(f.path.resolve(), f.channel) for f in again.dbc] == [
        (tmp_path / "engine.dbc", 0),
        (tmp_path / "gearbox.dbc", 3),
    ]
    assert again.signals == vehicle.signals


def test_a_channel_that_contradicts_it_is_refused(car, frames, tmp_path):
    write_frames(frames, tmp_path / "a.asc")
    own = 'signal = "InputShaftSpeed"'
    car.write_text(car.read_text().replace(own, f"{own}\nchannel = 1"))
    with pytest.raises(ClutchestError, match=r"input_shaft_speed: channel = 1, but .* channel 3"):
        clutchest.read_log(tmp_path / "a.asc", car)


def test_simulated_frames_are_on_their_channel(car):
    frames, _ = simulate_frames(load_vehicle(car), "launches", 1, duration=5.0)
    assert set(frames.channel.tolist()) == {0, 3}


def test_inspect_drafts_them(files, frames, tmp_path, monkeypatch):
    write_frames(frames, tmp_path / "a.asc")
    named = [f"--dbc={file.channel}={file.path}" for file in files]
    given = ["clutchest", "inspect", str(tmp_path / "a.asc"), *named, "--out", "first"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", given)
    with suppress(SystemExit):
        main()
    about = json.loads((tmp_path / "first" / "inspect.json").read_text())
    assert about["signals"]["input_shaft_speed"][0]["message"] == "Status@3"
    draft = load_vehicle(tmp_path / "first" / "vehicle.toml")
    assert [file.channel for file in draft.dbc] == [0, 3]
    assert set(clutchest.read_log(tmp_path / "a.asc", draft)) >= {"engine_speed"}


def test_a_database_without_a_channel_is_of_all(files, frames):
    tables = frames.decode(files[1].path)
    assert set(tables["Status"]["channel"].to_pylist()) == {0, 1, 3}
    assert isinstance(tables, can.DecodedFrames)
