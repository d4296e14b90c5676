"""Generated modules: where they lie, and when they change."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from clutchest import generated
from clutchest.cache import cache_folder
from clutchest.compute import build, kept_text
from clutchest.compute.functions import filter_text, fit_text
from clutchest.models import machine_of
from clutchest.models.effects import effects_of_file
from clutchest.models.effects.effect import PARAMETER, START
from clutchest.models.model import Model

from . import linear

EFFECT = '''
from clutchest.models.effects import Effect, Number

class Faster(Effect):
    """The first tank leaks {factor} times as much per ``gain``."""

    name, model, equation = "faster", "tanks", "flow"
    parameters = (Number("gain", "1", 0.0, 1.0),)

    def terms(self, g):
        return {{"leak": lambda k, q: k * (1 + {factor} * g.gain)}}
'''


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own."""
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path / "cache"))
    generated.load.cache_clear()
    return tmp_path / "cache"


def test_the_cache_lies_where_the_environment_says(folder: Path) -> None:
    digest, text = build.generate(linear.TANKS, ())
    module = generated.load(digest, text)
    assert module.__file__ is not None
    assert Path(module.__file__) == folder / f"model_{digest}.py"
    assert linear.rates(module, (1.0, 0.0), 0.5) == pytest.approx([-0.2, 0.7])
    assert any(folder.glob("native/dynamics_*")), "the compiled code lies there too"


def test_without_a_word_the_cache_is_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CLUTCHEST_CACHE")
    assert cache_folder().name == "clutchest"
    assert cache_folder() != Path("clutchest")


def test_the_same_model_has_the_same_name(folder: Path) -> None:
    assert build.generate(linear.TANKS, ()) == build.generate(linear.TANKS, ())
    with_signature = build.generate(linear.TANKS, (("parameter", "leak"),))
    assert with_signature[0] != build.generate(linear.TANKS, ())[0]


def test_an_edited_effect_changes_name_and_answer(folder: Path, tmp_path: Path) -> None:
    file, digests, leaks = tmp_path / "mine.py", [], []
    for factor in (2.0, 5.0):
        file.write_text(EFFECT.format(factor=factor), encoding="utf-8")
        model = linear.TANKS.with_effects(tuple(effects_of_file(file).values()))
        digest, text = build.generate(model, (("faster", "gain"),))
        functions = generated.load(digest, text)
        digests.append(digest)
        leaks.append(-linear.rates(functions, (1.0, 0.0), 0.0, gain=1.0)[0])
    assert digests[0] != digests[1]
    assert leaks == pytest.approx([0.7 * 3.0, 0.7 * 6.0])


def test_versions_and_processor_are_part_of_the_name(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digest, text = build.generate(linear.TANKS, ())
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_name", lambda: "another processor")
    assert build.generate(linear.TANKS, ()) != (digest, text)
    monkeypatch.undo()
    monkeypatch.setattr(generated, "__version__", "another version")
    assert build.generate(linear.TANKS, ())[0] != digest


def test_a_folder_that_cannot_be_made_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path / "file" / "cache"))
    generated.load.cache_clear()
    digest, text = build.generate(linear.TANKS, ())
    assert linear.rates(generated.load(digest, text), (0.0, 1.0), 0.0) == pytest.approx([0.0, -0.3])
    assert build.is_compiled(digest), "in another folder"


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="nothing is read-only for root")
@pytest.mark.parametrize("filled", [False, True], ids=["empty", "with the model in it"])
def test_a_read_only_folder_is_no_obstacle(folder: Path, filled: bool) -> None:
    folder.mkdir()
    digest, text = build.generate(linear.TANKS, ())
    if filled:
        generated.load(digest, text)
        generated.load.cache_clear()
    folder.chmod(0o500)
    try:
        assert linear.rates(generated.load(digest, text), (0.0, 1.0), 0.0) == pytest.approx(
            [0.0, -0.3]
        )
    finally:
        folder.chmod(0o700)


def test_processes_may_compile_at_once(folder: Path) -> None:
    """And the next one finds what they left."""
    here = Path(__file__).resolve().parent
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import linear\n"
        "digest, functions = linear.compiled()\n"
        "print(linear.rates(functions, (1.0, 2.0), 0.5))\n"
    )
    command = [sys.executable, "-c", script, str(here)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = [process.communicate()[0].splitlines() for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert json.loads(said[0][0]) == json.loads(said[1][0]) == pytest.approx([-0.2, 0.1])
    assert len(list(folder.glob("model_*.py"))) == 1
    assert not list(folder.glob("*.tmp"))
    kept = {file: file.stat().st_mtime_ns for file in folder.glob("native/*")}
    assert len(kept) == 3  # the text, the function, and how Python calls it
    third = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert third == said[0]
    assert kept == {file: file.stat().st_mtime_ns for file in folder.glob("native/*")}


def with_states(model: Model) -> tuple[tuple[str, str], ...]:
    """What responses are taken of: every parameter, every gain of an effect, and a start."""
    gains = [(e.name, n.key) for e in model.effects for n in e.gains]
    return (*((PARAMETER, p.key) for p in model.parameters), *gains, (START, model.states[0].name))


@pytest.mark.parametrize("name", ["dry_clutch", "alsd"])
def test_kept_text_is_what_lowering_gives(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is taken from the folder the second time, and by another process."""
    machine = machine_of(name)
    model = machine.equations(machine.units)
    model = model.with_effects(model.taking(tuple(machine.effects.values())[:4]))
    thetas = with_states(model)
    for text_of in (filter_text, fit_text):
        lowered = text_of(model, thetas)
        assert kept_text.kept_text(text_of, model, thetas) == lowered
        with monkeypatch.context() as patched:
            patched.setattr(kept_text, "remember", None)
            assert kept_text.kept_text(text_of, replace(model), thetas) == lowered
    assert "0x" not in repr(replace(model, pieces=(), effects=())), "no address of this process"


def test_text_is_kept_under_all_that_it_depends_on(folder: Path) -> None:
    def other(q: Any) -> None:
        linear.flow(q)
        q.upper_rate = 2.0 * q.upper_rate

    model, thetas = linear.TANKS, (("parameter", "leak"),)
    state, *others = model.states
    stiff, factor = replace(state, stiff=True), replace(state, factor=not state.factor)
    changed = [
        (model, ()),
        (model, (("start", state.name),)),
        (model.swap(model.pieces[0], other), thetas),
        (replace(model, states=(stiff, *others)), thetas),
        (replace(model, states=(factor, *others)), thetas),
    ]
    keys = {kept_text.key(*each) for each in [(model, thetas), *changed]}
    assert len(keys) == 1 + len(changed)
