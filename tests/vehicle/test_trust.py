"""A vehicle file is data: the Python that it names runs only once its user has said so."""

from __future__ import annotations

import json
import os
import py_compile
import subprocess
import sys
from pathlib import Path

import pytest

from clutchest import cli
from clutchest.errors import ClutchestError
from clutchest.record.discovery import trust_written
from clutchest.shipped import locate
from clutchest.vehicle import dump_vehicle, load_vehicle
from clutchest.vehicle.trust import trust, trust_folder

EFFECT = """
from pathlib import Path
from clutchest.machine import Effect, Number
Path(__file__).with_name("ran").touch()
class Humidity(Effect):
    name, model, equation = "humidity", "dry_clutch", "torque"
    parameters = (Number("change", "1", -0.1, 0.1),)
"""
TRUCK = locate("truck", "vehicles").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("CLUTCHEST_TRUST", str(tmp_path / "user" / "trusted"))
    return tmp_path / "user" / "trusted"


def written(folder: Path, entry: str = "mine.py", source: str = EFFECT) -> Path:
    """A truck that names a file of effects which leaves a trace where it runs."""
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(source, encoding="utf-8")
    path = folder / "v.toml"
    path.write_text(
        TRUCK.replace('name = "truck"', f'name = "own"\neffects_files = ["{entry}"]', 1),
        encoding="utf-8",
    )
    return path


