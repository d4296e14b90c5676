"""Recorded logs: what is in them, and that every format carries it."""

from __future__ import annotations

import numpy as np
import pytest

import can
from clutchest.can.database import load
from clutchest.can.decode import decode, rows_of
from clutchest.can.files import read_frames, write_frames
from clutchest.can.survey import survey
from clutchest.signals import Why


def test_truck_in_the_console_layout(real, truck):
    frames = read_frames(real("j1939_t270_drive.log"))
    assert len(frames) == 19_957 and not frames.absolute and frames.rejected == ()
    assert frames.t_ns[-1] == 29_997_509_000
    message = truck.message("ETC1")
    columns = decode(frames, rows_of(frames, message), message, list(message.signals))
    assert len(columns["InputShaftSpeed"].value) == 3000
    assert set(columns["PercentClutchSlip"].why) == {Why.NOT_AVAILABLE}
    lockup = columns["TorqueConverterLockupEngaged"]
    at = lockup.rows[np.argmax(lockup.value == 1)]
    assert frames.t_ns[at] * 1e-9 == pytest.approx(1.23, abs=0.005)

    speed = truck.message("EEC1")
    engine = decode(frames, rows_of(frames, speed), speed, ["EngineSpeed"])["EngineSpeed"]
    slip = np.interp(frames.t_ns[lockup.rows], frames.t_ns[engine.rows], engine.value)
    slip -= columns["InputShaftSpeed"].value
    t = frames.t_ns[lockup.rows] * 1e-9
    assert slip[np.searchsorted(t, 0.23)] == pytest.approx(313, abs=10)
    assert slip[np.argmax(lockup.value == 1)] == pytest.approx(10.8, abs=2)

    gears = truck.message("ETC2")
    gear = decode(frames, rows_of(frames, gears), gears, ["CurrentGear"])["CurrentGear"].value
    assert [int(g) for g in dict.fromkeys(gear)] == [2, 3, 4]


def test_rates_of_the_truck(real, truck):
    frames = read_frames(real("j1939_t270_drive.log"))
    found = {row.message: row for row in survey(frames, [truck]) if row.message}
    assert found["EEC1"].rate_hz == pytest.approx(50, abs=0.5)
    assert found["ETC1"].rate_hz == pytest.approx(100, abs=0.5)
    assert found["ETC2"].rate_hz == pytest.approx(10, abs=0.2)


def test_idle_in_mf4_by_group_and_foreign_source(real, truck):
    frames = read_frames(real("j1939_css_idle.mf4"))
    assert len(frames) == 57_849 and frames.absolute
    for database in (truck, load([real("CSS-Electronics-SAE-J1939-DEMO.dbc")])):
        message = database.message("EEC1")
        rows = rows_of(frames, message)
        speed = decode(frames, rows, message, ["EngineSpeed"])["EngineSpeed"].value
        assert len(speed) > 1000
        assert speed.min() > 646 and speed.max() < 655
    assert len(rows_of(frames, truck.message("ETC1"))) == 0


def test_mf4_is_like_python_can(real):
    path = real("j1939_css_idle.mf4")
    frames = read_frames(path)
    with can.LogReader(path) as reader:
        for row, message in zip(range(2000), reader, strict=False):
            assert message.arbitration_id == frames.id[row]
            assert bytes(message.data) == frames.data[row, : frames.length[row]].tobytes()
            assert abs(message.timestamp - frames.t_ns[row] * 1e-9) < 1e-6


def test_car_in_trc(real):
    frames = read_frames(real("gt350_launch.trc"))
    assert len(frames) == 50_638 and frames.rejected == () and frames.absolute
    assert (frames.t_ns[-1] - frames.t_ns[0]) * 1e-9 == pytest.approx(33.22, abs=0.01)
    assert len(survey(frames)) == 72
    database = load([real("ford_lincoln_base_pt.dbc")])
    message = next(m for m in database.messages.values() if "EngAout_N_Actl" in m.signals)
    rows = rows_of(frames, message)
    speed = decode(frames, rows, message, ["EngAout_N_Actl"])["EngAout_N_Actl"].value
    assert np.nanmin(speed) > 490 and np.nanmax(speed) < 1150 * 8


@pytest.mark.parametrize("suffix", [".log", ".asc.gz", ".blf", ".trc", ".csv", ".mf4"])
def test_every_format_carries_a_real_log(suffix, real, tmp_path):
    frames = read_frames(real("j1939_t270_drive.log")).take(np.arange(5000))
    write_frames(frames, tmp_path / f"a{suffix}")
    back = read_frames(tmp_path / f"a{suffix}")
    for column in ("t_ns", "channel", "id", "flags", "length", "data"):
        np.testing.assert_array_equal(getattr(back, column), getattr(frames, column))
    assert not back.absolute
