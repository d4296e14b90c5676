from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.reading.gears import engaged_gear
from clutchest.reading.mapping import signals_of
from clutchest.shipped import shipped
from clutchest.signals import Why
from clutchest.simulated import simulate
from clutchest.vehicle import BusSignal, load_vehicle

RPM = np.pi / 30


def log(*parts: Frames) -> Frames:
    return Frames.concatenate(parts).sorted()


def test_torque_is_actual_plus_fraction_less_friction_of_the_reference(send, truck, bus) -> None:
    # Friction 5 % from 0.105 s, 8 % from 0.305 s; a fraction that is not available counts as 0.
    eec1 = send(
        "EEC1",
        period=0.1,
        EngineSpeed=1000.0,
        ActualEnginePercentTorque=[40, 40, 40, -10, np.nan],
        ActualEnginePercentTorqueFractional=[0.5, np.nan, 0.875, 0.25, 0.0],
    )
    eec3 = send("EEC3", start=0.105, period=0.2, NominalFrictionPercentTorque=[5.0, 8.0])
    torque = signals_of(log(eec1, eec3), truck, bus)["engine_torque"]
    percent = [40.5 - 5, 40.0 - 5, 40.875 - 5, -9.75 - 5]
    assert torque.value[:4] == pytest.approx(np.array(percent) * 35.0, abs=1e-9)
    assert torque.why.tolist() == [0, 0, 0, 0, Why.NOT_AVAILABLE]
    assert torque.unit == "Nm"


def test_without_friction_torque_there_is_a_warning(send, truck, bus) -> None:
    eec1 = send("EEC1", ActualEnginePercentTorque=[40.0, 41.0])
    signals = signals_of(eec1, truck, bus)
    assert signals["engine_torque"].value == pytest.approx([1400.0, 1435.0])
    assert any(
        "no valid friction torque (EEC3.NominalFrictionPercentTorque)" in w
        for w in signals.warnings
    )


def test_a_position_in_percent_is_one_of_its_stroke(edited, tmp_path) -> None:
    """What is simulated onto a bus that sends % of 64 mm is read as from one that sends mm."""
    text = shipped("dbc")["hdt_clutch"].read_text(encoding="utf-8")
    mm = 'SlavePosition : 0|16@1+ (0.001,0) [0|64.255] "mm"'
    assert mm in text
    percent = text.replace(mm, 'SlavePosition : 0|16@1+ (0.002,0) [0|130] "%"')
    (tmp_path / "percent.dbc").write_text(percent, encoding="utf-8")
    path = edited(
        ("hdt_clutch.dbc", "percent.dbc"),
        (
            'signal = "SlavePosition"\nunit = "mm"',
            'signal = "SlavePosition"\nunit = "%"\nreference = { value = 6.4, unit = "cm" }',
        ),
    )
    read, sent = (simulate(v, "launches", 1, duration=20.0) for v in (path, "truck"))
    assert read["slave_position"].unit == "mm"
    assert read["slave_position"].value == pytest.approx(sent["slave_position"].value, abs=0.002)
    assert np.ptp(read["slave_position"].value) > 5.0


def test_canonical_units_and_times(send, truck, bus) -> None:
    frames = log(
        send("EEC1", start=2.0, EngineSpeed=[600.0, 1200.0]),
        send("ClutchActuator", start=2.002, SlavePosition=[38.4], MotorPosition=[0.0]),
        send("CCVS1", start=2.004, WheelBasedVehicleSpeed=[36.0]),
    )
    signals = signals_of(frames, truck, bus)
    assert signals["engine_speed"].value == pytest.approx([600 * RPM, 1200 * RPM])
    assert signals["engine_speed"].time == pytest.approx([0.0, 0.01])
    assert signals["slave_position"].value == pytest.approx([38.4])
    assert signals["vehicle_speed"].value == pytest.approx([10.0])
    assert signals["vehicle_speed"].time == pytest.approx([0.004])
    assert signals.start_ns == 1_700_000_002_000_000_000
    assert signals.end == pytest.approx(0.01)


