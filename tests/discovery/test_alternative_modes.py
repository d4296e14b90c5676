"""What passes for a cause where a fit without it has not found the best values of the unknowns."""

from __future__ import annotations

import pytest

from clutchest.discovery import discover as discovering
from clutchest.discovery.alternative_modes import _with_size
from clutchest.discovery.search import begin
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle


def test_a_cause_is_led_out_along_the_ridge():
    """Friction higher by a tenth costs thousands where nothing else gives way, and next to nothing
    where the numbers do that mean the same."""
    truck = load_vehicle("truck")
    library = tuple(machine_of("dry_clutch").effects.values())
    search = begin(Problem.of(simulate(truck, "city", 1, duration=120.0), truck, library))
    (cause,) = (c for c in search.candidates if c.name == "friction_level")
    begun, free = search.null.fit, search.free(())
    size = 0.1 / search.problem.units[cause.index]
    at_once, ridge = (
        search.objective.linearise_at(theta).cost - begun.cost
        for theta in _with_size(search.objective, begun, cause, size, free)
    )
    assert at_once > 1000.0
    assert ridge < 0.01 * at_once


@pytest.mark.slow
def test_a_disc_that_expands_no_further_is_not_taken_for_fade():
    """Its disc is lighter and gives off less heat, by 1.6 spreads each: in the hottest of its
    launches it gets 114 K over the body, and from 110 K on it expands no further."""
    drive = simulate("truck", "launches", 2456, duration=1003.0, noise_ar=0.0)
    assert discovering.discover(drive, "truck").verdict == "none"