def refusal(path: Path, **options) -> str:
    with pytest.raises(ClutchestError) as caught:
        load_vehicle(path, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def called(monkeypatch, capsys, *arguments) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["clutchest", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        cli.main()
    return (end.value.code or 0, *capsys.readouterr())


def test_nothing_runs_before_it_is_trusted(tmp_path, own_folder, monkeypatch, capsys):
    path = written(tmp_path / "car")
    text = refusal(path)
    assert text.startswith("v.toml:") and "mine.py" in text and "clutchest trust v.toml" in text
    code, _, error = called(monkeypatch, capsys, "replay", "demo", "--vehicle", path)
    assert code == 1 and len(error.splitlines()) == 1
    assert not (tmp_path / "car" / "ran").exists()
    code, out, _ = called(monkeypatch, capsys, "trust", path, "--json")
    assert code == 0 and json.loads(out)[0]["runs"] == [str(tmp_path / "car" / "mine.py")]
    assert not (tmp_path / "car" / "ran").exists(), "to trust a file does not run it"
    load_vehicle(path)
    assert (tmp_path / "car" / "ran").exists()
    assert len(list(own_folder.iterdir())) == 1


def test_what_is_no_python_is_not_trusted_and_named_at_once(
    tmp_path, own_folder, monkeypatch, capsys
):
    path = written(tmp_path / "car", source=EFFECT + "class Humidty(Effect:\n")
    code, out, error = called(monkeypatch, capsys, "trust", path)
    line = len(EFFECT.splitlines()) + 1
    assert code == 1 and not out and len(error.splitlines()) == 1
    assert f"mine.py:{line}: SyntaxError: " in error
    assert not own_folder.exists() and not (tmp_path / "car" / "ran").exists()


@pytest.mark.parametrize("named", ["v.toml", "mine.py", "own.dbc"])
def test_whatever_changes_has_to_be_trusted_anew(tmp_path, named):
    path = written(tmp_path / "car")
    (tmp_path / "car" / "own.dbc").write_text('VERSION ""\n')
    path.write_text(path.read_text().replace("dbc = [", 'dbc = ["own.dbc", ', 1))
    trust(path)
    load_vehicle(path)
    with (tmp_path / "car" / named).open("a") as file:
        file.write("\n")
    assert "not trusted, or was changed" in refusal(path)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders of a user are the user's there")
def test_the_same_content_is_trusted_elsewhere_and_by_no_other_user(tmp_path, own_folder):
    trust(written(tmp_path / "car"))
    load_vehicle(written(tmp_path / "copy"))
    (own_folder / next(own_folder.iterdir()).name).chmod(0o666)
    assert "not trusted" in refusal(written(tmp_path / "copy"))


@pytest.mark.parametrize("entry", ["../mine.py", "{absolute}", "deeper/../../mine.py", "link.py"])
def test_only_files_below_the_vehicle_file_are_named(tmp_path, entry):
    outside = tmp_path / "mine.py"
    outside.write_text(EFFECT)
    path = written(tmp_path / "car", entry.format(absolute=outside))
    (tmp_path / "car" / "link.py").symlink_to(outside)
    assert "is not below this vehicle file's folder" in refusal(path, trust=True)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("entry", ["mine.so", "mine.pyc", "mine"])
def test_only_source_is_run(tmp_path, entry):
    path = written(tmp_path / "car", entry)
    (tmp_path / "car" / entry).write_text(EFFECT)
    assert "expected a file (.py)" in refusal(path, trust=True)


def test_compiled_code_beside_the_source_is_not_run(tmp_path):
    path = written(tmp_path / "car")
    source, planted = tmp_path / "car" / "mine.py", tmp_path / "evil.py"
    planted.write_text(EFFECT.replace('"ran"', '"evil"'))
    os.utime(planted, (source.stat().st_mtime,) * 2)
    cache = tmp_path / "car" / "__pycache__" / f"mine.{sys.implementation.cache_tag}.pyc"
    py_compile.compile(
        str(planted), str(cache), invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH
    )
    load_vehicle(path, trust=True)
    assert (tmp_path / "car" / "ran").exists() and not (tmp_path / "car" / "evil").exists()


@pytest.mark.parametrize(
    "raised", ["SystemExit(0)", "KeyboardInterrupt", "GeneratorExit", "OSError"]
)
def test_whatever_a_file_raises_is_one_line_and_exit_1(tmp_path, monkeypatch, capsys, raised):
    path = written(tmp_path / "car", source=f"raise {raised}\n")
    code, out, error = called(monkeypatch, capsys, "replay", "demo", "--vehicle", path, "--trust")
    assert code == 1 and not out and len(error.splitlines()) == 1
    assert f"mine.py:1: {raised.split('(')[0]}" in error


def test_what_python_says_of_a_trusted_file_is_not_printed(tmp_path, recwarn):
    source = EFFECT + '1 is 1\nimport warnings\nwarnings.warn("of its own")\n'
    load_vehicle(written(tmp_path / "car", source=source), trust=True)
    assert (tmp_path / "car" / "ran").exists()
    assert [w for w in recwarn if not issubclass(w.category, ResourceWarning)] == []


def test_content_that_changed_after_loading_is_not_run(tmp_path):
    vehicle = load_vehicle(written(tmp_path / "car"), trust=True)
    (tmp_path / "car" / "mine.py").write_text(EFFECT + "\n")
    (other := tmp_path / "out").mkdir()
    with pytest.raises(ClutchestError, match=r"mine\.py: was changed after its vehicle was loaded"):
        _ = vehicle.library
    with pytest.raises(ClutchestError, match=r"mine\.py: was changed after its vehicle was loaded"):
        dump_vehicle(vehicle, other / "copy.toml")


def test_what_is_written_here_takes_its_python_along_and_is_trusted(tmp_path):
    vehicle = load_vehicle(written(tmp_path / "car"), trust=True)
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.py").write_text("# a file of the user's\n")
    dump_vehicle(vehicle, out / "extended.toml")
    assert "not trusted" in refusal(out / "extended.toml")
    trust_written(vehicle, out / "extended.toml")
    again = load_vehicle(out / "extended.toml")
    assert again == vehicle and again.effects_files[0].parent == out
    assert (out / "mine.py").read_text() == "# a file of the user's\n"


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders of a user are the user's there")
def test_a_folder_that_others_may_write_to_is_said(tmp_path, own_folder):
    own_folder.mkdir(parents=True)
    own_folder.chmod(0o777)
    with pytest.raises(ClutchestError, match="others may write there"):
        trust(written(tmp_path / "car"))


def test_the_folder_is_the_users_own(monkeypatch):
    monkeypatch.delenv("CLUTCHEST_TRUST")
    assert trust_folder().is_relative_to(Path.home())


def test_shipped_vehicles_need_no_trust():
    command = [sys.executable, "-c", "import clutchest; clutchest.load_vehicle('truck')"]
    assert subprocess.run(command, check=False).returncode == 0
