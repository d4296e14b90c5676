"""A log that begins in the middle of a drive."""

from __future__ import annotations

import pytest

import clutchest
from clutchest.discovery.discover import discover
from clutchest.discovery.search import LOOSE, UNUSUAL, begin
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import InitialState
from clutchest.models import machine_of

TRUCK = clutchest.load_vehicle("truck")
HOT = 22  # a drive that starts some 55 K hotter than one at rest


@pytest.mark.slow
def test_where_a_hot_clutch_starts_is_known_less_well():
    drive = clutchest.simulate(TRUCK, "cooldown", HOT, duration=700.0)
    search = begin(Problem.of(drive, TRUCK, tuple(machine_of("dry_clutch").effects.values())))
    states = {search.problem.thetas[i].state for i in search.unusual_starts}
    assert states == {"temp_body", "temp_disc"}
    for i, t in enumerate(search.problem.thetas):
        if isinstance(t, InitialState):
            less = 1.0 / LOOSE**2 if t.state in states else 1.0
            assert search.objective.prior[i] == less
            assert t.state in states or abs(search.null.fit.theta[i]) < UNUSUAL


def test_a_clutch_at_rest_starts_where_it_should():
    drive = clutchest.simulate(TRUCK, "launches", 1, {"wear": {"amount": 1.5}}, duration=200.0)
    search = begin(Problem.of(drive, TRUCK, tuple(machine_of("dry_clutch").effects.values())))
    assert not len(search.unusual_starts), "no temperature is off, if the position is"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(21, 29))
def test_a_hot_start_is_no_cause(seed):
    answer = discover(clutchest.simulate(TRUCK, "cooldown", seed, duration=700.0), TRUCK)
    assert answer.verdict == "none"
    said = [words for words in answer.warnings if "does not begin at the start of a drive" in words]
    assert bool(said) == (seed in (22, 24))
