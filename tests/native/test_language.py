"""What is compiled does what Python does."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from . import language

MATRIX = np.arange(12.0).reshape(3, 4) ** 1.5
SMALL = np.array([1, 255, 7], np.uint8)
STRUCTURE = np.array(
    [(1, 2.0, [1.0, 2.0, 3.0]), (2, 5.0, [4.0, 5.0, 6.0])],
    [("count", np.int64), ("level", np.float64), ("curve", np.float64, 3)],
)
PAIR = language.Pair(np.array([1.0, 2.5]), 3.0)
NUMBERS = [-3.5, -1.0, 0.25, 2.0, 7.0]
INTEGERS = [-7, -2, -1, 1, 2, 3, 9]

CASES: list[tuple[Any, tuple[Any, ...]]] = [
    *((language.arithmetic, (a, b)) for a in NUMBERS for b in [*NUMBERS, *INTEGERS]),
    *((language.arithmetic, (a, b)) for a in INTEGERS for b in INTEGERS),
    *((language.arithmetic, (a, 2.0)) for a in (np.nan, np.inf, -np.inf)),
    *((language.whole, (a, b)) for a in INTEGERS for b in INTEGERS),
    *((language.powers, (a,)) for a in NUMBERS if a > 0),
    *((language.logic, (a, b)) for a in (0, 1, 2, 4) for b in (2, 9, 11)),
    *((language.widened, (n,)) for n in (0, 1, 5)),
    *((language.loops, (n,)) for n in (3, 6, 9)),
    *((language.early, (a,)) for a in (-1, 5, 1000)),
    *((language.elements, (a, k)) for a in (MATRIX, MATRIX.T, MATRIX[:, ::-1]) for k in (0, 1, 2)),
    (language.filled, (MATRIX, np.array([False, True, False]), SMALL, 1)),
    (language.filled, (MATRIX.T.copy().T, np.array([False, True, False]), SMALL, 1)),
    (language.fresh, (np.array([0.5, 1.5, 2.5]),)),
    (language.fresh, (MATRIX[:, 1],)),
    (language.swapped, (np.zeros(3), np.ones(3))),
    (language.weighed, (PAIR, PAIR)),
    (language.weighed, (PAIR, language.Pair(MATRIX[:, 0], 2))),
    (language.bytes_of, (np.frombuffer(b"4A\n\n", np.uint8), 5)),
    (language.structure, (STRUCTURE, 0)),
    (language.structure, (STRUCTURE, 1)),
    (language.counted_down, (-2,)),
    (language.until_returned, (4,)),
    (language.rows_of_three, (np.arange(12.0).reshape(4, 3), np.ones((4, 3)))),
    *((language.sought, (np.array([1.0, 2.0, 2.0, 4.0]), v)) for v in (0.0, 2.0, 3.0, 9.0)),
]


def rowed(function: Any, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Structured arrays as records, whose fields Python reads as attributes too."""
    if function is not language.structure:
        return arguments
    return tuple(a.view(np.recarray) if isinstance(a, np.ndarray) else a for a in arguments)


@pytest.mark.parametrize(("function", "arguments"), CASES)
@pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore::DeprecationWarning")
def test_it_does_what_python_does(function: Any, arguments: tuple[Any, ...]) -> None:
    if function is language.filled:
        # numpy refuses 300 as eight bits; the machine keeps what fits
        arguments = (*arguments[:2], arguments[2].astype(np.int16).astype(np.uint8), 1)
    ours, theirs = copy.deepcopy(arguments), copy.deepcopy(arguments)
    got = function(*ours)
    if function is language.filled:
        theirs = (*theirs[:2], theirs[2].astype(np.int64), 1)
    wanted = function.py_func(*rowed(function, theirs))
    if function is language.filled:
        theirs = (*theirs[:2], theirs[2].astype(np.uint8), 1)
    same(got, wanted)
    same(ours, theirs)


def same(got: Any, wanted: Any) -> None:
    """To the last bit, and of the same kind."""
    if isinstance(wanted, tuple):
        assert len(got) == len(wanted)
        for a, b in zip(got, wanted, strict=True):
            same(a, b)
    elif isinstance(wanted, np.ndarray):
        assert np.array_equal(got, wanted, equal_nan=wanted.dtype.kind == "f")
    elif wanted is None:
        assert got is None
    else:
        assert isinstance(got, bool) == isinstance(wanted, (bool, np.bool_))
        assert got == pytest.approx(wanted, rel=0, abs=0, nan_ok=True)


def test_every_function_has_a_case() -> None:
    functions = {f for f in vars(language).values() if hasattr(f, "py_func")}
    helpers = {language.scaled, language.bits_of, language.of_record, language.doubled}
    assert {function for function, _ in CASES} == functions - helpers
