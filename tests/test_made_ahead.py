"""Items are made ahead of their use, in order, and their errors are not lost."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from clutchest.made_ahead import made_ahead


def test_the_next_item_is_made_while_one_is_used() -> None:
    second = threading.Event()

    def items() -> Iterator[int]:
        yield 1
        second.set()
        yield 2

    taken = []
    with made_ahead(items()) as made:
        for item in made:
            assert second.wait(30.0)  # the use of the first does not end before
            taken.append(item)
    assert taken == [1, 2]


def test_the_first_item_is_begun_at_once() -> None:
    begun = threading.Event()

    def items() -> Iterator[int]:
        begun.set()
        yield 1

    with made_ahead(items()) as taken:
        assert begun.wait(30.0)
        assert list(taken) == [1]


def test_no_more_than_one_item_waits() -> None:
    made: list[int] = []

    def items() -> Iterator[int]:
        for k in range(5):
            made.append(k)
            yield k

    with made_ahead(items()) as taken:
        for item in taken:
            assert len(made) <= item + 2
    assert made == list(range(5))


def test_as_many_wait_as_are_asked_for() -> None:
    made: list[int] = []
    third = threading.Event()

    def items() -> Iterator[int]:
        for k in range(9):
            made.append(k)
            if k == 3:
                third.set()
            yield k

    with made_ahead(items(), 3) as taken:
        next(taken)
        assert third.wait(30.0)
        assert len(made) == 4
    assert len(made) < 9


def test_what_making_an_item_raises_is_raised_here() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise ValueError("no second")

    with made_ahead(items()) as taken:
        assert next(taken) == 1
        with pytest.raises(ValueError, match="no second"):
            next(taken)
