"""Vehicle files of a user's own machine: its names are checked, and errors name file, line, key."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from shutil import copy

import pytest

from clutchest.errors import ClutchestError
from clutchest.vehicle import dump_vehicle, load_vehicle

THIRD = Path(__file__).resolve().parents[1] / "benches" / "third"


@pytest.fixture
def own(tmp_path: Path) -> Callable[..., Path]:
    """The third clutch's files in a folder, with (old, new) texts of the vehicle file exchanged."""
    copy(THIRD / "plate.py", tmp_path)

    def write(*changes: tuple[str, str], extra: str = "") -> Path:
        text = (THIRD / "vehicle.toml").read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "own.toml"
        path.write_text(text + extra, encoding="utf-8")
        return path

    return write


def complaint(path: Path) -> str:
    with pytest.raises(ClutchestError) as caught:
        load_vehicle(path, trust=True)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_machine_in_a_file_is_loaded_and_written_beside_its_copy(own, tmp_path: Path) -> None:
    vehicle = load_vehicle(own(), trust=True)
    assert vehicle.machine.name == "third"
    copy_of = tmp_path / "deeper" / "copy.toml"
    copy_of.parent.mkdir()
    dump_vehicle(vehicle, copy_of)
    assert 'model = "plate.py"' in copy_of.read_text(encoding="utf-8")
    copied = load_vehicle(copy_of, trust=True)
    assert copied.model_file == copy_of.with_name("plate.py") and copied == vehicle


def test_the_hash_covers_the_machine(own, tmp_path: Path) -> None:
    path = own()
    before = load_vehicle(path, trust=True)
    source = tmp_path / "plate.py"
    source.write_text(source.read_text().replace('"dry plate on a shaft"', '"wet plate"'))
    after = load_vehicle(path, trust=True)
    assert after.hash != before.hash
    assert after.machine.what == "wet plate"
    assert before.machine.what == "dry plate on a shaft", "a vehicle in use keeps its machine"


def test_another_content_than_the_vehicles_is_refused(own) -> None:
    vehicle = load_vehicle(own(), trust=True)
    other = replace(vehicle, digests={vehicle.model_file: sha256(b"not loaded here").hexdigest()})
    with pytest.raises(
        ClutchestError, match=r"plate\.py: was changed after its vehicle was loaded"
    ):
        _ = other.machine


MODEL = 'model = "plate.py"'


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        (
            "plaet.py",
            "no such file: plaet.py (relative to this vehicle file); did you mean 'plate.py'?",
        ),
        (
            "plate",
            'the machine of plate.py is named by its file: model = "plate.py"',
        ),
        ("alsdd", "unknown model 'alsdd'; did you mean 'alsd'?"),
    ],
)
def test_a_model_that_is_not_there_names_the_nearest(own, named: str, expected: str) -> None:
    text = complaint(own((MODEL, f'model = "{named}"')))
    assert text.startswith("own.toml:2: ")
    assert expected in text


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("x = 1\n", "expected one clutchest.machine.Machine at the top level, it defines none"),
        (
            "import math\nfrom neighbour import MACHINE\n",
            "servo.py:2: ModuleNotFoundError: No module named 'neighbour'",
        ),
        ("def broken(:\n", "servo.py:1: SyntaxError: invalid syntax"),
        (
            "x = 1\n\nraise ValueError('two\\nlines')\n",
            "servo.py:3: ValueError: two lines",
        ),
    ],
)
def test_a_file_without_a_machine_says_so(own, tmp_path, content: str, expected: str) -> None:
    (tmp_path / "servo.py").write_text(content)
    text = complaint(own((MODEL, 'model = "servo.py"')))
    assert text.startswith("own.toml:2: ")
    assert expected in text


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("equations=lambda signals: MODEL,", ""), "missing 1 required positional argument"),
        (
            ('Column("drive_torque", "Nm"),', ""),
            "machine 'third': inputs have no column 'drive_torque'",
        ),
        (('anchor="slip_speed"', 'anchor="slip"'), "machine 'third': equations have no column"),
        (
            ('late=("drive_torque", 0.01)', 'late=("drive_torque", 0.01), covariates=("tmep",)'),
            "error term 'timing:drive_torque' has no covariate 'tmep'; did you mean ",
        ),
    ],
)
def test_an_invalid_machine_names_its_line_and_piece(own, tmp_path, change, expected) -> None:
    source = tmp_path / "plate.py"
    code = source.read_text(encoding="utf-8")
    assert change[0] in code
    source.write_text(code.replace(*change), encoding="utf-8")
    text = complaint(own())
    assert text.startswith("own.toml:2: ")
    assert "plate.py:" in text
    assert expected in text


@pytest.mark.parametrize(
    ("change", "extra", "line", "expected"),
    [
        (
            ("slip_speed = {", "slip_sped = {"),
            "",
            "slip_sped",
            "unknown signal of 'third' 'slip_sped'; did you mean 'slip_speed'",
        ),
        (
            ("inertia =", "inertai ="),
            "",
            "inertai",
            "unknown parameter 'inertai'; did you mean 'inertia'",
        ),
        (
            None,
            "\n[estimation]\ntmep = { role = 'constant' }\n",
            "tmep",
            "unknown state 'tmep'; did you mean 'temp'?",
        ),
        (
            None,
            "\n[estimation]\ntemp = { initial_std = -1 }\n",
            "temp = { initial_std",
            "estimation.temp.initial_std = -1 must be at least 0",
        ),
        (
            None,
            "\n[limits]\nwear = 3.0\n",
            "wear = 3.0",
            "unknown limit of 'third' 'wear'; none is expected here",
        ),
        (
            None,
            "\n[modes]\nlock_slp = 1.0\n",
            "lock_slp",
            "unknown threshold of 'third' 'lock_slp'; valid: gap",
        ),
        (
            None,
            "\n[effects]\nfaed = { slope = 0.1 }\n",
            "faed",
            "unknown effect of 'third' 'faed'; did you mean 'fade'?",
        ),
    ],
)
def test_sections_are_checked_against_the_machine(own, change, extra, line, expected) -> None:
    path = own(*([change] if change else []), extra=extra)
    text = complaint(path)
    lines = path.read_text(encoding="utf-8").splitlines()
    number = next(n for n, row in enumerate(lines, 1) if line in row)
    assert text.startswith(f"own.toml:{number}: ")
    assert expected in text


def test_estimation_of_a_users_state_fills_in_the_states_own_numbers(own) -> None:
    vehicle = load_vehicle(own(extra="\n[estimation]\ntemp = { role = 'constant' }\n"), trust=True)
    entry = vehicle.estimation["temp"]
    assert (entry.role, entry.process_noise, entry.initial_std) == ("constant", 0.1, 10.0)
