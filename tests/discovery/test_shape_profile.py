"""Shapes of effects are found between the values that a search tries, and honestly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi2

import clutchest
from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.search import Search, begin
from clutchest.discovery.shape_profile import FINER, HALVED, refine
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation
from clutchest.models import machine_of

LIBRARY = tuple(machine_of("dry_clutch").effects.values())
SPEED, CHANGE = 14.0, 0.1  # tried: 10 and 20 rad/s


def begun(seed: int, cause: str) -> Search:
    """A drive with friction that changes with slip, and the fits of one cause at all its shapes."""
    truck = clutchest.load_vehicle("truck")
    hidden = {"friction_slip": {"change": CHANGE, "speed": SPEED}}
    drive = clutchest.simulate(truck, "city", seed, hidden, duration=400.0)
    search = begin(Problem.of(drive, truck, LIBRARY))
    tried = [c for c in search.candidates if c.name == cause]
    fits = [search.fitted((c,), search.null.fit).bare for c in tried]
    best, *rivals = sorted(fits, key=lambda h: h.cost)
    return replace(search, best=best, rivals=tuple(rivals))


def gain(search: Search, h: CauseSet) -> tuple[float, float]:
    """The size of the one cause, and its standard deviation were the shape known."""
    fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes)
    free = search.free(h.causes)
    precision = fit.information[np.ix_(free, free)] + np.diag(search.objective.prior[free] + 1e-9)
    unit = float(search.problem.units[h.causes[0].index])
    return fit.theta[h.causes[0].index] * unit, np.sqrt(np.linalg.inv(precision)[-1, -1]) * unit


@pytest.mark.slow
def test_what_a_shape_leaves_open_is_not_known_of_the_gain() -> None:
    off, of_shape = [], []
    for seed in range(1, 7):
        search = begun(seed, "friction_slip")
        before = search.best
        search, spreads = refine(search)
        spread = spreads[search.best.names]
        cause = search.best.causes[0]
        assert search.best.cost <= before.cost
        value, std = gain(search, search.best)
        more = spread.variance[cause.index] * float(search.problem.units[cause.index]) ** 2
        off.append((value - CHANGE) / np.sqrt(std**2 + more))
        of_shape.append(
            (dict(cause.shapes)["speed"] - SPEED) / spread.std["friction_slip", "speed"]
        )
        assert 0.05 * std**2 < more < 25.0 * std**2
    for each in (off, of_shape):
        assert np.sum(np.square(each)) < chi2.isf(0.001, len(each)), each


@dataclass(frozen=True)
class Answering:
    """A search that knows the answer."""

    fitted_near: Callable[..., CauseSet]
    best: CauseSet
    rivals: tuple[CauseSet, ...] = ()


@pytest.mark.parametrize("std", [0.3, 1.0, 3.0])
def test_values_are_tried_as_close_as_the_data_tell_them_apart(std: float) -> None:
    """A search that knows the answer: the likeliest speed is 13.8 rad/s, give or take ``std``."""
    effect = machine_of("dry_clutch").effects["friction_slip"]
    cause = CandidateCause(effect, effect.gains[0], 0, (("speed", 10.0),))

    def fitted_near(chosen: tuple[CandidateCause, ...], near: Linearisation) -> CauseSet:
        off = dict(chosen[0].shapes)["speed"] - 13.8
        return CauseSet(chosen, replace(near, theta=np.array([0.2 * off]), cost=(off / std) ** 2))

    nowhere = Linearisation(np.zeros(1), {}, np.zeros(0), np.zeros((0, 1)), 0.0, (), ())
    search, spreads = refine(Answering(fitted_near, fitted_near((cause,), nowhere)))  # type: ignore[arg-type]
    spread = spreads[search.best.names]
    found = dict(search.best.causes[0].shapes)["speed"]
    about = np.hypot(std, found - 13.8)  # of the value that is told, which was tried
    assert abs(found - 13.8) < std
    assert spread.std["friction_slip", "speed"] == pytest.approx(about, rel=0.1)
    assert spread.variance[0] == pytest.approx((0.2 * about) ** 2, rel=0.2)


@pytest.mark.slow
def test_a_value_stays_plausible_and_near_what_was_tried() -> None:
    search = begun(1, "friction_slip")
    tried = dict(search.best.causes[0].shapes)["speed"]
    search, _ = refine(search)
    found = dict(search.best.causes[0].shapes)["speed"]
    assert 2.0 <= found <= 60.0
    assert (found - tried) % (5.0 / FINER / 2**HALVED) == pytest.approx(0.0)


@pytest.mark.slow
def test_one_hypothesis_of_each_name_is_left() -> None:
    search = begun(1, "friction_slip")
    assert len(search.rivals) == 3
    search, _ = refine(search)
    assert search.rivals == (), "the others were the same cause in other shapes"


def test_what_has_no_shape_stays_as_it_is() -> None:
    search = begun(1, "friction_level")
    before = search.best
    search, spreads = refine(search)
    spread = spreads[before.names]
    assert search.best is before
    assert not spread.variance.any() and not spread.std
