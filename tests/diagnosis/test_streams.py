"""Faults of frames and signals: each is detected soon, under its own name, and no other is."""

from dataclasses import replace

import mangled
import numpy as np
import pytest
from mangled import ACTUATOR, COOLANT, EEC1, ETC1

from clutchest.can.frames import Frames
from clutchest.diagnosis.streams import StreamTests, between
from clutchest.reading import load_database
from clutchest.reading.mapping import signals_of
from clutchest.shipped import shipped
from clutchest.simulated import simulate_frames
from clutchest.vehicle import load_vehicle

BEGIN, END = 60.0, 70.0


@pytest.fixture(scope="module")
def truck():
    return load_vehicle("truck")


@pytest.fixture(scope="module")
def frames(truck):
    return simulate_frames(truck, "city", 5, duration=150.0)[0]


def streams_of(truck, frames, step=None):
    signals = signals_of(frames, truck, load_database(truck))
    streams = StreamTests(truck)
    if step is None:
        streams.take(signals, signals.end)
    else:
        for begin in np.arange(0.0, signals.end + 1e-9, step):
            end = min(begin + step, signals.end)
            last = end == signals.end
            streams.take(between(signals, begin, np.inf if last else end), end)
    return streams


def detected(streams):
    return {t.name: t.alarms[0] for t in streams.tests if t.alarms}


HELD = {
    "frozen:EEC1": lambda f: mangled.repeated(f, EEC1, BEGIN, END, slice(8, 8)),
    "stuck:engine_speed": lambda f: mangled.held(f, EEC1, BEGIN, END, slice(3, 5)),
    "stuck:slave_position": lambda f: mangled.resummed(
        mangled.held(f, ACTUATOR, BEGIN, END, slice(0, 2))
    ),
    "missing:EEC1": lambda f: mangled.without(f, EEC1, BEGIN, END),
    "missing:ET1": lambda f: mangled.without(f, COOLANT, BEGIN, np.inf),
    "late:ETC1": lambda f: mangled.slowed(f, ETC1, BEGIN, 1.25),
    "counter:ClutchActuator": lambda f: mangled.resummed(
        mangled.held(f, ACTUATOR, BEGIN, END, slice(4, 5))
    ),
    "checksum:ClutchActuator": lambda f: mangled.flipped(f, ACTUATOR, BEGIN, END, 7, 0.3),
    "noise:slave_position": lambda f: mangled.resummed(
        mangled.shaken(f, ACTUATOR, BEGIN, slice(0, 2), 40.0)
    ),
    "noise:input_shaft_speed": lambda f: mangled.shaken(f, ETC1, BEGIN, slice(5, 7), 15.0),
}
# by when it must be known, s after it began
WITHIN = {"missing:ET1": 40.0, "noise:slave_position": 15.0, "noise:input_shaft_speed": 15.0}
BESIDE = {  # other tests that the fault makes fail
    "frozen:EEC1": {"stuck:engine_speed", "stuck:engine_torque"},
    "stuck:slave_position": {"sticking:actuator"},
}


@pytest.mark.parametrize("name", HELD)
def test_a_fault_of_the_bus_is_detected_under_its_name(truck, frames, name):
    alarms = detected(streams_of(truck, HELD[name](frames)))
    assert name in alarms
    assert set(alarms) <= {name} | BESIDE.get(name, set())
    alarm = alarms[name]
    assert BEGIN - 0.6 <= alarm.detected <= BEGIN + WITHIN.get(name, 1.0)
    assert alarm.begun == pytest.approx(BEGIN, abs=1.1)
    lasting = name.split(":")[0] in ("frozen", "stuck") or name == "missing:EEC1"
    if lasting:
        assert alarm.ended == pytest.approx(END, abs=0.2)


def test_a_sound_bus_has_no_fault(truck, frames):
    streams = streams_of(truck, frames)
    assert not detected(streams)
    ran = {t.name for t in streams.tests if t.threshold is not None}
    wanted = {"missing:EEC1", "frozen:ClutchActuator", "stuck:engine_torque", "sticking:actuator"}
    wanted |= {"noise:slave_position", "implausible:coolant_temp", "counter:ClutchActuator"}
    assert wanted <= ran


