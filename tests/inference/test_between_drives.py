"""Drives of two vehicles in one fit: their parameters differ, and the fit says so."""

from __future__ import annotations

from dataclasses import replace

import pytest

import clutchest
from clutchest.discovery.search import begin, unlike_drives
from clutchest.generator import Mismatch
from clutchest.inference.problem import Problem

WORDS = "differ from each other more than those of one vehicle"


def drives(first: int, *later: int, **options) -> clutchest.Signals:
    """Launches of trucks with parameters of these seeds."""
    made = [
        clutchest.simulate(
            "truck", "launches", 3006 + k, truck_seed=seed, duration=100.0, **options
        )
        for k, seed in enumerate((first, *later))
    ]
    return replace(made[0], later=tuple(made[1:]))


def said(warnings) -> list[str]:
    return [words for words in warnings if WORDS in words]


@pytest.mark.parametrize("seeds", [(4, 704), (5, 5, 705)])
def test_a_fit_to_two_trucks_says_so(seeds):
    (words,) = said(clutchest.identify("all", drives(*seeds), "truck").warnings)
    assert words.startswith(f"the {len(seeds)} drives") and "of several vehicles" in words


@pytest.mark.parametrize("group", [None, "hot-start", "disc", "noise-colour", "torque-curve"])
def test_a_fit_to_one_truck_does_not(group):
    mismatch = Mismatch.drawn([group] if group else [], 3)
    fit = clutchest.identify("all", drives(3, 3, mismatch=mismatch), "truck")
    assert not said(fit.warnings)
    assert not said(clutchest.identify("all", drives(3, mismatch=mismatch), "truck").warnings)


@pytest.mark.parametrize(("other", "unlike"), [(704, True), (4, False)])
def test_a_search_in_two_trucks_finds_them_unlike(other, unlike):
    truck = clutchest.load_vehicle("truck")
    effects = tuple(truck.machine.effects.values())
    search = begin(Problem.of(drives(4, other), truck, effects))
    assert bool(said(unlike_drives(search, search.null))) == unlike


@pytest.mark.slow
def test_a_discovery_in_two_trucks_says_so():
    """What they differ in passed for an error of the model that has no name."""
    assert said(clutchest.discover(drives(4, 704), "truck").warnings)


@pytest.mark.slow
def test_a_cause_in_one_truck_is_no_other_truck():
    found = clutchest.discover(drives(3, 3, effects={"friction_speed": {"slope": -0.12}}), "truck")
    assert found.verdict == "named" and not said(found.warnings)
