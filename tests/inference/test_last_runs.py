"""What the last runs of a drive gave is not computed again, and cannot be spoilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.inference import problem as runs
from clutchest.inference.innovations import NO_DERIVATIVES, NormalisedInnovations
from clutchest.inference.last_runs import ENTRIES, HELD, LastPaths, LastRuns, StatePath
from clutchest.inference.objective import Objective
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.problem import Problem

RIG = clutchest.load_vehicle("alsd_rig")


@pytest.fixture
def problem() -> Problem:
    return Problem.of(clutchest.simulate(RIG, "rig-steps", 5, duration=2.0), RIG, ())


@pytest.fixture
def counted(monkeypatch) -> list[int]:
    """How many derivatives each run was asked for."""
    asked, linearise = list[int](), runs.linearise

    def once(drive, numbers, at, active, into):
        asked.append(len(active))
        return linearise(drive, numbers, at, active, into)

    monkeypatch.setattr(runs, "linearise", once)
    return asked


def test_the_same_numbers_are_run_once(problem, counted):
    theta = np.zeros(len(problem.thetas))
    (every,) = problem.linearise(theta, {})
    (some,) = problem.linearise(theta, {}, np.array([1, 3]))
    (none,) = problem.linearise(theta, {}, NO_DERIVATIVES)
    assert len(counted) == 1
    np.testing.assert_array_equal(some.table, every.table[:, [0, 2, 4]])
    np.testing.assert_array_equal(none.r, every.r)
    np.testing.assert_array_equal(some.psi[:, [1, 3]], every.psi[:, [1, 3]])


def test_other_numbers_or_more_derivatives_are_run(problem, counted):
    theta = np.zeros(len(problem.thetas))
    problem.linearise(theta, {}, NO_DERIVATIVES)
    problem.linearise(theta, {}, np.array([2]))
    problem.linearise(theta + 0.1, {}, np.array([2]))
    problem.linearise(theta, {}, NO_DERIVATIVES)
    assert counted == [0, 1, 1]


def test_gains_at_other_numbers_are_another_drive(problem, counted):
    theta = np.zeros(len(problem.thetas))
    before = problem.linearise(theta, {}, NO_DERIVATIVES)[0].r
    moved = problem.with_gains_at(theta + 0.5)
    after = moved.linearise(theta, {}, NO_DERIVATIVES)[0].r
    assert len(counted) == 2 and not np.array_equal(before, after)


def test_what_is_kept_cannot_be_spoilt(problem):
    """Neither by hand nor by whitening, which is done in place."""
    theta = np.zeros(len(problem.thetas))
    (first,) = problem.linearise(theta, {})
    kept = first.table.copy()
    with pytest.raises(ValueError, match="read-only"):
        first.table[:] = np.nan
    objective = Objective.of(problem)
    for active in (None, np.array([1, 3]), NO_DERIVATIVES):
        assert objective.linearise_at(theta, active=active).r.any()
    assert objective.white_at(theta).r.any()
    assert problem.linearise(theta, {})[0].table is first.table
    np.testing.assert_array_equal(first.table, kept)


@pytest.mark.parametrize("in_halves", [False, True])
def test_states_are_followed_once_at_the_same_numbers(problem, counted, monkeypatch, in_halves):
    """What follows of a path that is known is what a run of its own gives, to the last bit."""
    monkeypatch.setattr("clutchest.inference.propagation.halved", lambda _: in_halves)
    theta = np.full(len(problem.thetas), 0.1)
    fresh = replace(problem, drives=[replace(drive) for drive in problem.drives])
    (whole,) = fresh.linearise(theta, {})
    (none,) = problem.linearise(theta, {}, NO_DERIVATIVES)
    numbers = problem.numbers(theta, {})
    known = problem.drives[0].paths.at(numbers)
    assert known is not None and known.states is none.implied.states
    (some,) = problem.linearise(theta, {})
    assert problem.drives[0].paths.at(numbers) is known
    np.testing.assert_array_equal(some.table, whole.table)
    np.testing.assert_array_equal(some.implied.states, whole.implied.states)


def test_paths_that_would_fill_memory_are_not_kept():
    paths, numbers = LastPaths(), ModelNumbers(np.zeros(1), np.zeros(1), np.zeros(1), {})
    paths.keep(numbers, StatePath(np.broadcast_to(0.0, (int(ENTRIES), 1)), np.zeros((1, 1))))
    assert paths.at(numbers) is None
    paths.keep(numbers, StatePath(np.zeros((2, 1)), np.zeros((1, 1))))
    assert paths.at(numbers) is not None
    assert paths.at(numbers._replace(first=np.ones(1))) is None


def _kept(runs: LastRuns, share: float, first: float, *, derivatives: bool) -> None:
    """Keep a run that holds a ``share`` of what may be held, at a ``first`` number of its own."""
    rows = int(share * HELD) // (1 + derivatives)
    table = np.broadcast_to(first, (rows, 1 + derivatives))
    innovations = NormalisedInnovations(table, 1, POINT, None if derivatives else NO_DERIVATIVES)
    runs.keep(_at(first), POINT, np.array([derivatives]), innovations)


def _known(runs: LastRuns, first: float, *, derivatives: bool) -> bool:
    return runs.at(_at(first), POINT, np.array([derivatives])) is not None


def _at(first: float) -> ModelNumbers:
    return ModelNumbers(np.zeros(1), np.zeros(1), np.array([first]), {})


POINT = OperatingPoint(np.zeros((0, 1)), np.zeros((0, 1)), {})


def test_what_is_kept_is_no_more_than_memory_holds():
    """The run that was asked for last stays, and those with derivatives stay longest."""
    runs = LastRuns()
    _kept(runs, 0.4, 1.0, derivatives=True)
    _kept(runs, 0.2, 2.0, derivatives=False)
    _kept(runs, 0.2, 3.0, derivatives=False)
    assert all(_known(runs, first, derivatives=False) for first in (1.0, 2.0, 3.0))
    _kept(runs, 0.3, 4.0, derivatives=True)
    assert _known(runs, 1.0, derivatives=True) and _known(runs, 4.0, derivatives=True)
    assert not _known(runs, 2.0, derivatives=False) and _known(runs, 3.0, derivatives=False)
    assert _known(runs, 1.0, derivatives=True)
    _kept(runs, 0.4, 5.0, derivatives=True)
    assert not _known(runs, 4.0, derivatives=False) and _known(runs, 1.0, derivatives=True)
    _kept(runs, 1.5, 6.0, derivatives=False)
    assert _known(runs, 6.0, derivatives=False)
    assert not any(_known(runs, first, derivatives=False) for first in range(1, 6))
