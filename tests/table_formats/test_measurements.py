"""Measurements in MDF 4: what their channels mean, and that nothing in them is run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal
from asammdf.blocks import v4_blocks
from asammdf.blocks.conversion_utils import from_dict

import clutchest
from clutchest.errors import ClutchestError
from clutchest.reading.table_formats import load_table
from logger_mf4 import move_channels

N = 400
TIME = 0.01 * np.arange(N)
RAW = (np.arange(N) % 200).astype(np.uint16)


def written(path: Path, conversion=None, raw=RAW, **options) -> Path:
    with MDF(version="4.10") as mdf:
        channel = Signal(raw, TIME, name="speed", conversion=conversion, **options)
        mdf.append([channel, Signal(0.5 * TIME, TIME, name="other")], common_timebase=True)
        mdf.save(path, overwrite=True)
    return path


def refusal(path: Path, channel: str = "speed") -> str:
    with pytest.raises(ClutchestError) as caught:
        load_table(path).column(channel)
    assert "\n" not in str(caught.value)
    return str(caught.value)


FORMULAS = {
    "X": RAW,
    "3*X^2 + 1": 3.0 * RAW.astype(float) ** 2 + 1.0,
    "-(X1 - 4) / 2e1": -(RAW - 4.0) / 20.0,
    "sqrt(abs(X)) + pow(X, 2)": np.sqrt(RAW.astype(float)) + RAW.astype(float) ** 2,
    "7": np.full(N, 7.0),
}


@pytest.mark.parametrize("formula", FORMULAS)
def test_a_formula_is_arithmetic(formula, tmp_path):
    column = load_table(written(tmp_path / "a.mf4", {"formula": formula})).column("speed")
    np.testing.assert_allclose(column.value, FORMULAS[formula], rtol=1e-12)
    np.testing.assert_allclose(column.time, TIME)


CODE = [
    "__import__('os').system('true')",
    "X.__class__",
    "(lambda: X)()",
    "[X for X in (1,)][0]",
    "X if X else 1",
    "open('a')",
    "(" * 3000 + "X",
    "X +",
    "'a'",
    "sin(X, X, X, X)",
    "X" * 5000,
]


@pytest.mark.parametrize("formula", CODE, ids=range(len(CODE)))
def test_a_formula_that_is_none_is_refused_and_not_run(formula, tmp_path, monkeypatch):
    monkeypatch.setattr(v4_blocks, "lambdify", lambda *_, **__: pytest.fail("run"))
    path = written(tmp_path / "a.mf4", {"formula": "9" * len(formula)})
    content = path.read_bytes()
    assert content.count(b"9" * len(formula)) == 1
    path.write_bytes(content.replace(b"9" * len(formula), formula.encode()))
    assert "is no arithmetic of X" in refusal(path)
    assert load_table(path).column("other").given.all()


def test_a_tower_of_powers_ends(tmp_path):
    path = written(tmp_path / "a.mf4", {"formula": "9**9**9**9*X"})
    assert not np.isfinite(load_table(path).column("speed").value).any()


def test_times_by_a_formula_are_refused(tmp_path):
    with MDF(version="4.10") as mdf:
        mdf.append([Signal(RAW, TIME, name="speed")])
        mdf.groups[0].channels[0].conversion = from_dict({"formula": "X*2"})
        mdf.save(tmp_path / "a.mf4")
    assert "its times are told by a formula" in refusal(tmp_path / "a.mf4")


def test_texts_for_some_numbers_are_no_values(tmp_path):
    """As CANape has a signal with codes: a table of texts, a conversion for other numbers."""
    linear = from_dict({"a": 0.125, "b": -1.0})
    linear.unit = "rpm"
    table = {
        "val_0": 150,
        "text_0": b"error",
        "val_1": 151,
        "text_1": b"absent",
        "default_addr": linear,
    }
    whole = load_table(written(tmp_path / "a.mf4", table))
    column = whole.column("speed")
    coded = (RAW == 150) | (RAW == 151)
    np.testing.assert_array_equal(column.given, ~coded)
    np.testing.assert_allclose(column.value[~coded], 0.125 * RAW[~coded] - 1.0)
    assert whole.units["speed"] == "rpm"


def test_texts_for_some_ranges_are_no_values(tmp_path):
    table = {
        "lower_0": 0,
        "upper_0": 99,
        "text_0": from_dict({"a": 2.0, "b": 0.0}),
        "lower_1": 100,
        "upper_1": 149,
        "text_1": b"reserved",
        "default_addr": b"invalid",
    }
    column = load_table(written(tmp_path / "a.mf4", table)).column("speed")
    np.testing.assert_array_equal(column.given, RAW < 100)
    np.testing.assert_allclose(column.value[RAW < 100], 2.0 * RAW[RAW < 100])


def test_names_of_all_numbers_leave_the_numbers(tmp_path):
    table = {
        "val_0": 0,
        "text_0": b"neutral",
        "val_1": 1,
        "text_1": b"first",
        "default_addr": b"other",
    }
    column = load_table(written(tmp_path / "a.mf4", table)).column("speed")
    np.testing.assert_array_equal(column.value, RAW)
    assert column.given.all()


def test_samples_that_are_marked_as_invalid_are_none(tmp_path):
    bad = np.arange(N) % 7 == 0
    path = written(tmp_path / "a.mf4", {"a": 2.0, "b": 0.0}, invalidation_bits=bad)
    column = load_table(path).column("speed")
    np.testing.assert_array_equal(column.given, ~bad)
    np.testing.assert_array_equal(column.value, 2.0 * RAW)


@pytest.mark.parametrize("offset", [40, 8208, 0x7FFFFFFF, 0xFFFFFFFF])
def test_a_channel_beyond_its_records_is_refused(offset, tmp_path):
    """asammdf would read there, whatever memory that is."""
    path = written(tmp_path / "a.mf4")
    move_channels(path, offset)
    assert "ends beyond its records" in refusal(path)


def test_texts_and_arrays_are_no_numbers(tmp_path):
    with MDF(version="4.10") as mdf:
        words = np.array([b"a", b"b"] * (N // 2))
        mdf.append([Signal(words, TIME, name="words", encoding="utf-8")])
        mdf.append([Signal(np.zeros((N, 8), np.uint8), TIME, name="array")])
        mdf.save(tmp_path / "a.mf4")
    for name in ("words", "array"):
        assert "holds no numbers" in refusal(tmp_path / "a.mf4", name)


@pytest.mark.parametrize("name", ["a.mdf", "a.dat", "a.mf4"])
@pytest.mark.filterwarnings("ignore::Warning:asammdf")
def test_an_older_mdf_is_refused_with_the_way_to_a_newer_one(name, tmp_path):
    with MDF(version="3.30") as mdf:
        mdf.append([Signal(RAW, TIME, name="speed")])
        saved = Path(mdf.save(tmp_path / "a.mdf", overwrite=True))
    path = saved.rename(tmp_path / name)
    with pytest.raises(ClutchestError, match=r"MDF 3\.30, expected MDF 4; .*convert\('4\.10'\)"):
        clutchest.read_log(path, "truck")
    with MDF(path) as mdf:  # as it says
        mdf.convert("4.10").save(tmp_path / "b.mf4", overwrite=True)
    np.testing.assert_array_equal(load_table(tmp_path / "b.mf4").column("speed").value, RAW)
