"""A diagnosis in files, in a terminal and in a recording."""

import json
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rerun.chunk import RrdReader
from rich.console import Console

import clutchest
from clutchest.diagnosis.isolation import Explanation
from clutchest.diagnosis.result import Fault, Isolability
from clutchest.diagnosis.structure import AffectedSensor
from clutchest.record.diagnosis import print_diagnosis, write_diagnosis
from clutchest.record.diagnosis_recording import without_what_rests_on_faults
from clutchest.record.diagnosis_report import (
    affected,
    diagnosis_markdown,
    freeze_frame,
    headline,
)

WARNING = "oil_temp: 3 frames were dropped"


@pytest.fixture(scope="module")
def diagnosis():
    """A healthy one with a warning, a fault and a matrix written into it by hand."""
    rig = clutchest.load_vehicle("alsd_rig")
    run = clutchest.replay(clutchest.read_log("alsd", rig), rig)
    run = replace(run, summary={**run.summary, "warnings": [WARNING]})
    found = clutchest.diagnose(run)
    frame = {
        "time": 3.0,
        "mode": "slipping",
        "clutch_torque": 100.0,
        "causes": ["motor_friction"],
        "states": {"current": {"value": 1.0, "std": np.nan, "valid": False}},
        "inputs": {"motor_angle": 2.0, "oil_temp": None},
    }
    causes = (Explanation("motor_friction", 0.1, 0.01, "rad", 3, 0.0),)
    fault = Fault(
        "motor_friction",
        ("motor_friction", "friction_level"),
        0,
        2.0,
        3.0,
        None,
        0.999,
        "motor_friction +0.1 rad",
        causes,
        frame,
        0x2F,
        520_192,
        11,
    )
    matrix = Isolability(
        ("a", "b"),
        ("rad", "1"),
        np.array([0.1, 0.2]),
        np.array([[0.0, 4.0, 5.0], [4.0, 0.0, 6.0]]),
        (0.1, None),
        {"a": (AffectedSensor("angle"),), "b": ()},
    )
    lanes = {**found.lanes, "motor_friction": (((0.0, "passed"), (3.0, "failed")),)}
    return replace(found, faults=(fault,), isolability=matrix, lanes=lanes)


def test_json_has_what_the_interface_names(diagnosis, tmp_path):
    paths = write_diagnosis(diagnosis, tmp_path / "out")
    assert [path.name for path in paths] == ["diagnosis.json", "recording.rrd", "report.html"]
    told = json.loads(paths[0].read_text(encoding="utf-8"))
    assert told["warnings"] == diagnosis.warnings == [WARNING]
    for monitor in told["monitors"]:
        assert {"name", "status", "why", "threshold", "false_alarms_per_1000h"} <= set(monitor)
    fault = told["faults"][0]
    assert {
        "fault",
        "set",
        "first_detected_s",
        "confidence",
        "freeze_frame",
        "status_byte",
        "spn",
        "fmi",
    } <= set(fault)
    assert fault["freeze_frame"]["states"]["current"]["std"] is None


def test_the_recording_has_lanes_a_log_and_a_freeze_frame(diagnosis, tmp_path):
    recording = write_diagnosis(diagnosis, tmp_path / "out")[1]
    entities = {chunk.entity_path for chunk in RrdReader(recording).stream()}
    assert {
        "/fault/log",
        "/fault/freeze_frame",
        "/fault/motor_friction",
        "/fault/motor_friction/freeze_frame",
    } <= entities


def test_what_the_log_lacks_is_said_everywhere(diagnosis):
    """As of a second log that holds no frame of the vehicle."""
    summary = {**diagnosis.run.summary, "warnings": ["other.log: no frame of EEC1"]}
    found = replace(diagnosis, run=replace(diagnosis.run, summary=summary))
    console = Console(record=True, width=120, file=StringIO())
    print_diagnosis(found, console)
    assert "warning: other.log: no frame of EEC1" in console.export_text()
    assert found.summary()["warnings"][-1] == "other.log: no frame of EEC1"
    assert "- other.log: no frame of EEC1" in diagnosis_markdown(found)


def test_the_terminal_names_the_set_and_explains(diagnosis):
    console = Console(record=True, width=120, file=StringIO())
    print_diagnosis(diagnosis, console, explain=True)
    text = console.export_text()
    assert "one of motor_friction, friction_level" in text
    assert "SPN 520192, FMI 11" in text
    assert "separability" in text and "never" in text


