"""A vehicle file drafted from a log: it must agree with the one that made the log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError
from clutchest.reading.inspection import inspect_logs
from clutchest.shipped import locate
from clutchest.simulated import write_simulation
from clutchest.vehicle import load_vehicle

DATA = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture(scope="module")
def truck():
    return load_vehicle("truck")


@pytest.fixture(scope="module")
def log(truck, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "my drive.log"
    write_simulation(path, truck, "launches", 4, duration=20.0)
    return path


@pytest.fixture
def send_long():
    """Engine configuration in packets, as broadcast, with this reference torque in Nm."""

    def send(torque: int) -> Frames:
        payload = bytearray(b"\xff" * 42)
        payload[19:21] = torque.to_bytes(2, "little")
        frames = Frames.empty(7)
        frames.t_ns[:] = 1_700_000_000 * 10**9 + np.arange(7) * 10_000_000
        frames.id[:], frames.length[:] = 0x1CEBFF00, 8
        frames.id[0] = 0x1CECFF00
        frames.flags[:] = Flag.EXTENDED
        announced = bytes([32, 39, 0, 6, 255, 0xE3, 0xFE, 0])
        frames.data[0, :8] = np.frombuffer(announced, np.uint8)
        for k in range(6):
            frames.data[k + 1, :8] = [k + 1, *payload[7 * k : 7 * k + 7]]
        return frames

    return send


@pytest.fixture(scope="module")
def found(log):
    return inspect_logs([log])


def real(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"no {name} here: real logs are not part of the repository")
    return DATA / name


def test_finds_what_the_truck_maps(found, truck):
    assert set(found.candidates) == set(truck.signals)
    for name, signal in truck.signals.items():
        best = found.candidates[name][0]
        assert (best.message, best.signal) == (signal.bus.message, signal.bus.signal)
    torque = truck.signals["engine_torque"]
    assert found.companions["engine_torque"]["friction"].signal == torque.friction.signal
    assert found.companions["engine_torque"]["fraction"].signal == torque.fraction.signal


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "scenario"), [("alsd_rig", "rig-steps"), ("alsd_car", "car")])
def test_finds_what_the_differential_maps(vehicle, scenario, tmp_path):
    """Its vehicle file, drafted from a log, has every signal, in its unit, and drives the
    estimator as it is."""
    shipped, log = load_vehicle(vehicle), tmp_path / "drive.log"
    write_simulation(log, shipped, scenario, 4, duration=8.0)
    found = inspect_logs([log])
    assert found.machine.name == shipped.machine.name
    assert set(found.candidates) == set(shipped.signals)
    for name, signal in shipped.signals.items():
        best = found.candidates[name][0]
        assert (best.message, best.signal) == (signal.bus.message, signal.bus.signal)
    found.write_vehicle(tmp_path / "vehicle.toml", tmp_path / "vehicle.toml")
    run = clutchest.replay(log, tmp_path / "vehicle.toml")
    assert run.summary["contradiction"] is None
    assert run.tracks[0].engagements


def test_draft_replays_at_once_and_names_its_guess(found, log, truck, tmp_path):
    assert found.missing == ()
    (guess,) = found.draft.guesses()
    assert guess.startswith("signals.engine_torque: reference = 3500 Nm") and "SPN 544" in guess
    target = tmp_path / "vehicle.toml"
    found.write_vehicle(target, target)
    assert "# GUESS signals.engine_torque: reference" in target.read_text()
    vehicle = load_vehicle(target)
    assert set(vehicle.guessed) == set(vehicle.parameters) == set(truck.parameters)
    mine, theirs = clutchest.read_log(log, vehicle), clutchest.read_log(log, truck)
    for name in truck.signals:
        np.testing.assert_array_equal(mine[name].value, theirs[name].value)
        assert vehicle.signals[name].noise >= truck.signals[name].noise
    assert "# the log has every signal of truck by name" in target.read_text()
    runs = [clutchest.replay(*each).summary for each in ((mine, vehicle), (theirs, truck))]
    drafted, shipped = (" ".join(run["warnings"]) for run in runs)
    assert "all 19; into the slip energy they bring kiss_point ±" in drafted
    assert "clutchest identify determines them: torque-curve (kiss_point)" in drafted
    assert "100 % of engine_torque is 3500 Nm; torque and energy scale with it" in drafted
    assert "guessed" not in shipped and "not listed" not in shipped
    brought, total = runs[0]["slip_energy_std_from_J"], runs[0]["slip_energy_std_J"]
    assert next(iter(brought)) == "kiss_point" and 0.5 * total < brought["kiss_point"] <= total
    slipping = [run["modes_s"]["slipping"] for run in runs]
    assert runs[0]["contradiction"] is None and slipping[0] == pytest.approx(slipping[1], abs=0.5)


@pytest.mark.slow
def test_messages_of_another_period_than_the_database_states(log, tmp_path):
    """A healthy vehicle that sends EEC1 half as often as the database says is not late."""
    frames = read_frames(log)
    eec1 = np.flatnonzero(frames.id >> 8 & 0xFFFF == 0xF004)
    keep = np.ones(len(frames), bool)
    keep[eec1[1::2]] = False
    write_frames(frames.take(keep), tmp_path / "half.log")
    found = inspect_logs([tmp_path / "half.log"])
    found.write_vehicle(tmp_path / "vehicle.toml", tmp_path / "vehicle.toml")
    vehicle = load_vehicle(tmp_path / "vehicle.toml")
    stated = {s.bus.message: s.period for s in vehicle.signals.values()}
    assert stated["EEC1"] == pytest.approx(0.02, rel=0.02)
    assert all(period is None for name, period in stated.items() if name != "EEC1")
    run = clutchest.replay(clutchest.read_log(tmp_path / "half.log", vehicle), vehicle)
    assert not [f.fault for f in clutchest.diagnose(run).faults]


def test_the_reference_torque_is_read_from_the_bus(send_long, log, truck, tmp_path):
    """Engine configuration, 39 bytes in six packets, states what 100 % stands for."""
    frames = Frames.concatenate([read_frames(log), send_long(2386)]).sorted()
    write_frames(frames, tmp_path / "a.log")
    found = inspect_logs([tmp_path / "a.log"])
    assert found.draft.guesses() == ()
    draft = found.draft.vehicle("a", "dry_clutch", tmp_path / "v.toml", ())
    assert draft.signals["engine_torque"].reference == 2386.0
    assert draft.parameters["engine_torque_max"].value == 2386.0


def test_a_dbc_of_another_bus_is_an_error(log, tmp_path):
    (tmp_path / "other.dbc").write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: X\nBO_ 291 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "" X\n'
    )
    words = r"0 of \d+ ids of my drive\.log are in other\.dbc: .*123; one has 11 bits only"
    with pytest.raises(ClutchestError, match=words):
        inspect_logs([log], [tmp_path / "other.dbc"])


def test_a_shipped_database_by_its_name(found, log, tmp_path):
    named = inspect_logs([log], ["hdt_clutch"])
    assert [file.path for file in named.dbc] == [locate("hdt_clutch", "dbc")]
    assert {row.message for row in named.rows} == {row.message for row in found.rows}
    named.write_vehicle(tmp_path / "own.toml", tmp_path / "own.toml")
    assert load_vehicle(tmp_path / "own.toml").dbc[0].path == locate("hdt_clutch", "dbc").resolve()


def test_rates_add_up_over_relative_clocks(tmp_path):
    path, again = tmp_path / "console.log", tmp_path / "again.log"
    for each in (path, again):
        lines = (f" (000.{k * 10000:06d})  can0  123   [2]  AB CD\n" for k in range(50))
        each.write_text("".join(lines))
    once, twice = inspect_logs([path]), inspect_logs([path, again])
    assert once.rows[0].rate_hz == pytest.approx(100.0)
    assert twice.rows[0].count == 2 * once.rows[0].count == 100
    assert twice.rows[0].rate_hz == pytest.approx(100.0, rel=0.03)
    assert twice.duration_s == pytest.approx(2 * once.duration_s)


def test_nothing_known_names_everything(tmp_path):
    path = tmp_path / "other.log"
    path.write_text("(1700000000.000000) can0 123#0102\n(1700000000.010000) can0 123#0102\n")
    found = inspect_logs([path])
    assert found.candidates == {}
    for name in ("engine_speed", "input_shaft_speed", "engine_torque", "slave_position"):
        assert any(text.startswith(f"signals.{name} ") for text in found.missing), name
    assert not any("ambient_temp" in text for text in found.missing)  # has a default


def test_t270_maps_by_spn():
    found = inspect_logs([real("j1939_t270_drive.log")])
    by = {name: c[0].by for name, c in found.candidates.items()}
    assert by["engine_speed"] == by["input_shaft_speed"] == by["engine_torque"] == "SPN"
    speed = found.candidates["engine_speed"][0]
    assert 1100 < speed.low < speed.high < 1800
    # two controllers send CCVS1; only one of them knows the speed
    assert [c.sender for c in found.candidates["vehicle_speed"]] == [0x00, 0x31]
    assert any(text.startswith("signals.slave_position") for text in found.missing)


def test_gt350_maps_by_name():
    log, dbc = real("gt350_launch.trc"), real("ford_lincoln_base_pt.dbc")
    found = inspect_logs([log], [dbc])
    best = {name: c[0].signal for name, c in found.candidates.items()}
    assert best["engine_speed"] == "EngAout_N_Actl"
    assert best["engine_torque"] == "TrnAin_Tq_Actl"
    assert best["coolant_temp"] == "EngClnt_Te_Actl"
    line = found.draft.driveline
    assert (line.wheel.layout.name, line.other.layout.name) == ("WhlRl_W_Meas", "WhlRr_W_Meas")
    measured = np.array([12.12, 8.28, 5.97, 4.61, 3.72, 2.38])  # by hand, with the pedal up
    assert [gear.ratio for gear in line.gears] == pytest.approx(measured, rel=0.02)


def test_css_idles():
    found = inspect_logs([real("j1939_css_idle.mf4")])
    speed = found.candidates["engine_speed"][0]
    assert 646 < speed.low < speed.high < 654.5


def test_a_log_that_is_given_twice_is_drafted_once(log, tmp_path):
    copy = tmp_path / "copy.asc"
    write_frames(read_frames(log), copy)
    once, twice = inspect_logs([log]), inspect_logs([log, copy])
    assert twice.frames == once.frames and twice.rejected == {"duplicate": once.frames}
    twice.write_vehicle(tmp_path / "v.toml", tmp_path / "v.toml")
    load_vehicle(tmp_path / "v.toml")
