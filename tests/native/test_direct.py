"""Calls by machine code answer as the longer way does, and leave to it what they do not know."""

from __future__ import annotations

import gc
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import pytest

from clutchest.native import compiled, direct, dispatch


class Inner(NamedTuple):
    factor: float
    more: Any


class Outer(NamedTuple):
    values: Any
    inner: Inner
    last: int


@compiled
def nested(record, pair, whether, out):
    out[0] = record.values[record.last] * record.inner.factor
    out[1] = record.inner.more[0] + pair[1]
    if whether:
        out[0] = -out[0]
    return out[0], record.last + 1, whether, pair[1] > 0.5


@compiled
def half(x):
    return x[0] / 2


@compiled
def last(x):
    return x[len(x) - 1]


@compiled
def successor(k):
    return k + 1


@compiled
def pair(n):
    return np.zeros(n)


def longer(function: Any, *arguments: Any) -> Any:
    """The result without the direct call."""
    return function._sought(arguments)


def record(last: int = 2) -> Outer:
    return Outer(np.arange(4.0), Inner(3.0, np.array([7.0])), last)


@pytest.fixture(autouse=True)
def _native() -> None:
    if not isinstance(half, dispatch.CompiledFunction):
        pytest.skip("compiled by numba here")


def test_both_ways_agree() -> None:
    given = [(record(), (1, np.float64(0.75)), w, np.zeros(2)) for w in (True, False)]
    for arguments in given:
        expected = longer(nested, *arguments), arguments[3].copy()
        assert nested._direct is not dispatch._no_call
        arguments[3][:] = 0.0
        direct_result = nested._direct(*arguments)
        assert direct_result == expected[0]
        assert list(map(type, direct_result)) == list(map(type, expected[0]))
        assert arguments[3].tolist() == expected[1].tolist()


@pytest.mark.parametrize(
    "other",
    [
        np.array([4.0], np.float32),
        np.array([[4.0, 1.0], [5.0, 2.0]])[:, 0],
        np.array([4.0]).view(np.memmap),
        np.array([4], np.int64),
    ],
    ids=["element", "layout", "class", "integers"],
)
def test_another_array_is_left_to_the_longer_way(other: Any) -> None:
    longer(half, np.array([2.0]))
    assert half._direct(np.array([2.0])) == 1.0
    assert half._direct(other) is NotImplemented
    assert half(other) == 2.0


def test_other_arguments_are_left_to_the_longer_way() -> None:
    arguments = (record(), (1, np.float64(0.75)), True, np.zeros(2))
    longer(nested, *arguments)
    call = nested._direct
    assert call() is call(*arguments[:3]) is call(*arguments, 1) is NotImplemented
    for place, value in ((0, tuple(record())), (1, (1, 0.75)), (2, 1), (3, [0.0, 0.0])):
        changed = [*arguments[:place], value, *arguments[place + 1 :]]
        assert call(*changed) is NotImplemented


def test_integers_of_all_sizes() -> None:
    longer(successor, 1)
    for k in (-(2**63), -1, 0, 2**63 - 2):
        assert successor._direct(k) == k + 1
    with pytest.raises(OverflowError):
        successor(2**63)


def test_a_new_array_takes_the_longer_way() -> None:
    for _ in range(2):
        assert pair(3).tolist() == [0.0, 0.0, 0.0]
    assert pair._direct is dispatch._no_call


def test_a_type_of_elements_that_is_gone_is_not_mistaken() -> None:
    """What a call knows by its address is kept."""
    for name in ("first", "second", "third"):
        structured = np.array([(1.0, 2.0)], np.dtype([(name, "<f8"), ("x", "<f8")]))["x"]
        assert last(structured) == 2.0
        gc.collect()


def test_arguments_and_results_are_not_leaked() -> None:
    x = np.array([2.0])
    half(x)
    before = sys.getrefcount(x), sys.getrefcount(NotImplemented)
    for _ in range(1000):
        half._direct(x)
        half._direct(1.0)
    after = sys.getrefcount(x), sys.getrefcount(NotImplemented)
    assert after[0] == before[0] and abs(after[1] - before[1]) < 10


def test_from_several_threads() -> None:
    longer(half, np.array([2.0]))
    with ThreadPoolExecutor(4) as pool:
        results = pool.map(lambda k: half._direct(np.array([2.0 * k])), range(2000))
        assert list(results) == list(range(2000))


def test_where_memory_is_laid_out_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where objects do not lie as believed there are no direct calls."""
    assert direct.lies_as_believed()
    monkeypatch.setattr(direct, "lies_as_believed", lambda: False)
    fresh = dispatch.compiled(half.py_func)
    assert fresh(np.array([2.0])) == fresh(np.array([2.0])) == 1.0
    assert fresh._direct is dispatch._no_call
