"""The command line as a user meets it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from rerun.chunk import RrdReader

import clutchest
from clutchest import cli
from clutchest.can.files import read_frames
from clutchest.cli import terminal
from clutchest.generator import SCENARIOS, alsd
from clutchest.shipped import shipped

VERBS = (
    "replay",
    "inspect",
    "convert",
    "simulate",
    "identify",
    "diagnose",
    "discover",
    "reproduce",
    "monitor",
    "play",
    "export",
    "feedforward",
    "fleet",
    "trust",
)


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a command line in this process: (exit code, stdout, stderr)."""

    def call(*arguments) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["clutchest", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        return (end.value.code or 0, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def log(tmp_path_factory) -> Path:
    from clutchest.simulated import write_simulation

    path = tmp_path_factory.mktemp("logs") / "drive.log"
    write_simulation(path, clutchest.load_vehicle("truck"), "launches", 4, duration=30.0)
    return path


def python(code: str, *arguments: str, **options) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=environment,
        text=True,
        capture_output=True,
        timeout=60,
        **options,
    )


def test_help_needs_nothing_heavy():
    heavy = [
        "numpy",
        "pandas",
        "pyarrow",
        "rerun",
        "scipy",
        "casadi",
        "numba",
        "can",
        "cantools",
        "asammdf",
        "matplotlib",
        "rich",
    ]
    done = python(f"""
import sys
from clutchest.cli import main
sys.argv = ["clutchest", "--help"]
try:
    main()
finally:
    print([name for name in {heavy} if name in sys.modules], file=sys.stderr)
""")
    assert done.stderr.strip() == "[]"
    assert "Estimate temperatures" in done.stdout


@pytest.mark.slow
def test_a_dbc_read_for_the_first_time_does_not_load_asammdf(tmp_path):
    done = python(f"""
import os, sys
os.environ["CLUTCHEST_CACHE"] = {str(tmp_path)!r}
from clutchest.cli import main
from clutchest.shipped import locate
dbc = str(locate("hdt_clutch", "dbc"))
sys.argv = ["clutchest", "inspect", "demo", "--dbc", dbc, "--out", {str(tmp_path)!r}]
try:
    main()
finally:
    print([name for name in ("can", "asammdf") if name in sys.modules], file=sys.stderr)
""")
    assert done.stderr.strip() == "['can']"


def test_help_lists_the_verbs(run):
    code, out, _ = run("--help")
    rows = out.split("Commands:\n")[1].split("\n\n")[0].splitlines()
    assert code == 0 and sorted(row.split()[0] for row in rows) == sorted(VERBS)
    assert not any(row.endswith("...") for row in rows), "a summary is cut off at 80 columns"


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_an_example(run, verb):
    code, out, _ = run(verb, "--help")
    assert code == 0
    assert f"Example:\n    clutchest {verb} " in out
    assert not set("{}") & set(out.split("Options:")[0]), "arguments as they are typed"
    assert "list[" not in out and "<str>" not in out
    assert all(len(line) <= 80 for line in out.splitlines())


def test_help_names_scenarios_and_vehicles(run):
    _, out, _ = run("simulate", "--help")
    text = " ".join(out.split())
    for name in (*SCENARIOS, *alsd.SCENARIOS, *shipped("vehicles")):
        assert f" {name}" in text, name


def test_version(run):
    assert run("--version") == (0, f"clutchest {clutchest.__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["replay", "gone.log", "--vehicle", "truck"], "no such file: gone.log"),
        (["replay", "gone.log", "--vehicle", "truk"], "truk; did you mean 'truck'?"),
        (["inspect", "gone.log"], "no such file: gone.log"),
        (["inspect", "alsd", "--dbc", "hdt_cluch"], "hdt_cluch; did you mean 'hdt_clutch'?"),
        (["inspect", "alsd", "--dbc", "0=alsd_"], "alsd_; did you mean 'alsd'"),
        (["convert", "gone.log", "-o", "x.asc"], "no such file: gone.log"),
        (
            ["simulate", "--vehicle", "truck", "--scenario", "sity", "--seed", "1", "-o", "x.log"],
            "unknown scenario 'sity'; did you mean 'city'?",
        ),
        (
            [
                "simulate",
                "--vehicle",
                "truck",
                "--scenario",
                "city",
                "--seed",
                "1",
                "--duration",
                "5",
                "--effect",
                "waer:amount=1",
                "-o",
                "x.log",
            ],
            "'waer'; did you mean 'wear'?",
        ),
    ],
)
def test_bad_input_is_one_line(run, tmp_path, monkeypatch, arguments, complaint):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*arguments)
    assert (code, out) == (1, "")
    assert err.startswith("clutchest: ") and err.count("\n") == 1 and complaint in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["replay"],
        ["replay", "x.log"],
        ["replay", "x.log", "--vehicle", "truck", "--rate", "0"],
        ["replay", "x.log", "--vehicle", "truck", "--rate", "fast"],
        ["transmogrify"],
        ["convert", "x.log"],
        [
            "simulate",
            "--vehicle",
            "truck",
            "--scenario",
            "city",
            "--seed",
            "1",
            "-o",
            "x.log",
            "--effect",
            "wear=1",
        ],
    ],
)
def test_wrong_usage_is_2(run, arguments):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert "Usage:" in err and "Error:" in err


