"""A fleet: which logs are whose, comparison of vehicles, and the whole on real workers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.dataset
import pytest
from rich.console import Console

import clutchest
from clutchest.can.files import read_frames, write_frames
from clutchest.cli.fleet import _print
from clutchest.errors import ClutchestError
from clutchest.fleet import cluster as cluster_module
from clutchest.fleet import one_log
from clutchest.fleet.comparison import compare, fleet_level, outliers
from clutchest.fleet.fleet import Fleet, FleetVehicle, compared
from clutchest.fleet.imprint import Passed
from clutchest.fleet.logs import FleetLog, logs_of
from clutchest.fleet.one_log import LogTask, drives_of, estimate_log, read_row
from clutchest.fleet.report import fleet_page
from clutchest.shipped import shipped
from clutchest.simulated import write_simulation

RNG = np.random.default_rng(8)


def test_whose_a_log_is(tmp_path: Path) -> None:
    own = ("own.csv", "own.mat")
    for name in ("a/2024/one.log", "a/two.blf.gz", "b/one.log", *own, "b/notes.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x")
    (tmp_path / "b" / "one.log.truth.parquet").write_text("x")
    frames = read_frames(shipped("logs")["demo"])
    write_frames(frames.take(slice(0, 20)), tmp_path / "b" / "a.log")
    (tmp_path / "b" / "a.log").rename(tmp_path / "b" / "frames.txt")
    found = {(log.vehicle, log.path.name) for log in logs_of([str(tmp_path)])}
    tables = {(tmp_path.name, name) for name in own}
    text = ("b", "frames.txt")  # by its content; not so the notes
    assert found == {("a", "one.log"), ("a", "two.blf.gz"), ("b", "one.log"), text, *tables}
    by_pattern = logs_of([f"{tmp_path}/**/*.log", f"{tmp_path}/b"])
    assert [(log.vehicle, log.path.name) for log in by_pattern] == [
        ("2024", "one.log"),
        ("b", "frames.txt"),
        ("b", "one.log"),
    ]
    with_results = logs_of([str(tmp_path)], (tmp_path / "a").resolve())
    assert {log.vehicle for log in with_results} == {tmp_path.name, "b"}
    with pytest.raises(ClutchestError, match=r"nothing.*: no log there"):
        logs_of([str(tmp_path / "nothing")])


def test_shipped_logs_by_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stock = shipped("logs")
    both = (FleetLog(stock["alsd"], "alsd"), FleetLog(stock["demo"], "demo"))
    assert logs_of(["demo", "alsd", str(stock["demo"])]) == both
    with pytest.raises(ClutchestError, match=r"^dem: no log there; .* shipped log: alsd, demo$"):
        logs_of(["dem"])
    (tmp_path / "demo" / "red").mkdir(parents=True)  # a folder of one's own comes first
    (tmp_path / "demo" / "red" / "one.log").write_text("x")
    assert logs_of(["demo"]) == (FleetLog(Path("demo/red/one.log"), "red"),)


def test_the_spread_of_a_fleet_is_found() -> None:
    std = RNG.uniform(0.05, 0.2, 2000)
    y = 3.0 + RNG.normal(0.0, 0.3, 2000) + RNG.normal(0.0, std)
    mean, variance, tau = fleet_level(y, std)
    assert abs(mean - 3.0) < 4 * np.sqrt(variance)
    assert tau == pytest.approx(0.3, rel=0.1)
    _, _, alike = fleet_level(3.0 + RNG.normal(0.0, std), std)
    assert alike < 0.05


def test_a_healthy_fleet_has_outliers_as_rarely_as_stated() -> None:
    """Of p-values of vehicles like the others, as many are small as should be."""
    p = []
    for _ in range(100):
        std = RNG.uniform(0.05, 0.2, 12)
        y = RNG.normal(0.0, 0.1, 12) + RNG.normal(0.0, std)
        p.append(compare(y, std).p_value)
    p_value = np.concatenate(p)
    for level in (0.5, 0.1, 0.01):
        assert np.mean(p_value < level) <= 2.0 * level
    assert np.mean(p_value < 0.5) > 0.3


def test_few_healthy_fleets_have_an_outlier() -> None:
    """One in a hundred, as stated: 2 of 200, and more than 7 once in a thousand times."""
    fleets = 0
    for _ in range(200):
        std = RNG.uniform(0.05, 0.2, 12)
        y = RNG.normal(0.0, 0.1, 12) + RNG.normal(0.0, std)
        fleets += bool(outliers(y, std, tests=12)[1].any())
    assert fleets <= 7


def test_vehicles_that_differ_are_found_beside_each_other() -> None:
    std = np.full(10, 0.02)
    y = 1.0 + RNG.normal(0.0, 0.03, 10)
    y[3], y[7] = 0.5, 1.6
    _, differ = outliers(y, std, tests=10)
    assert np.flatnonzero(differ).tolist() == [3, 7]


def test_too_few_vehicles_are_not_compared() -> None:
    y = np.array([1.0, 2.0, np.nan, 4.0])
    assert np.isnan(compare(y, np.ones(4)).p_value).all()


def test_what_a_fleet_says_of_itself() -> None:
    """Fewer vehicles than a comparison takes are not said to be alike."""
    truck = clutchest.load_vehicle("truck")

    def line(friction: list[float]) -> str:
        vehicles = tuple(
            FleetVehicle(f"truck-{k}", (), {}, (), {"friction": (value, 0.01)}, None)
            for k, value in enumerate(friction)
        )
        return Fleet(truck, vehicles, compared(vehicles, ["friction"])).shown().line

    assert line([1.0]) == "1 vehicle; not compared, which takes 4"
    assert line([1.0, 1.0, 0.5]) == "3 vehicles; not compared, which takes 4"
    assert line([1.0, 1.01, 0.99, 1.0]) == "4 vehicles, 0 differ from the fleet"
    assert line([1.0, 1.01, 0.99, 1.0, 1.0, 0.99, 0.3]) == "7 vehicles, 1 differs from the fleet"


def test_a_log_that_contradicts_the_model_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    """Its estimates are not valid, so that the table alone would have an empty row."""
    drive = clutchest.simulate("truck", "launches", 11, duration=30.0)
    torque = drive["engine_torque"]
    wrong = replace(drive.signals["engine_torque"], value=-torque.value)
    run = clutchest.replay(
        replace(drive, signals={**drive.signals, "engine_torque": wrong}), "truck"
    )
    (row,) = drives_of(run)
    one = FleetVehicle("truck-1", ("a.log",), {}, ({**row, "log": "a.log"},), {}, None)
    fleet = Fleet(clutchest.load_vehicle("truck"), (one,), {})
    assert "the sign of engine_torque is wrong" in fleet.contradicting["a.log"]
    assert "a.log" in fleet_page(fleet) and "contradict the model" in fleet_page(fleet)
    _print(fleet, Console(width=400))
    assert "signals contradict the model: a.log: " in capsys.readouterr().out


@pytest.mark.slow
def test_no_usable_log_is_named_once(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    (tmp_path / "empty.log").touch()
    with pytest.raises(ClutchestError, match="the file is empty") as refused:
        clutchest.analyse_fleet(str(tmp_path / "empty.log"), "truck", tmp_path / "out", workers=1)
    assert str(refused.value).count("empty.log") == 1


def write_logs(folder: Path, vehicles: int = 4, worn: int = 2) -> None:
    """Two short drives of each vehicle; the friction of one is lower."""
    truck = clutchest.load_vehicle("truck")
    for k in range(vehicles):
        effects = {"friction_level": {"change": -0.35}} if k == worn else {}
        for drive in range(2):
            place = folder / f"truck-{k}"
            place.mkdir(parents=True, exist_ok=True)
            path = place / f"{drive}.log"
            write_simulation(
                path, truck, "launches", 10 * k + drive, effects, duration=60.0, truck_seed=k
            )


def task_of(folder: Path, out: Path) -> LogTask:
    return LogTask(
        FleetLog(folder / "truck-0" / "0.log", "truck-0"),
        "k",
        clutchest.load_vehicle("truck"),
        out,
        10.0,
    )


def test_one_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_logs(tmp_path / "logs", vehicles=1)
    task = task_of(tmp_path / "logs", tmp_path / "out")
    passed = estimate_log(task, Passed())
    row = read_row(task.row)
    assert row is not None and row["state"] is not None and row["state"] == passed.state
    monkeypatch.setattr(one_log, "_write_estimates", None)  # is not done again
    assert estimate_log(task, Passed()) == passed
    dataset = pyarrow.dataset.dataset(tmp_path / "out" / "fleet.parquet", partitioning="hive")
    table = dataset.to_table().to_pandas()
    assert set(table["vehicle"]) == {"truck-0"} and len(table) > 500
    task.row.write_text("{")
    assert read_row(task.row) is None


def test_a_log_that_cannot_be_used_passes_the_state_on(tmp_path: Path) -> None:
    (tmp_path / "truck-0").mkdir()
    (tmp_path / "truck-0" / "0.log").write_text("nothing")
    task = task_of(tmp_path, tmp_path / "out")
    assert estimate_log(task, Passed({"x": 1})) == Passed({"x": 1})
    row = read_row(task.row)
    assert row is not None and row["error"].startswith("not a CAN log")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers, processes of their own."""
    pytest.importorskip("distributed")
    about = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    command = [*dask, "--scheduler-file", str(about), "--port", "0", "--no-dashboard"]
    processes = [subprocess.Popen(command, stderr=subprocess.DEVNULL)]
    try:
        until = time.monotonic() + 60.0
        while not about.exists():
            assert time.monotonic() < until, "the scheduler does not start"
            time.sleep(0.1)
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1"]
        options = ["--scheduler-file", str(about), "--no-dashboard", "--memory-limit", "1GiB"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        processes += [
            subprocess.Popen(
                [*worker, *options, "--local-directory", str(tmp_path / f"worker{k}")],
                env=environment,
                stderr=subprocess.DEVNULL,
            )
            for k in range(2)
        ]
        yield json.loads(about.read_text())["address"], processes
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait()


@pytest.mark.slow
def test_two_workers_of_which_one_is_killed(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, (_, first, _) = cluster
    write_logs(tmp_path / "logs", vehicles=5)
    (tmp_path / "logs" / "truck-1" / "broken.log").write_text("nothing")
    seen: list[float] = []

    def after_the_first(text: str, share: float | None) -> None:
        if not seen:
            first.kill()
        seen.append(share or 0.0)

    out = tmp_path / "out"
    fleet = clutchest.analyse_fleet(
        str(tmp_path / "logs"), "truck", out, scheduler=address, progress=after_the_first
    )
    assert len(seen) == 11 and seen[-1] == 1.0
    assert [one.name for one in fleet.vehicles] == [f"truck-{k}" for k in range(5)]
    assert all(len(one.drives) == 2 for one in fleet.vehicles)
    assert list(fleet.rejected) == [str(tmp_path / "logs" / "truck-1" / "broken.log")]
    assert fleet.outliers == {"truck-2": ["friction"]}
    dataset = pyarrow.dataset.dataset(out / "fleet.parquet", partitioning="hive").to_table()
    counted = dataset.to_pandas().groupby("vehicle").size()
    assert counted.gt(1000).all() and len(counted) == 5

    again: list[float] = []  # nothing is done twice; another log of one vehicle is done alone
    truck = clutchest.load_vehicle("truck")
    later = tmp_path / "logs" / "truck-4" / "2.log"
    write_simulation(later, truck, "launches", 99, {}, duration=60.0, truck_seed=4)
    more = clutchest.analyse_fleet(
        str(tmp_path / "logs"),
        "truck",
        out,
        scheduler=address,
        progress=lambda text, share: again.append(share or 0.0),
    )
    assert len(again) <= 3 and len(more.vehicles[4].drives) == 3
    rows = more.to_pandas().set_index("vehicle")
    assert rows.attrs["units"]["zero_position_low"] == "mm"
    assert rows["friction_outlier"].tolist() == [False, False, True, False, False]
    assert (rows["zero_position_low"] < rows["zero_position_high"]).all()


@pytest.mark.slow
def test_a_log_that_kills_its_workers_does_not_stop_the_fleet(tmp_path: Path) -> None:
    """Here every log does, by the machine's file, which ends the process of a worker."""
    pytest.importorskip("distributed")
    import dask

    write_logs(tmp_path / "logs", vehicles=1)
    (tmp_path / "own.py").write_text(
        "import multiprocessing, os\n"
        "if multiprocessing.current_process().name != 'MainProcess':\n    os._exit(9)\n"
        "from clutchest.models.dry_clutch import MACHINE\n"
    )
    truck = clutchest.load_vehicle("truck").path.read_text(encoding="utf-8")
    own = tmp_path / "own.toml"
    own.write_text(truck.replace('model = "dry_clutch"', 'model = "own.py"'), encoding="utf-8")
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        pytest.raises(ClutchestError, match=r"0\.log: every worker that read it was lost"),
    ):
        clutchest.analyse_fleet(
            str(tmp_path / "logs"), str(own), tmp_path / "out", workers=1, trust=True
        )
    rows = [read_row(path) for path in (tmp_path / "out" / "logs").iterdir()]
    assert len(rows) == 2 and all(row and "lost" in row["error"] for row in rows)


def test_an_error_that_nobody_foresaw_is_a_log_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(path: Path, vehicle: object, traffic: bool) -> None:
        raise ZeroDivisionError("of nothing")

    write_logs(tmp_path / "logs", vehicles=1)
    monkeypatch.setattr("clutchest.reading.read_log", fails)
    task = task_of(tmp_path / "logs", tmp_path / "out")
    assert estimate_log(task, Passed({"x": 1})) == Passed({"x": 1})
    row = read_row(task.row)
    assert row is not None and row["error"] == "unexpected error: ZeroDivisionError: of nothing"


@pytest.mark.slow
def test_a_log_that_kills_whoever_opens_it_is_left_out_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The only worker ends at once as it opens one log, whether to see when that begins or to
    estimate; the logs that waited behind it are used, in order of time."""
    pytest.importorskip("distributed")
    import dask

    write_logs(tmp_path / "logs", vehicles=4)
    for first in (tmp_path / "logs").rglob("0.log"):
        first.rename(first.with_name("9.log"))  # not in order of their names
    deadly = tmp_path / "logs" / "a" / "deadly.log"
    deadly.parent.mkdir()
    deadly.write_text("(1.0) can0 123#00\n")
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(
        "import os, sys\n"
        "def hook(event, given):\n"
        "    if event == 'open' and str(given[0]).endswith('deadly.log'):\n        os._exit(9)\n"
        "sys.addaudithook(hook)\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "site"), *sys.path]))
    at_once = {"allowed-failures": 0, "worker-saturation": float("inf")}
    with dask.config.set({f"distributed.scheduler.{key}": each for key, each in at_once.items()}):
        fleet = clutchest.analyse_fleet(
            str(tmp_path / "logs"), "truck", tmp_path / "out", workers=1
        )
    assert list(fleet.rejected) == [str(deadly)]
    assert "every worker that read it was lost" in fleet.rejected[str(deadly)]
    assert len(fleet.vehicles) == 5
    for one in fleet.vehicles[1:]:
        assert sorted(Path(log).name for log in one.logs) == ["1.log", "9.log"]
        begins = [drive["begin"] for drive in one.drives]
        assert begins == sorted(begins)


def test_without_a_worker_it_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the last worker ends while it starts: Dask starts none in its place."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.1)
    monkeypatch.setattr(cluster_module, "START_S", 0.3)
    write_logs(tmp_path / "logs", vehicles=1)
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as empty,
        pytest.raises(ClutchestError, match="no worker is left; started again"),
    ):
        clutchest.analyse_fleet(
            str(tmp_path / "logs"), "truck", tmp_path / "out", scheduler=empty.scheduler_address
        )


@pytest.mark.slow
def test_in_place_of_workers_that_do_not_come_another_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.1)
    monkeypatch.setattr(cluster_module, "START_S", 2.0)
    with (
        distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=None) as own,
        distributed.Client(own) as client,
    ):
        own.sync(own.workers[0].close)
        while client.nthreads():
            time.sleep(0.01)
        [future] = cluster_module.in_turn(client, [client.submit(int, pure=False)])
        assert future.result() == 0


def test_a_vehicle_that_is_not_its_file(tmp_path: Path) -> None:
    """As of ``with_parameters``, a discovery or a fit, whose hash is that of the file."""
    pytest.importorskip("distributed")
    write_logs(tmp_path / "logs", vehicles=1)
    truck = clutchest.load_vehicle("truck")
    heavy = replace(truck, parameters=truck.with_parameters(engine_inertia=4.0).parameters)
    assert heavy.hash == truck.hash
    last: dict[str, dict] = {}
    for name, vehicle in (("truck", truck), ("heavy", heavy)):
        fleet = clutchest.fleet(tmp_path / "logs", vehicle, tmp_path / "out", workers=1)
        first = tmp_path / "logs" / "truck-0" / "0.log"
        last[name] = clutchest.replay(first, vehicle).summary["states"]["friction"]
        assert fleet["truck-0"].drives[0]["states"]["friction"]["value"] == last[name]["value"]
    assert last["heavy"]["value"] != last["truck"]["value"]


@pytest.mark.parametrize("workers", [0, -1])
def test_a_number_of_workers(tmp_path: Path, workers: int) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ClutchestError, match=f"workers {workers}: expected 1 or more, or None"):
        clutchest.fleet("demo", "truck", tmp_path / "out", workers=workers)
    assert not (tmp_path / "out").exists()


def test_a_script_without_a_guard_is_told_of_it(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    script = tmp_path / "mine.py"
    script.write_text('import clutchest\nclutchest.fleet("demo", "truck", "out", workers=1)\n')
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    *_, last = ended.stderr.splitlines()
    assert ended.returncode == 1 and "ClutchestError: no worker could be started" in last
    assert last.endswith('under `if __name__ == "__main__":`, as its workers import the script')
