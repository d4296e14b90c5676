"""A user's own effects are refused in one line where they cannot be tested."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import clutchest
from clutchest.discovery.user_effects import user_effects
from clutchest.errors import ClutchestError

TRUCK = clutchest.load_vehicle("truck")
OWN = """
from clutchest.machine import Effect, Lateness, Number, State

class Own(Effect):
    name, model, equation = "own", "dry_clutch", "torque"
    parameters = (Number("size", "1", -0.5, 0.5),)

    def terms(self, g):
        return {"sliding_torque": lambda torque, q: torque * (1 + g.size * q.temp_disc / 100)}
"""

DELAYED = "\n    delays = {{'{}': 'size'}}"
TURNING = "\n    lateness = {'engine_torque': Lateness('time', (0.0, 9.0), (0.0, 0.1))}"


def written(folder: Path, old: str = "", new: str = "", name: str = "own.py") -> Path:
    assert old in OWN
    path = folder / name
    path.write_text(OWN.replace(old, new) if old else OWN, encoding="utf-8")
    return path


def test_what_can_be_looked_for_is_taken_once(tmp_path):
    path = written(tmp_path)
    (own,) = user_effects([path, tmp_path / "." / "own.py"], TRUCK)
    assert own.name == "own"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("name, model", "nmae, model", "class Own: expected a text as 'name'"),
        ("(Number(", "[Number(", "class Own: expected a tuple of clutchest.machine.Number"),
        ("Number(", "dict(size=1), (", "class Own: expected every parameter as Number(key"),
        ("-0.5, 0.5", "'a', 0.5", "class Own: expected every parameter as Number(key"),
        ("-0.5, 0.5),)", "-0.5, 0.5),); scales = {'x': 'sise'}", "'sise', expected one of size"),
        ("    parameters", "    def __init__(self): 1 / 0\n    parameters", "class Own cannot be"),
    ],
)
def test_a_class_that_declares_something_else_is_refused(tmp_path, old, new, words):
    source = OWN.replace(old, new)
    if new.startswith("["):
        source = source.replace("0.5),)", "0.5)]")
    (tmp_path / "own.py").write_text(source)
    with pytest.raises(ClutchestError, match=re.escape(words)) as caught:
        user_effects([tmp_path / "own.py"], TRUCK)
    assert str(caught.value).startswith(str(tmp_path / "own.py"))


def test_what_the_vehicle_has_already_is_left_out(tmp_path):
    path = written(tmp_path)
    has = replace(TRUCK, effects={"own": {"size": 0.1}}, effects_files=(path,))
    assert user_effects([path], has) == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("q.temp_disc", "q.temp_dsc", "uses 'temp_dsc', which does not exist; did you mean"),
        ("q.temp_disc", "q.temp_body_rate", "uses 'temp_body_rate' before the equations assign"),
        ("g.size", "g.sise", "uses 'sise', which does not exist; did you mean 'size'"),
        (
            '"sliding_torque"',
            '"sliding_torqe"',
            "changes 'sliding_torqe', not a quantity of the eq",
        ),
        ("g.size", "None", "cannot be evaluated: TypeError"),
        ("g.size", "max(g.size, 0.0)", "symbolic expression.; expected ca.fmax, ca.fmin or ca.if"),
        ("g.size", "g.size / 0.0", "makes a quantity that is not a finite number"),
        ('"torque"\n', '"torqe"\n', "acts in 'torqe', which is no equation; did you mean 'torque'"),
        ('"dry_clutch"', '"alsd"', "is of the model 'alsd', expected 'dry_clutch'"),
        ('"own", "dry', '"wear", "dry', "'wear' has the name of one in the library"),
        ("-0.5, 0.5", "-0.5, 0.0", "has size between -0.5 and 0, expected"),
        ("-0.5, 0.5", "0.1, 0.5", "has size between 0.1 and 0.5, expected"),
        ("0.5),)", "0.5, shape=True),)", "has no gain, expected at least one"),
        (
            "0.5),)",
            f"0.5),){DELAYED.format('engine_torqe')}",
            "delays 'engine_torqe', which is not",
        ),
        ("0.5),)", f"0.5),){DELAYED.format('engine_torque')}{TURNING}", "has a delay that varies"),
    ],
)
def test_what_cannot_be_looked_for_is_said(tmp_path, old, new, words):
    path = written(tmp_path, old, new)
    with pytest.raises(ClutchestError) as error:
        user_effects([path], TRUCK)
    assert str(error.value).startswith(f"{path}: effect '") and words in str(error.value)


@pytest.mark.parametrize("name", ["start", "parameter", "input_noise", "wander"])
def test_names_that_compiled_code_uses_are_reserved(tmp_path, name):
    path = written(tmp_path, '"own"', f'"{name}"')
    with pytest.raises(ClutchestError, match=f"effect '{name}' has a reserved name"):
        user_effects([path], TRUCK)


def test_two_files_may_not_use_one_name(tmp_path):
    paths = [written(tmp_path), written(tmp_path, name="again.py")]
    with pytest.raises(ClutchestError, match=r"again\.py: effect 'own' has the name of one in ano"):
        user_effects(paths, TRUCK)


def test_the_effect_of_the_page_is_valid(tmp_path):
    """The code in docs/discover.md, "Your own hypothesis", as it stands there."""
    text = (Path(__file__).parents[2] / "docs" / "discover.md").read_text(encoding="utf-8")
    section = text.partition("## Your own hypothesis")[2]
    (code,) = re.findall(r"^```python\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    assert "from clutchest.machine import" in code and "clutchest.models" not in section
    path = tmp_path / "cold.py"
    path.write_text(code, encoding="utf-8")
    (effect,) = user_effects([path], TRUCK)
    assert effect.name == "cold_lining" and effect.gains[0].one_sided
