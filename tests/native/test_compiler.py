"""What becomes of compiled functions: kept on disk, refused, called from several threads."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from clutchest.native import direct, dispatch, engine
from clutchest.native.types import NOTHING, Unsupported

from . import language, unknown

MODULE = '''
from clutchest.native import compiled

@compiled
def inner(x):
    """Times {factor}, and as much as the constant says."""
    return {factor} * x + CONSTANT

@compiled
def outer(x):
    """One more."""
    return inner(x) + 1.0
'''


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own, in which only what is compiled from now on is kept."""
    direct.directly((), (), NOTHING, 0)
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "native"


@pytest.fixture
def translations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The texts that LLVM is given from now on."""
    texts: list[str] = []
    translate = engine.machine_code

    def noted(text: str) -> bytes:
        texts.append(text)
        return translate(text)

    monkeypatch.setattr(engine, "machine_code", noted)
    return texts


def module(path: Path, factor: float, constant: float = 0.0) -> Any:
    path.write_text(MODULE.format(factor=factor), encoding="utf-8")
    made = ModuleType("made")
    vars(made)["CONSTANT"] = constant
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), vars(made))
    return made


def test_machine_code_is_kept(folder: Path, tmp_path: Path, translations: list[str]) -> None:
    for _ in range(2):
        assert module(tmp_path / "m.py", 3.0).outer(2.0) == 7.0
    assert len(translations) == len(list(folder.iterdir())) == 1


def test_an_edit_of_what_is_called_is_seen(
    folder: Path, tmp_path: Path, translations: list[str]
) -> None:
    assert module(tmp_path / "m.py", 3.0).outer(2.0) == 7.0
    assert module(tmp_path / "m.py", 4.0).outer(2.0) == 9.0
    assert module(tmp_path / "m.py", 4.0, constant=5.0).outer(2.0) == 14.0
    assert len(translations) == len(list(folder.iterdir())) == 3


def test_an_edit_behind_a_loaded_function_is_refused(folder: Path, tmp_path: Path) -> None:
    made = module(tmp_path / "m.py", 3.0)
    module(tmp_path / "m.py", 4.0)
    with pytest.raises(Unsupported, match=r"'inner' in .*m\.py has changed since it was loaded"):
        made.outer(2.0)


@pytest.mark.parametrize("damage", ["cut", "changed", "empty"])
def test_damaged_machine_code_is_made_anew(
    folder: Path, tmp_path: Path, translations: list[str], damage: str
) -> None:
    module(tmp_path / "m.py", 3.0).outer(2.0)
    [kept] = folder.iterdir()
    content = kept.read_bytes()
    middle = len(content) // 2
    kept.write_bytes(
        {
            "cut": content[:-10],
            "changed": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
            "empty": b"",
        }[damage]
    )
    assert module(tmp_path / "m.py", 3.0).outer(2.0) == 7.0
    assert len(translations) == 2
    assert kept.read_bytes() == content


def test_another_processor_has_its_own(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = set()
    for processor in ("one", "another"):
        dispatch._compiler.cache_clear()
        monkeypatch.setattr(engine.llvm, "get_host_cpu_name", lambda name=processor: name)
        made = module(tmp_path / "m.py", 3.0).outer
        names.add(dispatch._digest(made, ()))
    monkeypatch.undo()
    dispatch._compiler.cache_clear()
    assert len(names) == 2


@pytest.mark.parametrize(
    ("function", "arguments", "says"),
    [
        (unknown.sorts, (np.zeros(2),), r"unknown\.py:9: in 'sorts': a call of sorted"),
        (unknown.lists, (1,), r"unknown\.py:15: in 'lists': List"),
        (unknown.either, (np.zeros(2), 1), r"unknown\.py:23: in 'either': either .*"),
        (unknown.endless, (1,), r"unknown\.py:30: in 'endless': 'endless' calls itself"),
        (unknown.outside, (1,), r"unknown\.py:15: in 'lists': List"),
        (unknown.lists, ("text",), "a value of str"),
        (unknown.lists, (np.zeros(2, complex),), "an array of complex128"),
        (unknown.lists, (np.zeros(2, ">f8"),), "an array of >f8"),
    ],
)
def test_what_it_does_not_know_is_refused_with_its_place(
    function: Any, arguments: tuple[Any, ...], says: str
) -> None:
    with pytest.raises(Unsupported, match=says):
        function(*arguments)


def test_a_division_by_zero_is_numpys() -> None:
    quotients = language.arithmetic(1.0, 0.0)[3], language.arithmetic(-1, 0)[3]
    assert quotients == (np.inf, -np.inf)
    assert language.whole(7, 0)[:2] == (0, 0)


def test_arrays_of_a_subclass_are_known_by_their_type(tmp_path: Path) -> None:
    for dtype in (np.float64, np.int32, np.uint8):
        np.arange(5).astype(dtype).tofile(tmp_path / "column")
        mapped = np.memmap(tmp_path / "column", dtype, "r")
        assert language.sought(mapped, 3) == (3, 4)
    for dtype in ("f8", "i4"):
        fields = [("count", "i8"), ("level", "f8"), ("curve", dtype, 2)]
        rows = np.array([(1, 2.0, [3, 4])], fields).view(np.recarray)
        assert language.of_record(rows[0]) == 1 + 2.0 + 4


def test_large_unsigned_numbers() -> None:
    assert language.doubled(np.uint64(2**63 - 1)) == 2**64 - 2
    assert language.doubled(np.uint64(2**63 + 1)) == 2


def test_threads_may_call_at_once() -> None:
    rows = [np.full(50, float(k)) for k in range(40)]
    with ThreadPoolExecutor(4) as pool:
        for k, result in enumerate(pool.map(language.fresh, rows)):
            assert result[-1][1].tolist() == [float(k)] * 50


def test_it_is_pickled_by_its_name() -> None:
    assert pickle.loads(pickle.dumps(language.early)) is language.early
