"""What a newcomer meets: start-up time, README, manual, shipped files, the wheel."""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import re
import runpy
import shlex
import subprocess
import sys
import zipfile
from dataclasses import fields
from importlib.metadata import version
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.estimate.run import Run
from clutchest.models import machine_of
from clutchest.models.regimes import MODE_NAMES
from clutchest.models.thresholds import THRESHOLD_UNITS
from clutchest.shipped import locate, shipped
from clutchest.vehicle import Estimation, signals_section
from clutchest.vehicle import file as vehicle_file

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MANUAL = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}


def blocks(language: str) -> list[str]:
    """The fenced blocks of README in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def demo() -> Run:
    truck = clutchest.load_vehicle("truck")
    return clutchest.replay(clutchest.read_log("demo", truck), truck)


def test_starts_without_what_is_heavy():
    """Beside the import of numpy alone, which takes some 0.15 s: whatever else the machine does
    meets both."""
    resource = pytest.importorskip("resource", reason="POSIX counts the time of other processes")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}

    def seconds(*arguments: str) -> float:
        begin = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        subprocess.run(
            [sys.executable, *arguments],
            env=environment,
            check=True,
            capture_output=True,
            timeout=60,
        )
        return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - begin

    bare, heavy, package, helped = np.min(
        [
            [
                seconds("-c", "pass"),
                seconds("-c", "import numpy"),
                seconds("-c", "import clutchest"),
                seconds("-m", "clutchest", "--help"),
            ]
            for _ in range(5)
        ],
        axis=0,
    )
    assert package - bare < 0.5 * (heavy - bare)
    assert helped - bare < 3.0 * (heavy - bare)


def test_packages_that_are_called_have_the_signature_of_what_they_call():
    for package, function in (
        (clutchest.fleet, clutchest.analyse_fleet),
        (clutchest.identify, clutchest.identify_vehicle),
    ):
        assert inspect.signature(package) == inspect.signature(function)


@pytest.mark.slow
def test_programs_of_others_can_be_checked_by_their_types(tmp_path):
    """The calls of the pages, by mypy."""
    api = pytest.importorskip("mypy.api")
    (tmp_path / "theirs.py").write_text(
        """
import numpy as np
import clutchest
from clutchest import can

