"""The verb `discover`: what it asks the search for, prints and writes, and its complaints."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path

import pytest

from clutchest import cli
from clutchest.vehicle import load_vehicle
from discoveries import GAIN, VERDICTS, discovery

MANUAL = Path(__file__).parents[2] / "docs" / "discover.md"


def effect_of_the_manual() -> str:
    return MANUAL.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a command line in this process: (exit code, stdout, stderr)."""

    def call(*arguments) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["clutchest", "discover", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        return (end.value.code or 0, *capsys.readouterr())

    return call


@pytest.fixture
def search(monkeypatch):
    """Stands in for the search: gives ``search.answer``, keeps what it was asked."""

    class Search:
        def __init__(self):
            self.answer = discovery("named")
            self.asked: list[dict] = []

        def __call__(
            self,
            signals,
            vehicle,
            *,
            holdout=None,
            effects_files=(),
            progress=None,
            on_identifiability=None,
        ):
            progress("trying causes", 0.5)
            if on_identifiability:
                on_identifiability(self.answer.identifiability)
            self.asked.append(
                {"signals": signals, "vehicle": vehicle, "holdout": holdout, "files": effects_files}
            )
            return self.answer

    made = Search()
    # by sys.modules: the attribute of that name may be the function
    monkeypatch.setattr(import_module("clutchest.discovery.discover"), "discover", made)
    return made


@pytest.fixture(scope="session")
def logs(tmp_path_factory):
    from clutchest.simulated import write_simulation

    folder, truck = tmp_path_factory.mktemp("logs"), load_vehicle("truck")
    paths = [folder / "found.csv", folder / "kept.csv", folder / "kept_too.csv"]
    for seed, path in enumerate(paths):
        write_simulation(path, truck, "launches", seed, duration=10.0)
    return paths


def test_what_the_search_is_asked(run, search, logs, tmp_path):
    found, kept, kept_too = logs
    mine = tmp_path / "mine.py"
    mine.write_text(effect_of_the_manual(), encoding="utf-8")
    code, _, err = run(
        found,
        "--vehicle",
        "truck",
        "--holdout",
        kept,
        "--holdout",
        kept_too,
        "--effects",
        mine,
        "--out",
        tmp_path / "out",
    )
    assert (code, err) == (0, "")
    (asked,) = search.asked
    assert asked["vehicle"] == load_vehicle("truck")
    assert asked["signals"].sources == (str(found),) and asked["files"] == (mine,)
    assert [drive.sources for drive in asked["holdout"]] == [(str(kept),), (str(kept_too),)]
    assert all(drive.later == () for drive in asked["holdout"])
    assert run(found, "--vehicle", "truck", "--out", tmp_path / "out")[0] == 0
    assert search.asked[1]["holdout"] is None and search.asked[1]["files"] == ()


@pytest.mark.parametrize("gain", [GAIN, None], ids=["held out", "nothing held out"])
@pytest.mark.parametrize("verdict", VERDICTS)
def test_json_and_nothing_else(run, search, logs, tmp_path, verdict, gain):
    search.answer = discovery(verdict, gain)
    code, out, err = run(logs[0], "--vehicle", "truck", "--out", tmp_path / "out", "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["verdict"] == verdict and (told["gain"] is None) == (gain is None)
    assert told == json.loads((tmp_path / "out" / "discovery.json").read_text("utf-8"))
    files = {"discovery.json", "extended.toml", "misfit.png", "recording.rrd", "report.html"}
    files |= {"report.md"}
    assert {p.name for p in (tmp_path / "out").iterdir()} == files


@pytest.mark.parametrize("verdict", VERDICTS)
def test_words(run, search, logs, tmp_path, verdict):
    search.answer = discovery(verdict)
    code, out, err = run(logs[0], "--vehicle", "truck", "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    text = " ".join(out.split())
    assert f"In one sentence: {verdict}." in text
    assert "[95 %: 98.1 to 170.3]" in text
    assert f"Written to {tmp_path / 'out'}: discovery.json, extended.toml, misfit.png" in out
    assert f"rerun {tmp_path / 'out' / 'recording.rrd'}" in out
    commands = [line for line in out.splitlines() if line.startswith("  clutchest simulate")]
    assert len(commands) == (verdict == "ambiguous")
    heading = (tmp_path / "out" / "extended.toml").read_text("utf-8").splitlines()[1]
    nothing = verdict == "none"
    assert ("Nothing was added to the model: extended.toml is truck.toml as it was" in text) == (
        heading.startswith("# Nothing was added: ")
    )
    assert heading.startswith("# Nothing was added: ") == nothing
    added = json.loads((tmp_path / "out" / "discovery.json").read_text("utf-8"))["added"]
    assert bool(added) != nothing


@pytest.mark.parametrize(
    "where", ["log", "holdout", "effects", "no effect", "no Python", "twice", "vehicle"]
)
def test_bad_input_is_one_line(run, search, logs, tmp_path, monkeypatch, where):
    monkeypatch.chdir(tmp_path)
    broken, empty = tmp_path / "broken.log", tmp_path / "empty.py"
    broken.write_bytes(bytes(range(256)) * 20)
    empty.write_text("x = 1\n", encoding="utf-8")
    log, out = logs[0], tmp_path / "out"
    truck = ("--vehicle", "truck", "--out", out)
    arguments, complaint = {
        "log": (["gone.log", *truck], "no such file: gone.log"),
        "holdout": ([log, *truck, "--holdout", broken], "broken.log"),
        "effects": ([log, *truck, "--effects", "gone.py"], "gone.py: no such file"),
        "no effect": ([log, *truck, "--effects", empty], "empty.py: expected a subclass of"),
        "no Python": ([log, *truck, "--effects", broken], "expected a Python file"),
        "twice": ([log, *truck, "--holdout", log], "is given as LOG and as --holdout"),
        "vehicle": ([log, "--vehicle", "truk", "--out", out], "did you mean 'truck'?"),
    }[where]
    code, printed, err = run(*arguments)
    assert (code, printed) == (1, "")
    assert err.startswith("clutchest: ") and err.count("\n") == 1 and complaint in err
    assert search.asked == [] and not out.exists()


def test_no_vehicle_is_wrong_usage(run):
    code, out, err = run("x.log")
    assert (code, out) == (2, "") and "--vehicle" in err