def test_what_could_not_run_for_one_reason_is_one_row(diagnosis):
    """Tests of frames, of a table that has none."""
    reason, other = "no frames: these are decoded signals", "a healthy one may be constant"
    frames = [f"{kind}:Message_{k}" for kind in ("frozen", "late") for k in range(5)]
    monitors = [
        replace(diagnosis.monitors[0], name=name, status="not run", why=why)
        for name, why in [*((n, reason) for n in frames), ("silent:bus", reason), ("s:a", other)]
    ]
    console = Console(record=True, width=120, file=StringIO())
    print_diagnosis(replace(diagnosis, faults=(), monitors=tuple(monitors)), console)
    text = console.export_text()
    assert text.count(reason) == 1 and "frozen (5), late (5), silent:bus" in text
    assert "s:a" in text and other in text and "12 could not run" in text


def test_tables_of_eight_faults_are_whole_in_80_columns(diagnosis):
    names = tuple(f"fault_of_the_signal_{k}" for k in range(8))
    isolability = Isolability(
        names,
        ("mm/h",) * 8,
        np.full(8, 0.12),
        np.full((8, 9), 4.4),
        (0.12,) * 8,
        dict.fromkeys(
            names, (AffectedSensor("engine_speed"), AffectedSensor("zero_position", ("temp_body",)))
        ),
    )
    console = Console(record=True, width=80, file=StringIO())
    print_diagnosis(replace(diagnosis, isolability=isolability), console, explain=True)
    text = console.export_text()
    assert "…" not in text
    assert all(text.count(name) == 2 for name in names)
    rows = [line.split() for line in text.splitlines() if "4.4" in line]
    counts = [row.count("4.4") for row in rows]  # a threshold of a monitor may be 4.4 as well
    assert [count for count in counts if count > 1] == [8] * 8


def test_a_freeze_frame_has_the_units_that_people_read(diagnosis):
    (fault,) = diagnosis.faults
    state = {"value": 21.5, "std": 0.3, "valid": True}
    frame = {**fault.freeze_frame, "states": {"current": state}, "inputs": {"slip_speed": np.pi}}
    text = freeze_frame(replace(fault, freeze_frame=frame), diagnosis.run.vehicle.machine)
    assert "| current | 21.50 ± 0.30 A |" in text
    assert "| slip speed | 30 rpm |" in text
    assert "| motor_friction | +0.100 ± 0.010 rad | 0.0 |" in text


def test_sensors_that_a_fault_affects_through_the_same_states_stand_together(diagnosis):
    through = {"a": ("x",), "b": (), "c": ("x",), "d": ("x", "y")}
    wear = tuple(AffectedSensor(*each) for each in through.items())
    structure = {"wear": wear, "gone": ()}
    isolability = replace(diagnosis.isolability, structure=structure)
    assert affected(isolability, "wear") == "b; a, c through x; d through x, y"
    assert affected(isolability, "gone") == "no sensor"


def test_a_headline_does_not_say_the_fault_twice(diagnosis):
    (fault,) = diagnosis.faults
    alone = replace(fault, fault="wear", set=("wear",), what="wear +1 mm (worn by 1 mm)")
    assert headline(alone).endswith(" s: wear +1 mm (worn by 1 mm)")
    assert headline(replace(alone, what="worn by 1 mm")).endswith(" s: wear: worn by 1 mm")


def test_nothing_is_valid_while_a_signal_is_stuck(diagnosis):
    (fault,) = diagnosis.faults

    def share_valid(name, **when):
        found = replace(fault, fault=name, set=(name,), began_s=3.0, **when)
        (track,) = without_what_rests_on_faults(replace(diagnosis, faults=(found,))).tracks
        estimates = [track.states["friction"], track.states["current"], track.clutch_torque]
        stuck = (track.time >= 3.0) & (track.time <= (when.get("ended_s") or np.inf))
        return [float(each.valid[part].mean()) for each in estimates for part in (stuck, ~stuck)]

    for name in ("stuck:armature_voltage", "stuck:armature_current"):
        for when in ({}, {"ended_s": 4.0}):
            during, beside = share_valid(name, **when)[::2], share_valid(name, **when)[1::2]
            assert during == [0.0] * 3 and min(beside) > 0.0
    assert min(share_valid("stuck:oil_temp")) > 0.0  # the equations can do without it


@pytest.mark.parametrize(
    ("unit", "words"), [("1", "-0.100 ± 0.011"), ("1/s", "-0.100 ± 0.011 per s")]
)
def test_a_magnitude_has_all_its_digits(unit, words):
    assert Explanation("torque_gain", -0.1, 0.011, unit, 0, 0.0).magnitude == words