def test_a_folder_that_cannot_be(run, log, tmp_path):
    (tmp_path / "file").write_text("mine")
    code, _, err = run("convert", log, "-o", tmp_path / "file" / "deeper" / "x.asc")
    assert code == 1 and err.count("\n") == 1 and "file" in err
    code, _, err = run("convert", log, "-o", tmp_path / "x.nothing")
    assert code == 1 and err.count("\n") == 1 and f"{tmp_path / 'x.nothing'}: " in err
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    (tmp_path / "x.asc").mkdir()
    code, _, err = run("convert", log, "-o", tmp_path / "x.asc")
    assert code == 1 and err == f"clutchest: {tmp_path / 'x.asc'}: is a folder, expected a file\n"


def test_a_folder_in_place_of_a_vehicle_file(run, log, tmp_path):
    """As that of a discovery's results."""
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "extended.toml").write_text("")
    code, _, err = run("replay", log, "--vehicle", tmp_path / "result", "--out", tmp_path / "out")
    assert code == 1 and err.count("\n") == 1
    assert f"expected a file such as {tmp_path / 'result' / 'extended.toml'}" in err


def test_a_bus_without_a_frame(run, tmp_path):
    bus = ("--interface", "virtual", "--channel", "silent", "--vehicle", "truck")
    code, out, _ = run("monitor", *bus, "--duration", "0.2", "--out", tmp_path / "out")
    assert code == 0 and "No frame was received: is it this channel" in out


def test_other_interfaces_are_named_where_one_is_not_known(run, tmp_path):
    vehicle = ("--vehicle", "truck", "--duration", "0.1", "--out", tmp_path / "out")
    unknown = run("monitor", "--interface", "socketkan", *vehicle)[2]
    assert "interfaces that python-can knows: " in unknown and "socketcan" in unknown
    refused = run("monitor", "--interface", "udp_multicast", "--channel", "1.2.3.4", *vehicle)[2]
    assert "bus udp_multicast 1.2.3.4: cannot be opened" in refused
    assert "interfaces that python-can knows" not in refused


@pytest.mark.parametrize("inside", ["", "deeper/still"])
@pytest.mark.parametrize("verb", ["replay", "identify", "diagnose", "discover", "inspect"])
def test_a_folder_for_results_is_asked_for_before_the_work(run, tmp_path, verb, inside):
    file = tmp_path / "file"
    file.write_text("mine")
    code, _, err = run(verb, "no.log", "--out", file / inside)  # nor is there such a log
    assert code == 1
    assert err == f"clutchest: {file}: is a file, expected a folder for the results\n"
    assert file.read_text() == "mine"


def test_out_of_memory_is_one_line(run, tmp_path):
    arguments = ["simulate", "--vehicle", "truck", "--scenario", "city", "--seed", 1]
    code, out, err = run(*arguments, "--duration", 1e13, "-o", tmp_path / "x.log")
    assert (code, out) == (1, "") and err.startswith("clutchest: ") and err.count("\n") == 1