drive = clutchest.simulate("truck", "city", seed=3, duration=300, effects_files=["a.py"])
run = clutchest.replay([drive, drive], "truck", rate=10)
mean: float = run["temp_disc"].value.mean()
found = clutchest.discover(drive, "truck", holdout=[drive], effects_files=["a.py"])
fit = clutchest.identify("I1", drive, found.extended, benches="rotor-held", progress=None)
fleet = clutchest.fleet("trucks", fit.vehicle, "out", workers=2, progress=None)
plan = clutchest.feedforward("alsd_rig", (np.arange(3.0), np.arange(3.0)))
can.write_frames(can.read_frames("a.blf"), "b.log")
clutchest.machine.Machine
"""
    )
    said, _, code = api.run(["--strict", str(tmp_path / "theirs.py")])
    assert code == 0, said


def test_installed_version_is_the_package_s():
    assert version("clutchest") == clutchest.__version__


def test_readme_example_prints_what_it_says(demo):
    (code,), (printed,) = blocks("python"), blocks("text")
    assert code.count("\n") == 5
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "README.md", "exec"), {})
    assert out.getvalue() == printed
    assert printed.count("\n") == len(demo.summary["engagements"]) == 4


def test_ci_runs_the_lines_of_the_readme():
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    lines = [block.strip() for block in blocks("sh")]
    assert len(lines) == 2 and not any("\n" in line for line in lines)
    for line in lines:
        assert line in [text.strip() for text in ci]


@pytest.mark.slow
def test_three_commands_of_the_readme_find_a_hidden_cause(tmp_path):
    (block,) = blocks("console")
    commands = block.splitlines()
    assert len(commands) == 3
    said = []
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "clutchest"
        ran = subprocess.run(
            [sys.executable, "-m", "clutchest", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
            timeout=600,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "200"},
        )
        said.append(ran.stdout)
    verdict = re.compile(r"data require (\w+) \((\w+) = (\S+) ± ([\d.]+) per 100 rad/s")
    (stated,), (printed,) = verdict.findall(README), verdict.findall(said[1])
    assert printed[:2] == stated[:2] == ("friction_speed", "slope")
    (value, sigma), (size, spread) = map(float, stated[2:]), map(float, printed[2:])
    assert abs(size - value) < 0.5 * sigma and abs(spread - sigma) < 0.2 * sigma, "the page is old"
    assert abs(size + 0.12) < 3 * spread


def test_demo_shows_what_the_estimator_does(demo):
    """Launches, a hot disc, the zero position read in between: a log worth shipping."""
    assert demo.summary["frames_decoded"] == demo.summary["frames"] > 50_000
    assert demo.summary["warnings"] == []
    assert max(event.peak_temp_disc for event in demo.tracks[0].engagements) > 120.0
    assert demo.summary["modes_s"]["retracted"] > 60.0
    known = {name for name, state in demo.summary["states"].items() if state["valid"]}
    assert set(demo.summary["states"]) - known == {"wear_rate"}, "four launches tell no trend"
    assert locate("demo", "logs").stat().st_size < 3e6


@pytest.mark.parametrize("name", shipped("vehicles"))
def test_shipped_vehicle_loads_and_is_in_the_readme(name):
    vehicle = clutchest.load_vehicle(name)
    assert vehicle.name == name
    assert f"| `{name}` |" in README
    for dbc in (file.path for file in vehicle.dbc):
        text = (ROOT / "vehicles" / f"{name}.toml").read_text(encoding="utf-8")
        assert dbc.is_file() or f"put\n# {dbc} (" in text, "told in the heading where to find it"


@pytest.mark.parametrize("page", ["README.md", *(f"docs/{name}" for name in MANUAL)])
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    targets = [t for t in re.findall(r"\]\(([^)]+)\)", text) if "://" not in t]
    assert [t for t in targets if not leads_somewhere(ROOT / page, t)] == []


def leads_somewhere(page: Path, target: str) -> bool:
    """Whether the file that a link names exists, and has the heading."""
    name, _, heading = target.partition("#")
    there = page.parent / name if name else page
    if not heading or not there.exists():
        return there.exists()
    headings = re.findall(r"^#+ (.+)$", there.read_text(encoding="utf-8"), re.MULTILINE)
    return heading in [re.sub(r"[^\w\- ]", "", h).lower().replace(" ", "-") for h in headings]


def test_effects_page_is_that_of_the_library():
    page = runpy.run_path(str(ROOT / "docs" / "make_effects.py"))["page"]()
    assert page == MANUAL["effects.md"], "run python docs/make_effects.py"


def test_vehicle_file_page_names_every_key():
    dry = machine_of("dry_clutch")
    keys = chain(
        vehicle_file._TOP,
        signals_section._KEYS,
        THRESHOLD_UNITS,
        vehicle_file.MONITORS,
        vehicle_file.ROLES,
        dry.limits,
        dry.units,
        (parameter.key for parameter in dry.parameters),
        (field.name for field in fields(Estimation)),
    )
    words = set(re.findall(r"[\w]+", MANUAL["vehicle-file.md"]))
    assert set(keys) - words == set()


def test_pages_name_every_output_and_state(demo):
    files, model = MANUAL["files.md"], MANUAL["model.md"]
    states = list(demo.tracks[0].states)
    own = {f"{state}{ending}" for state in states for ending in ("", "_std", "_valid")}
    named = [
        *(set(demo.to_pandas().columns) - own),
        *demo.summary,
        *demo.summary["engagements"][0],
        *demo.summary["sensors"]["engine_speed"],
        *demo.summary["states"]["friction"],
    ]
    assert [name for name in named if f"`{name}`" not in files] == []
    assert [name for name in (*states, *MODE_NAMES) if f"`{name}`" not in model] == []


def test_equations_in_the_manual_name_functions_that_exist():
    from clutchest.models.dry_clutch import equations

    rows = re.findall(r"^\|[^|]*\|[^\n]*\| `(\w+)` \|$", MANUAL["model.md"], re.MULTILINE)
    assert len(rows) > 10
    assert [name for name in rows if not callable(getattr(equations, name, None))] == []


def test_wheel_holds_the_package_and_everything_shipped(tmp_path):
    from hatchling.builders.wheel import WheelBuilder

    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    modules = {
        p.relative_to(ROOT / "src").as_posix()
        for p in (ROOT / "src").rglob("*")
        if p.suffix in (".py", ".json", ".typed")
    }
    data = {
        f"clutchest/data/{kind}/{path.name}"
        for kind in ("dbc", "logs", "vehicles")
        for path in shipped(kind).values()
    }
    about = {name for name in names if name.startswith(f"clutchest-{clutchest.__version__}.dist")}
    assert names - about == modules | data
    assert len(data) >= 5
    assert any(name.endswith("entry_points.txt") for name in about)
