"""Trouble codes: what a status byte says, and whose number is whose."""

import pytest

from clutchest.diagnosis.codes import (
    CLUTCH,
    CONFIRMED,
    FAILED_SINCE_CLEAR,
    FAILED_THIS_CYCLE,
    NOT_COMPLETED_SINCE_CLEAR,
    NOT_COMPLETED_THIS_CYCLE,
    PENDING,
    PROPRIETARY,
    TEST_FAILED,
    number_of,
    number_of_set,
    status_byte,
)
from clutchest.diagnosis.faults import Alarm, stream_tests
from clutchest.diagnosis.streams import StreamTests
from clutchest.errors import ClutchestError
from clutchest.shipped import shipped
from clutchest.vehicle import load_vehicle
from clutchest.vehicle.text import dump_vehicle

LASTING = FAILED_THIS_CYCLE | PENDING | CONFIRMED | FAILED_SINCE_CLEAR


def test_a_fault_that_stays():
    assert status_byte([(60.0, [Alarm(10.0, 12.0)])]) == TEST_FAILED | LASTING


def test_a_fault_that_goes_away_is_remembered():
    assert status_byte([(100.0, [Alarm(10.0, 12.0, 15.0)])]) == LASTING
    early = status_byte([(20.0, [Alarm(10.0, 12.0, 15.0)])])
    assert early == TEST_FAILED | LASTING  # passed for too short a time to be trusted


def test_drives_without_it_make_it_pending_no_more():
    drives = [(60.0, [Alarm(10.0, 12.0, 13.0)]), (60.0, []), (60.0, [])]
    assert status_byte(drives) == CONFIRMED | FAILED_SINCE_CLEAR


def test_a_test_too_short_to_pass_has_not_completed():
    assert status_byte([(5.0, [])]) == NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE
    assert status_byte([(60.0, [])]) == 0


@pytest.mark.parametrize("name", sorted(shipped("vehicles")))
def test_every_fault_of_a_vehicle_has_its_own_number(name):
    vehicle = load_vehicle(name)
    names = [t.name for t in stream_tests(vehicle, 1.0)]
    names += [f.name for f in vehicle.machine.faults] + ["wear"]
    numbers = [number_of(fault, vehicle)[0] for fault in names]
    assert len(set(numbers)) == len(names)
    assert set(numbers) <= set(PROPRIETARY) - {CLUTCH}


def test_a_set_is_no_component():
    truck = load_vehicle("truck")
    assert number_of_set(("wear", "position_offset"), truck) == (CLUTCH, 11)
    assert number_of_set(("torque_gain",), truck, -0.1)[1] == 1
    assert number_of_set(("torque_gain",), truck, 0.1)[1] == 0


def test_the_vehicle_file_may_state_other_numbers(tmp_path):
    text = load_vehicle("truck").path.read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(
        text + '\n[monitors.codes]\n"stuck:engine_speed" = { spn = 190, fmi = 2 }\n'
        "clutch = { spn = 5000 }\n",
        encoding="utf-8",
    )
    mine = load_vehicle(path)
    assert number_of("stuck:engine_speed", mine) == (190, 2)
    assert number_of_set(("wear", "position_offset"), mine) == (5000, 11)
    dump_vehicle(mine, tmp_path / "again.toml")
    assert load_vehicle(tmp_path / "again.toml").codes == mine.codes


def test_a_code_of_a_fault_that_there_is_not_is_refused_with_its_line(tmp_path) -> None:
    text = shipped("vehicles")["truck"].read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text + '\n[monitors.codes]\n"stuck:engin_speed" = { spn = 190 }\n', "utf-8")
    line = text.count("\n") + 3
    with pytest.raises(
        ClutchestError,
        match=rf"mine\.toml:{line}: monitors\.codes: no fault .*'stuck:engine_speed'",
    ):
        StreamTests(load_vehicle(path))
    path.write_text(
        text + '\n[monitors.codes]\n"stuck:accelerator_pedal" = { spn = 91 }\n'
        '"late:EEC3" = { spn = 1 }\n"contradiction:zero_position" = { spn = 2 }\n'
        '"silent:2" = { spn = 3 }\nclutch = { spn = 4 }\nwear = { spn = 5 }\n',
        "utf-8",
    )
    assert len(StreamTests(load_vehicle(path)).vehicle.codes) == 6