@pytest.mark.parametrize(
    "name",
    ["frozen:EEC1", "missing:EEC1", "counter:ClutchActuator", "noise:slave_position", "late:ETC1"],
)
def test_batches_do_not_matter(truck, frames, name):
    broken = HELD[name](frames)
    whole, pieces = (
        detected(streams_of(truck, broken)),
        detected(streams_of(truck, broken, step=1.0)),
    )
    assert set(whole) == set(pieces)
    for fault, alarm in whole.items():
        assert pieces[fault].detected == pytest.approx(alarm.detected, abs=0.06)
        assert pieces[fault].begun == pytest.approx(alarm.begun, abs=0.06)


@pytest.mark.parametrize("step", [None, 0.5])
def test_a_silent_bus_is_a_fault_of_its_own(truck, frames, step):
    """Every message is missing then, which the silence explains; what ends for good does not."""
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    silent = frames.take((time < 30.0) | ((time > 60.0) & (time < 80.0)))
    silent = mangled.without(silent, COOLANT, 79.0, np.inf)  # the end of the log is silent too
    streams = streams_of(truck, silent, step)
    alarms = detected(streams)
    assert {"silent:bus", "missing:EEC1", "missing:ETC1", "missing:ClutchActuator"} <= set(alarms)
    assert {name.split(":")[0] for name in alarms} == {"silent", "missing"}
    alarm = alarms["silent:bus"]
    assert alarm.begun == pytest.approx(30.0, abs=0.02)
    assert 30.1 < alarm.detected < 32.0
    assert alarm.ended == pytest.approx(60.0, abs=0.02)
    for test in streams.tests:
        if test.kind == "missing":
            assert all(streams.masked(test, alarm) for alarm in test.alarms)


@pytest.mark.parametrize("step", [None, 0.5])
def test_messages_are_missing_while_others_are_sent(truck, frames, step):
    """A flood, or a gateway that restarts: all that is mapped is gone, the bus is busy."""
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    rest = frames.take((time < BEGIN) | (time > END))
    flood = Frames.empty(10_000)
    flood = replace(flood, t_ns=frames.t_ns[0] + np.arange(10_000) * 1_000_000 + int(BEGIN * 1e9))
    both = Frames.concatenate([rest, flood]).sorted()
    alarms = detected(streams_of(truck, both, step))
    assert {"missing:EEC1", "missing:ETC1", "missing:ClutchActuator"} <= set(alarms)
    assert {name.split(":")[0] for name in alarms} == {"missing"}
    for name in ("missing:EEC1", "missing:ETC1", "missing:ClutchActuator"):
        alarm = alarms[name]
        assert alarm.begun == pytest.approx(BEGIN, abs=0.1)
        assert BEGIN < alarm.detected < BEGIN + 2.0
        assert alarm.ended == pytest.approx(END, abs=0.1)
        if step is None:  # else it is said when it is noticed
            said = float(alarm.what.split()[3])  # no frame for … s
            assert said == pytest.approx(END - BEGIN, abs=0.1)


@pytest.mark.parametrize("step", [None, 0.5])
def test_a_silent_channel_explains_its_messages(truck, frames, step):
    second = np.isin(frames.id & 0xFFFF00, [EEC1 & 0xFFFF00, ETC1 & 0xFFFF00])
    frames = replace(frames, channel=second.astype(np.uint8))
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    silent = frames.take(~second | (time < BEGIN) | (time > END))
    streams = streams_of(truck, silent, step)
    alarms = detected(streams)
    assert {"silent:1", "missing:EEC1", "missing:ETC1"} <= set(alarms)
    alarm = alarms["silent:1"]
    assert alarm.begun == pytest.approx(BEGIN, abs=0.05)
    assert BEGIN < alarm.detected < BEGIN + 2.0
    assert alarm.ended == pytest.approx(END, abs=0.05)
    shown = {t.name for t in streams.tests if any(not streams.masked(t, a) for a in t.alarms)}
    assert shown == {"silent:1"}


