"""Logs of one vehicle whose clocks contradict each other, and logs that hold the same drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

import clutchest
from clutchest.can.files import read_frames, write_frames
from clutchest.fleet.fleet import Fleet, FleetVehicle, note_of
from clutchest.fleet.imprint import Imprint, Passed
from clutchest.fleet.logs import FleetLog, numbered
from clutchest.fleet.one_log import OVERLAPS, LogTask, begin_of, estimate_log, read_row
from clutchest.fleet.report import fleet_page
from clutchest.simulated import write_simulation

UNDATED = {"begin": None, "day": "unknown", "duration_s": 1800.0}
MIDNIGHT_NS = 946_684_800 * 10**9  # of a clock that has lost its battery


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two drives of one truck."""
    folder = tmp_path_factory.mktemp("logs")
    truck = clutchest.load_vehicle("truck")
    paths = [folder / f"{k}.log" for k in range(2)]
    for k, path in enumerate(paths):
        write_simulation(path, truck, "launches", k, duration=30.0, truck_seed=1)
    return paths


def beginning(log: Path, to: Path, start_ns: int | None) -> Path:
    """The same log, begun at another time, or at an unknown one."""
    frames = read_frames(log)
    t_ns = frames.t_ns - frames.t_ns[0] + (start_ns or 0)
    write_frames(replace(frames, t_ns=t_ns, absolute=start_ns is not None), to)
    return to


def rows(paths: list[Path], out: Path) -> list[dict]:
    """What the fleet says of a vehicle's logs, in their order."""
    passed, found, truck = Passed(), [], clutchest.load_vehicle("truck")
    for k, path in enumerate(paths):
        task = LogTask(FleetLog(path, "a"), f"{k}", truck, out, 10.0)
        passed = estimate_log(task, passed)
        row = read_row(task.row)
        assert row is not None
        found.append(row)
    return found


def test_drives_that_begin_at_the_same_time_are_all_used(logs: list[Path], tmp_path: Path) -> None:
    """As of a logger that begins every drive at midnight."""
    same = [
        beginning(log, tmp_path / f"{k}.blf", MIDNIGHT_NS + k * 10**9) for k, log in enumerate(logs)
    ]
    first, second = rows(same, tmp_path / "out")
    assert first["error"] is second["error"] is None
    assert first["note"] is None
    assert "its clock is not relied on" in second["note"]
    energies = [row["drives"][0]["slip_energy_J"] for row in (first, second)]
    assert second["state"]["slip_energy"][0] == pytest.approx(sum(energies), rel=0.01)


def test_drives_of_unknown_time_are_all_used(logs: list[Path], tmp_path: Path) -> None:
    bench = [beginning(log, tmp_path / f"{k}.log", None) for k, log in enumerate(logs)]
    for row in rows(bench, tmp_path / "out"):
        assert row["error"] is None and row["note"] is None


@pytest.mark.parametrize("name", ["copy.log", "converted.blf", "unknown.asc", "signals.parquet"])
def test_a_drive_counts_once(logs: list[Path], tmp_path: Path, name: str) -> None:
    """As a copy, in another format, without its date, and as a table of its signals."""
    again = tmp_path / name
    if name == "signals.parquet":
        clutchest.read_log(logs[0], "truck").to_pandas().to_parquet(again)
    elif name == "unknown.asc":
        beginning(logs[0], again, None)
    else:
        write_frames(read_frames(logs[0]), again)
    first, other, second = rows([logs[0], logs[1], again], tmp_path / "out")
    assert first["error"] is other["error"] is None
    assert second["error"] == f"holds the same drive as {logs[0]}"
    assert second["state"] == other["state"]


def test_drives_of_equal_length_are_told_apart() -> None:
    one = Imprint("a", None, 60.0, {"engine_speed": (100.0, 20.0), "coolant_temp": (85.0, 0.0)})
    assert one.is_of_drive(replace(one, log="b", start_ns=MIDNIGHT_NS))
    faster = {"engine_speed": (100.1, 20.0), "coolant_temp": (85.0, 0.0)}
    assert not one.is_of_drive(replace(one, moments=faster))
    assert not one.is_of_drive(replace(one, duration_s=62.0))
    later = replace(one, start_ns=MIDNIGHT_NS + 10**10)
    assert not later.is_of_drive(replace(one, start_ns=MIDNIGHT_NS))
    alone = {"engine_speed": (100.0, 20.0)}
    assert not one.is_of_drive(replace(one, moments=alone))  # too little to say so


def test_the_begin_of_a_table_is_that_of_its_times(tmp_path: Path) -> None:
    """Dates in the column of times, as Excel and loggers write them."""
    table = pd.DataFrame({"time": pd.to_datetime([MIDNIGHT_NS, MIDNIGHT_NS + 10**9], utc=True)})
    table["engine_speed"] = [100.0, 101.0]
    table.to_csv(tmp_path / "dated.csv", index=False)
    assert begin_of(tmp_path / "dated.csv", clutchest.load_vehicle("truck")) == MIDNIGHT_NS


def test_runs_are_taken_by_their_numbers() -> None:
    paths = [Path(f"a/run{k}.log") for k in (10, 2, 100, 1)]
    in_order = [path.stem for path in sorted(paths, key=numbered)]
    assert in_order == ["run1", "run2", "run10", "run100"]


def test_clocks_that_are_not_relied_on_are_left_out_of_the_range_of_days() -> None:
    """One that has lost its date, and one that begins before an earlier log ends."""
    days = {"lost": "1970-01-01", "a": "2024-05-02", "b": "2024-05-07", "twice": "2024-06-01"}
    notes = {"twice": OVERLAPS}
    made = [
        {
            "log": log,
            "note": notes.get(log),
            "drives": [{"begin": f"{day}T00:00:00.000+00:00", "day": day, "duration_s": 1800.0}],
        }
        for log, day in days.items()
    ]
    made.append({"log": "c", "note": None, "drives": [UNDATED]})
    noted = {row["log"]: note for row in made if (note := note_of(row))}
    assert list(noted) == ["lost", "twice"] and "begins on 1970-01-01" in noted["lost"]
    drives = tuple({"log": row["log"], **drive} for row in made for drive in row["drives"])
    vehicle = FleetVehicle("v", tuple(days), {}, drives, {}, None, noted)

    def page(one: FleetVehicle) -> str:
        return fleet_page(Fleet(clutchest.load_vehicle("truck"), (one,), {}))

    said = "2024-05-02 to 2024-05-07 (without 2 logs whose clock is not relied on)"
    assert f"5 drives, 2.5 h, {said}" in page(vehicle)
    alone = replace(vehicle, drives=drives[1:3], notes={})
    assert "2 drives, 1.0 h, 2024-05-02 to 2024-05-07</p>" in page(alone)
    none = replace(vehicle, drives=drives[:1], notes={"lost": noted["lost"]})
    assert "1 drive, 0.5 h (without 1 log whose clock is not relied on)" in page(none)