def test_every_frame_is_accounted_for(send, truck, bus) -> None:
    actuator = send("ClutchActuator", SlavePosition=np.full(20, 40.0), MotorPosition=1.0)
    data = actuator.data.copy()
    data[3, 0] ^= 1  # a flipped bit: the checksum no longer fits
    actuator = replace(actuator, data=data).take(np.delete(np.arange(20), 10))  # and one lost
    speed = send("EEC1", EngineSpeed=[600.0, np.nan, 600.0])
    short = send("ET1", EngineCoolantTemperature=[80.0])
    short = replace(short, length=np.array([0], np.uint8))
    foreign = send("ETC2", CurrentGear=[1.0, 1.0])
    remote = replace(send("AMB", AmbientAirTemperature=[20.0]), flags=np.array([3], np.uint8))
    signals = signals_of(log(actuator, speed, short, foreign, remote), truck, bus)

    position = signals["slave_position"]
    assert position.why[3] == Why.CHECKSUM and np.isnan(position.value[3])
    assert position.valid.sum() == 18
    counts = signals.counts
    assert counts.messages["ClutchActuator"] == {
        "frames": 19,
        "decoded": 18,
        "checksum": 1,
        "counter jumps": 1,
    }
    assert counts.messages["EEC1"]["not available"] == 3  # torque is never given
    assert counts.rejected == {
        "checksum": 1,
        "not available": 1,
        "too short": 1,
        "not mapped": 2,
        "remote frame": 1,
    }
    assert counts.frames == counts.decoded + sum(counts.rejected.values()) == 26


def test_an_unchecked_message_keeps_its_bad_checksum(send, truck, bus) -> None:
    actuator = send("ClutchActuator", SlavePosition=[40.0, 40.0])
    data = actuator.data.copy()
    data[1, 0] ^= 1
    signals = signals_of(replace(actuator, data=data), replace(truck, checked=()), bus)
    assert signals["slave_position"].valid.all()


def test_one_sender_is_taken_and_the_others_named(send, truck, bus) -> None:
    frames = log(
        send("CCVS1", source=0x00, WheelBasedVehicleSpeed=[36.0] * 5),
        send("CCVS1", source=0x31, start=0.004, WheelBasedVehicleSpeed=[72.0] * 3),
        send("CCVS1", source=0x17, start=0.002, WheelBasedVehicleSpeed=[np.nan] * 9),
    )
    signals = signals_of(frames, truck, bus)
    assert signals["vehicle_speed"].value == pytest.approx([10.0] * 5)
    assert any(
        "several senders (address 0x00 on channel 0, address 0x31 on channel 0)" in w
        for w in signals.warnings
    )
    chosen = replace(truck.signals["vehicle_speed"], source_address=0x31)
    other = replace(truck, signals={**truck.signals, "vehicle_speed": chosen})
    assert signals_of(frames, other, bus)["vehicle_speed"].value == pytest.approx([20.0] * 3)


def test_plausible_range_and_clipping(send, truck, bus) -> None:
    narrow = replace(truck.signals["engine_speed"], minimum=500.0, maximum=1500.0)
    vehicle = replace(truck, signals={**truck.signals, "engine_speed": narrow})
    frames = log(
        send("EEC1", EngineSpeed=[400.0, 1000.0, 1600.0]),
        send("ClutchActuator", SlavePosition=[99.0, 40.0]),
    )
    signals = signals_of(frames, vehicle, bus)
    assert signals["engine_speed"].why.tolist() == [Why.OUT_OF_RANGE, 0, Why.OUT_OF_RANGE]
    assert any("engine_speed: EEC1.EngineSpeed: 2 samples outside" in w for w in signals.warnings)
    assert any(
        "slave_position: ClutchActuator.SlavePosition: 1 samples at the upper end" in w
        for w in signals.warnings
    )


def test_what_is_mapped_and_missing_is_named(send, truck, bus) -> None:
    signals = signals_of(send("EEC1", EngineSpeed=[600.0]), truck, bus)
    assert any(
        "message ETC1 has no frame in this log (input_shaft_speed); of this DBC the log holds EEC1"
        in w
        for w in signals.warnings
    )
    assert any(
        "engine_torque: EEC1.ActualEnginePercentTorque has no valid sample (not available)" in w
        for w in signals.warnings
    )
    with pytest.raises(ClutchestError, match=r"no frame of EEC1, .* the log holds ETC2"):
        signals_of(send("ETC2", CurrentGear=[1.0]), truck, bus)