def test_frames_that_waited_somewhere_are_neither_late_nor_miscounted(truck, frames):
    """Stamps of a busy machine: held back up to 60 ms, then several at once."""
    step = 60_000_000
    t_ns = -(-frames.t_ns // step) * step + np.arange(len(frames)) % 1000
    short = frames.take((frames.t_ns - frames.t_ns[0]) < 60e9)
    held = replace(short, t_ns=np.sort(t_ns[: len(short)]))
    alarms = detected(streams_of(truck, held, 0.5))
    assert not {"counter:ClutchActuator", "missing:EEC1", "late:EEC1"} & set(alarms)


def test_frames_that_waited_for_a_session_do_not_state_a_period(frames, tmp_path):
    """A DBC without cycle times, and half a second of frames that come all at once at the begin."""
    dbc = shipped("dbc")["hdt_clutch"].read_text(encoding="utf-8")
    lines = [line for line in dbc.splitlines() if not line.startswith('BA_ "GenMsgCycleTime" BO_')]
    assert len(lines) < len(dbc.splitlines())
    (tmp_path / "hdt_clutch.dbc").write_text("\n".join(lines), encoding="utf-8")
    text = shipped("vehicles")["truck"].read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    since, begin = frames.t_ns - frames.t_ns[0], 500_000_000
    at_once = np.where(since < begin, begin - 50_000 + since // 10_000, since)
    held = replace(frames, t_ns=frames.t_ns[0] + at_once).take(since < 60e9)
    alarms = detected(streams_of(load_vehicle(tmp_path / "mine.toml"), held))
    assert not [name for name in alarms if name.startswith("late:")]


def test_a_piston_that_sticks(truck, frames):
    signals = signals_of(frames, truck, load_database(truck))
    slave, motor = signals["slave_position"], signals["motor_position"]
    moved = np.abs(np.diff(motor.value, prepend=motor.value[0])) > 0.03
    first = float(motor.time[np.flatnonzero(moved & (motor.value > 4.0))[0]])
    own = (slave.time > first) & (slave.time < first + 3.0)
    value = slave.value.copy()
    rng = np.random.default_rng(1)
    value[own] = value[own][0] + rng.normal(0.0, 0.01, own.sum())
    broken = replace(
        signals, signals={**signals.signals, "slave_position": replace(slave, value=value)}
    )
    streams = StreamTests(truck)
    streams.take(broken, broken.end)
    alarms = detected(streams)
    assert set(alarms) == {"sticking:actuator"}
    assert first - 0.1 <= alarms["sticking:actuator"].detected <= first + 3.5


@pytest.mark.parametrize("value", [-80.0, 160.0])
def test_a_temperature_that_cannot_be(truck, frames, value):
    signals = signals_of(frames, truck, load_database(truck))
    s = signals["coolant_temp"]
    wrong = replace(s, value=np.where(s.time > BEGIN, value, s.value))
    streams = StreamTests(truck)
    streams.take(replace(signals, signals={**signals.signals, "coolant_temp": wrong}), signals.end)
    alarm = detected(streams)["implausible:coolant_temp"]
    assert BEGIN <= alarm.detected <= BEGIN + 3.5


def test_decoded_signals_have_no_frames_to_judge(truck, frames):
    signals = replace(signals_of(frames, truck, load_database(truck)), traffic={})
    streams = StreamTests(truck)
    streams.take(signals, signals.end)
    ran = {t.kind for t in streams.tests if t.threshold is not None}
    assert not ran & {"missing", "late", "frozen", "counter", "checksum"}
    assert {"stuck", "noise", "sticking", "implausible"} <= ran


def test_a_guess_of_the_noise_is_no_evidence(truck, frames):
    """Four times the noise of a vehicle file: a fault where it was measured, none where it was
    guessed; and the monitor says that it could not run."""
    speed = truck.signals["engine_speed"]
    for source, names in (("", {"noise:engine_speed"}), ("guess: none is stated", set())):
        stated = replace(speed, noise=speed.noise / 4, noise_source=source)
        vehicle = replace(truck, signals={**truck.signals, "engine_speed": stated})
        streams = streams_of(vehicle, frames)
        assert set(detected(streams)) == names
    (test,) = (t for t in streams.tests if t.name == "noise:engine_speed")
    assert test.threshold is None and "guess" in test.why