def test_a_broken_log_is_one_line(run, tmp_path):
    broken = tmp_path / "broken.log"
    broken.write_bytes(bytes(range(256)) * 20)
    for arguments in (
        ["inspect", broken, "--out", tmp_path / "out"],
        ["replay", broken, "--vehicle", "truck", "--out", tmp_path / "out"],
        ["convert", broken, "-o", tmp_path / "x.asc"],
    ):
        code, out, err = run(*arguments)
        assert (code, out) == (1, "")
        assert err.count("\n") == 1 and "broken.log" in err


def test_convert_keeps_every_frame(run, log, tmp_path):
    code, out, err = run("convert", log, "-o", tmp_path / "new" / "drive.mf4", "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    before, after = read_frames(log), read_frames(tmp_path / "new" / "drive.mf4")
    assert told["frames"] == len(before) == len(after)
    np.testing.assert_array_equal(before.t_ns, after.t_ns)
    np.testing.assert_array_equal(before.data, after.data)


def test_convert_joins_by_time(run, log, tmp_path):
    frames = read_frames(log)
    from clutchest.can.files import write_frames

    half = len(frames) // 2
    write_frames(frames.take(np.arange(half)), tmp_path / "a.log")
    write_frames(frames.take(np.arange(half, len(frames))), tmp_path / "b.log")
    code, _, _ = run("convert", tmp_path / "b.log", tmp_path / "a.log", "-o", tmp_path / "c.log")
    joined = read_frames(tmp_path / "c.log")
    assert code == 0
    np.testing.assert_array_equal(joined.t_ns, frames.t_ns)
    console = tmp_path / "relative.log"
    console.write_text("".join(f" (000.{k:06d})  can0  123   [2]  AB CD\n" for k in range(5)))
    code, _, err = run("convert", tmp_path / "a.log", console, "-o", tmp_path / "c.log")
    assert code == 1 and "relative.log: its clock only counts from its own start" in err
    assert len(read_frames(tmp_path / "c.log")) == len(frames)  # what was there stays


def test_simulate_writes_log_and_truth(run, tmp_path):
    code, out, err = run(
        "simulate",
        "--vehicle",
        "truck",
        "--scenario",
        "ramps",
        "--seed",
        3,
        "--duration",
        5,
        "--nominal",
        "--effect",
        "wear:amount=0.5,rate=0.1",
        "-o",
        tmp_path / "x.csv",
        "--json",
    )
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["effects"] == {"wear": {"amount": 0.5, "rate": 0.1}}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.csv", "x.csv.truth.parquet"]
    truth = pd.read_parquet(told["truth"])
    assert {"time", "temp_disc", "clutch_torque", "mode"} <= set(truth)
    assert abs(truth.zero_position.iloc[0] - (38.4 - 0.5)) < 1e-6
    assert "engine_speed" in pd.read_csv(told["log"], nrows=3)


def test_simulate_without_a_seed_is_that_of_python(run, tmp_path):
    log = tmp_path / "x.csv"
    arguments = ["simulate", "--vehicle", "truck", "--scenario", "city", "--duration", 5, "-o", log]
    code, out, err = run(*arguments)
    assert (code, err) == (0, "") and out.endswith("(city, seed 0)\n")
    signals = clutchest.simulate("truck", "city", duration=5.0)
    assert repr(signals).startswith("<Signals: city, seed 0: ")
    written = clutchest.read_log(log, "truck")
    np.testing.assert_allclose(written["engine_speed"].value, signals["engine_speed"].value)
    about = pq.read_schema(f"{log}.truth.parquet").metadata
    assert about[b"seed"] == b"0"


def test_replay_and_carry_on(run, log, tmp_path):
    code, out, err = run(
        "replay",
        log,
        "--vehicle",
        "truck",
        "--out",
        tmp_path / "a",
        "--innovations",
        "--json",
        "--rate",
        5,
    )
    assert (code, err) == (0, "")
    summary = json.loads(out)
    assert summary == json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))
    assert summary["frames"] == len(read_frames(log)) == summary["frames_decoded"]
    table = pd.read_parquet(tmp_path / "a" / "estimates.parquet")
    assert {
        "time",
        "drive",
        "mode",
        "temp_disc",
        "temp_disc_std",
        "temp_disc_valid",
        "clutch_torque",
        "clutch_torque_std",
        "slip_energy",
    } <= set(table)
    assert np.isclose(np.median(np.diff(table.time)), 0.2)
    misfits = pd.read_parquet(tmp_path / "a" / "innovations.parquet")
    assert set(misfits.sensor) <= set(summary["sensors"])
    chunks = RrdReader(tmp_path / "a" / "recording.rrd").stream().to_chunks()
    for name in ("temp_disc", "clutch_torque"):
        (shown,) = [c for c in chunks if c.entity_path == f"/state/{name}" and not c.is_static]
        values = shown.to_record_batch()["Measurements:values"].to_pylist()
        np.testing.assert_array_equal([value for (value,) in values], table[name])

    vehicle = clutchest.load_vehicle("truck")
    later = tmp_path / "later.log"
    from clutchest.simulated import write_simulation

    write_simulation(later, vehicle, "launches", 5, duration=30.0)
    state = tmp_path / "a" / "state.json"
    code, out, _ = run(
        "replay", later, "--vehicle", "truck", "--state", state, "--out", tmp_path / "b"
    )
    assert code == 0
    assert "disc temperature" in out and "±" in out and "recording.rrd" in out
    fresh = json.loads(
        run("replay", later, "--vehicle", "truck", "--out", tmp_path / "c", "--json")[1]
    )
    carried = json.loads((tmp_path / "b" / "summary.json").read_text(encoding="utf-8"))
    # what the first drive taught about the pads is not forgotten
    assert carried["states"]["zero_position"]["std"] < fresh["states"]["zero_position"]["std"]

    state.write_text(json.dumps(json.loads(state.read_text("utf-8")) | {"x": [1.0]}), "utf-8")
    code, _, err = run(
        "replay", later, "--vehicle", "truck", "--state", state, "--out", tmp_path / "d"
    )
    assert code == 1
    assert f"{state}: the carried-over state is damaged: 'x' must be" in " ".join(err.split())