def test_file_and_dbc_must_agree_on_names_and_units(send, truck, bus) -> None:
    frames = send("EEC1", EngineSpeed=[600.0])

    def mapped(bus_signal: BusSignal) -> None:
        speed = replace(truck.signals["engine_speed"], bus=bus_signal)
        signals_of(frames, replace(truck, signals={"engine_speed": speed}), bus)

    with pytest.raises(
        ClutchestError,
        match=r"truck\.toml:\d+: signals\.engine_speed: the file says "
        r"'rad/s', the DBC 'rpm' for EEC1\.EngineSpeed",
    ):
        mapped(BusSignal("EEC1", "EngineSpeed", "rad/s"))
    with pytest.raises(ClutchestError, match="no signal 'EngneSpeed'; did you mean 'EngineSpeed'"):
        mapped(BusSignal("EEC1", "EngneSpeed", "rpm"))
    with pytest.raises(ClutchestError, match=r"no message 'EEC9' in .*; did you mean 'EEC"):
        mapped(BusSignal("EEC9", "EngineSpeed", "rpm"))


GEARS = (12.0, 8.0, 6.0)


def drive() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Launch in first, a shift to third past second: time, wheel, engine, true gear or −1."""
    time = np.arange(0.0, 12.0, 0.01)
    wheel = np.interp(time, [0, 1, 3, 7, 12], [0, 0, 9, 10, 16])
    ratio = np.interp(time, [0, 7, 7.4, 12], [12.0, 12.0, 6.0, 6.0])  # through 8 in 0.1 s
    engine = np.maximum(wheel * ratio, 55.0)
    gear = np.where(time < 7, 0, 2)
    gear = np.where((engine > wheel * ratio * 1.001) | ((time > 7) & (time < 7.4)), -1, gear)
    return time, wheel, engine, gear


def test_a_launch_has_the_gear_in_which_it_ends() -> None:
    time, wheel, engine, locked_in = drive()
    gear = engaged_gear(time, wheel, engine, GEARS).gear
    assert (gear[locked_in >= 0] == locked_in[locked_in >= 0])[10:-10].mean() > 0.98
    assert set(gear[time < 6.8]) == {0}, "standing, slipping and locked in first"
    assert set(gear[time > 7.2]) == {2}, "the shift belongs to the next gear"


def test_shuffle_of_the_driveline_does_not_hide_the_gear() -> None:
    time, wheel, engine, _ = drive()
    shaken = wheel * (1 + 0.08 * np.sin(2 * np.pi * 9 * time))
    shaken[::7] = np.nan
    gear = engaged_gear(time, shaken, engine, GEARS).gear
    assert set(gear[time < 6.8]) == {0} and set(gear[time > 7.2]) == {2}


def test_never_locked_is_said() -> None:
    time = np.arange(0.0, 5.0, 0.01)
    assert not engaged_gear(time, np.zeros(500), np.full(500, 90.0), GEARS).ever_locked
    assert not engaged_gear(time[:0], time[:0], time[:0], GEARS).ever_locked


def test_a_gear_counts_from_shortly_before_it_is_locked() -> None:
    """What lies further ahead than a launch takes has no influence: in a drive in progress it is
    unknown."""
    time = np.arange(0.0, 30.0, 0.01)
    wheel = np.interp(time, [0, 5, 10, 14, 15, 30], [8, 8, 0, 0, 1.5, 1.5])
    engine = np.where(time < 5, 8.0 * 8, np.where(time < 21, 70.0, 1.5 * 8))
    engine[time > 21] = np.maximum(engine[time > 21], 8 * 1.5 * 2.6)
    wheel[time > 21] = engine[time > 21] / 8
    gear = engaged_gear(time, wheel, engine, GEARS).gear
    assert set(gear[time < 9.0]) == {1}, "second gear holds while the clutch is open"
    assert set(gear[(time > 10) & (time < 17.5)]) == {0}, "who stood starts in first gear"
    assert set(gear[time > 18.5]) == {1}, "locked in second at 21 s, which counts 3 s before"


def through_wheels(truck, **changes: object):
    wheel = replace(truck.signals["input_shaft_speed"], gears=GEARS, **changes)
    return replace(truck, signals={**truck.signals, "input_shaft_speed": wheel})


def test_wheel_speed_becomes_shaft_speed(send, truck, bus) -> None:
    time, wheel, engine, _ = drive()
    frames = log(send("ETC1", InputShaftSpeed=wheel / RPM), send("EEC1", EngineSpeed=engine / RPM))
    shaft = signals_of(frames, through_wheels(truck), bus)["input_shaft_speed"]
    assert shaft.value[time < 6.8] == pytest.approx(12 * wheel[time < 6.8], abs=0.2)
    assert shaft.value[time > 7.2] == pytest.approx(6 * wheel[time > 7.2], abs=0.1)

    still = log(send("ETC1", InputShaftSpeed=[0.0] * 50), send("EEC1", EngineSpeed=[600.0] * 50))
    signals = signals_of(still, through_wheels(truck), bus)
    assert signals["input_shaft_speed"].value == pytest.approx(np.zeros(50))
    assert any("never locked in one; first gear assumed" in w for w in signals.warnings)


def test_a_mapped_gear_and_a_second_wheel_are_used(send, truck, bus) -> None:
    vehicle = through_wheels(
        truck,
        gear=BusSignal("ETC2", "CurrentGear", "1"),
        other=BusSignal("ETC1", "OutputShaftSpeed", "rpm"),
    )
    frames = log(
        send("ETC1", period=0.1, InputShaftSpeed=[100.0] * 6, OutputShaftSpeed=[120.0] * 6),
        send("ETC2", start=0.105, period=0.1, source=3, CurrentGear=[1, 2, 0, 3]),
        send("EEC1", EngineSpeed=[600.0]),
    )
    shaft = signals_of(frames, vehicle, bus)["input_shaft_speed"]
    mean = 110 * RPM
    expected = np.array([12, 12, 12, 8, np.nan, 6]) * mean
    assert shaft.value == pytest.approx(expected, nan_ok=True, rel=1e-3)
    assert shaft.why[4] == Why.NOT_AVAILABLE, "neutral does not couple the shaft"


def test_gt350_launch(real_data) -> None:
    from clutchest.reading import read_log

    signals = read_log(real_data / "gt350_launch.trc", load_vehicle("gt350"))
    assert signals.counts.frames == 50638 and signals.warnings == ()
    engine, shaft = signals["engine_speed"], signals["input_shaft_speed"]
    slip = (np.interp(shaft.time, engine.time, engine.value) - shaft.value) / RPM
    assert np.interp(1.3, shaft.time, slip) == pytest.approx(1090, abs=4)
    assert np.interp(2.2, shaft.time, slip) == pytest.approx(1129, abs=4)
    locked = slip[(shaft.time > 2.8) & (shaft.time < 8.0)]
    assert abs(np.mean(locked)) < 5 and np.mean(np.abs(locked) < 25) > 0.7
    wheel_ratio = [
        np.median(np.interp(shaft.time, engine.time, engine.value)[m] / shaft.value[m])
        for a, b in ((3, 8), (10, 11), (13.5, 15), (17, 18), (20, 23), (26.5, 29))
        if (m := (shaft.time > a) & (shaft.time < b)).any()
    ]
    assert wheel_ratio[:5] == pytest.approx([1.0] * 5, abs=0.02), "each in its own gear"


def test_medium_truck_locks_up_at_the_flag(real_data) -> None:
    from clutchest.can.decode import decode, rows_of
    from clutchest.can.files import read_frames
    from clutchest.reading import load_database, read_log

    vehicle, path = load_vehicle("j1939_t270"), real_data / "j1939_t270_drive.log"
    signals = read_log(path, vehicle)
    engine, shaft = signals["engine_speed"], signals["input_shaft_speed"]
    slip = (np.interp(shaft.time, engine.time, engine.value) - shaft.value) / RPM
    etc1 = load_database(vehicle).message("ETC1")
    frames = read_frames(path)
    flag = decode(frames, rows_of(frames, etc1), etc1, ["TorqueConverterLockupEngaged"])
    lockup = shaft.time[np.argmax(flag["TorqueConverterLockupEngaged"].value == 1)]
    assert lockup == pytest.approx(1.23, abs=0.01)
    assert np.interp(lockup - 1.0, shaft.time, slip) == pytest.approx(313, abs=5)
    assert np.interp(lockup, shaft.time, slip) == pytest.approx(10.8, abs=2)
    after = slip[(shaft.time > 1.5) & (shaft.time < 5)]
    assert abs(np.mean(after)) < 10
    assert signals.counts.messages["CCVS1"]["not available"] == 300  # the second sender's


def test_idle_by_parameter_group(real_data) -> None:
    from clutchest.reading import read_log

    signals = read_log(real_data / "j1939_css_idle.mf4", load_vehicle("j1939_t270"))
    rpm = signals["engine_speed"].value / RPM
    assert 646 < rpm.min() < rpm.max() < 655
    assert "input_shaft_speed" not in signals
    assert any(w.startswith("message ETC1 has no frame") for w in signals.warnings)
