"""What is compiled says what numba makes of the same functions."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import clutchest
from clutchest.can.deduplication import _duplicates
from clutchest.estimate.samples import _averages, _lines
from clutchest.models.regimes import around, lasting
from clutchest.native.dispatch import CompiledFunction
from clutchest.signals import _between

from .by_numba import by_numba

RNG = np.random.default_rng(3)
TIME = np.cumsum(RNG.exponential(0.1, 200))
VALUE = RNG.normal(size=200)
FLAG = VALUE > 0.5
IDS = RNG.integers(0, 3, 200)


def arrays(value: Any) -> Iterator[np.ndarray]:
    """All arrays and numbers in arguments and results."""
    if isinstance(value, tuple):
        for item in value:
            yield from arrays(item)
    elif value is not None:
        yield np.asarray(value)


def compare(native: Any, function: CompiledFunction, arguments: tuple[Any, ...]) -> Any:
    """The result, which numba has to have as well, to 1e-12 of the largest in an array."""
    theirs = copy.deepcopy(arguments)
    wanted, got = by_numba(function)(*theirs), native(function, *arguments)
    for a, b in zip(arrays((got, *arguments)), arrays((wanted, *theirs)), strict=True):
        assert a.dtype == b.dtype
        if a.dtype.kind == "f" and a.size:
            largest = np.nanmax(np.abs(b), initial=0.0, where=np.isfinite(b))
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * largest)
        else:
            assert np.array_equal(a, b)
    return got


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often every function has been compared: the first three calls are."""
    counted: Counter[str] = Counter()
    native = CompiledFunction.__call__

    def both(self: CompiledFunction, *arguments: Any) -> Any:
        counted[self.__name__] += 1
        if counted[self.__name__] <= 3:
            return compare(native, self, arguments)
        return native(self, *arguments)

    monkeypatch.setattr(CompiledFunction, "__call__", both)
    return counted


SMALL: list[tuple[Any, tuple[Any, ...]]] = [
    (_between, (np.sort(RNG.uniform(-1, 25, 300)), TIME, VALUE, 0.3)),
    (_lines, (TIME, VALUE, 5)),
    (_averages, (TIME, VALUE, 0.3, 3)),
    (around, (TIME, FLAG, 0.1)),
    (lasting, (TIME, FLAG, 0.15)),
    (_duplicates, (IDS.cumsum() // 4, IDS, IDS, IDS, IDS, IDS.reshape(-1, 1).astype(np.uint8))),
]


@pytest.mark.parametrize(("function", "arguments"), SMALL)
def test_small_functions(function: Any, arguments: tuple[Any, ...], calls: Counter[str]) -> None:
    function(*arguments)
    assert calls[function.__name__] == 1


@pytest.mark.slow
@pytest.mark.parametrize(("log", "vehicle"), [("demo", "truck"), ("alsd", "alsd_rig")])
def test_a_smoothed_replay(log: str, vehicle: str, calls: Counter[str]) -> None:
    known = clutchest.load_vehicle(vehicle)
    clutchest.replay(clutchest.read_log(log, known), known, smooth=True)
    assert {"run", "filter_window", "smooth_window", "_gather"} <= set(calls)


@pytest.mark.slow
def test_a_diagnosis(calls: Counter[str]) -> None:
    truck = clutchest.load_vehicle("truck")
    clutchest.diagnose(clutchest.replay(clutchest.read_log("demo", truck), truck))
    assert "filter_sensitivities" in calls