def test_progress_on_a_terminal_only(monkeypatch, capsys):
    with terminal.progress() as show:
        show("counting sheep", 0.5)
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with terminal.progress() as show:
        show("counting sheep", None)
        show("counting sheep", 0.5)
    out, err = capsys.readouterr()
    assert out == "" and "counting sheep" in err


def test_interrupt_and_closed_pipe_are_quiet(log, tmp_path):
    done = python(
        """
import sys
from clutchest import cli
import clutchest.can.files as files
def interrupted(*asked):
    raise KeyboardInterrupt
files.read_frames = interrupted
cli.main()
""",
        "convert",
        str(log),
        "-o",
        str(tmp_path / "x.asc"),
    )
    assert done.returncode == 130
    assert "Traceback" not in done.stderr and done.stderr.count("\n") <= 2
    assert list(tmp_path.iterdir()) == []

    code = "from clutchest.cli import main; main()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", code, "inspect", str(log), "--out", str(tmp_path), "--json"]
    with subprocess.Popen(
        command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == ""


def test_convert_decodes_with_a_vehicle_and_rewrites_tables(run, log, tmp_path):
    table, again = tmp_path / "d.parquet", tmp_path / "d.csv"
    assert run("convert", log, "--vehicle", "truck", "-o", table)[0] == 0
    code, out, _ = run("convert", table, "-o", again, "--json")
    assert code == 0 and json.loads(out)["samples"] > 1000
    truck = clutchest.load_vehicle("truck")
    first, last = clutchest.read_log(table, truck), clutchest.read_log(again, "truck")
    assert set(first) == set(last) == set(truck.signals)
    for name in first:
        np.testing.assert_array_equal(first[name].value, last[name].value)
    code, _, err = run("convert", log, "-o", table)
    assert code == 1 and "name a vehicle" in err
    code, _, err = run("convert", log, table, "-o", tmp_path / "x.log")
    assert code == 1 and "holds decoded signals" in err
    code, _, err = run("inspect", log, table, "--out", tmp_path / "both")
    assert code == 1 and len(err.splitlines()) == 1
    assert f"{table} holds decoded signals, {log} holds frames; inspect them one after the" in err
    assert run("inspect", table, "--out", tmp_path / "drafted")[0] == 0
    draft = tmp_path / "drafted" / "vehicle.toml"
    code, _, err = run("replay", table, log, "--vehicle", draft, "--out", tmp_path / "both")
    assert code == 1 and f"{log} holds frames, and vehicle.toml has no 'dbc'" in err
