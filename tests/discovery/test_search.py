"""The search on simulated drives: what is hidden is found, what is not there is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest, chi2

import clutchest
from clutchest.discovery.answer import causes_of, sizes_by_effect, sizes_of
from clutchest.discovery.candidate_scores import columns
from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.search import LEVEL, Search, begin, run
from clutchest.discovery.sentences import sentence
from clutchest.discovery.shape_profile import refine
from clutchest.discovery.verdict import SearchVerdict
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.signals import Floats
from discoveries import FITS

DURATION = 200.0  # s, of drives in the default suite
LONGER = 300.0
LIBRARY = tuple(machine_of("dry_clutch").effects.values())
SLOPE = -0.12  # per 100 rad/s


def searched(
    seed: int,
    effects: Mapping[str, Mapping[str, float]],
    scenario: str = "city",
    duration: float = DURATION,
    nominal: bool = False,
) -> Search:
    """A drive of a truck drawn by ``seed`` with ``effects`` hidden in it, searched."""
    truck = clutchest.load_vehicle("truck")
    drive = clutchest.simulate(truck, scenario, seed, effects, nominal=nominal, duration=duration)
    return run(begin(Problem.of(drive, truck, LIBRARY)))


def sizes(search: Search, found: CauseSet) -> tuple[Floats, Floats]:
    """Fitted gains and their standard deviations, in the units of the effects."""
    fit = search.objective.linearise_at(found.fit.theta, found.fit.shapes)
    free = search.free(found.causes)
    precision = fit.information[np.ix_(free, free)] + np.diag(search.objective.prior[free] + 1e-9)
    at = [c.index for c in found.causes]
    units = search.problem.units[at]
    std = np.sqrt(np.diag(np.linalg.inv(precision)))[len(free) - len(at) :]
    return fit.theta[at] * units, std * units


@pytest.fixture(scope="module")
def hidden() -> Search:
    return searched(1, {"friction_speed": {"slope": SLOPE}})


def test_a_hidden_cause_is_found_alone(hidden):
    best = hidden.best
    assert best.names == {"friction_speed"}
    assert len(best.causes) == 1
    assert hidden.tied == []
    (value,), (std,) = sizes(hidden, best)
    assert abs(value - SLOPE) < 3 * std
    assert std < 0.03
    assert hidden.p_values["friction_speed"] < 1e-4


@pytest.mark.slow
def test_a_cause_that_joined_first_goes_when_another_does_without_it():
    # so large that at first, linearised without it, others answer for it
    search = searched(1, {"heat_capacity_disc": {"change": -0.49}}, "slip-steps")
    assert frozenset(("heat_capacity_disc",)) == search.best.names
    assert len(search.best.causes) == 1
    stage = [{c.name for c in chosen} for chosen in search.tried]
    assert any(len(names) > 1 for names in stage)  # else nothing was let go, and nothing is tested
    assert all(len(h.causes) == 1 for h in search.rivals)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["heating", "mixed"])
def test_a_large_play_is_found_where_its_slope_at_nought_shows_little(scenario):
    play = 0.42  # mm; where it is small, what it does is of another shape
    search = searched(1, {"position_hysteresis": {"play": play}}, scenario, LONGER)
    first = search.null_scores.z**2
    place = next(i for i, c in enumerate(search.candidates) if c.name == "position_hysteresis")
    assert first.max() > 3.0 * first[place]  # else any search finds it, and nothing is tested
    assert [c.name for c in search.best.causes] == ["position_hysteresis"]
    (value,), (std,) = sizes(search, search.best)
    assert std < 0.02 * play and abs(value - play) < 3.0 * std
    assert search.p_values["position_hysteresis"] < 1e-10


def test_what_equations_leave_of_a_strong_cause_is_not_another_one(hidden):
    """As much as one per cent of it."""
    best, null = hidden.best, hidden.null
    noise = hidden.least_gain()
    assert hidden.least_gain(null) == noise
    assert hidden.least_gain(best) == noise  # of ten standard deviations, one per cent is little
    strong = replace(best, fit=replace(best.fit, cost=null.cost - 1e6))
    assert hidden.least_gain(strong) == pytest.approx(2.0 * 1e6 * 0.01**2, rel=0.01)


def test_rivals_are_fits_that_lost(hidden):
    best, rivals = hidden.best, hidden.rivals
    assert rivals
    assert [h.cost for h in rivals] == sorted(h.cost for h in rivals)
    assert best.cost <= rivals[0].cost
    assert best.cost < hidden.null.cost - 10.0
    for h in [best, *rivals]:
        others = [i for i in hidden.problem.gains if i not in {c.index for c in h.causes}]
        assert not h.fit.theta[others].any()
        number = h.causes[0].gain
        unit = hidden.problem.units[h.causes[0].index]
        assert number.lower <= h.fit.theta[h.causes[0].index] * unit <= number.upper


def test_every_cause_is_scored_at_its_own_shapes(hidden):
    nothing = np.zeros(len(hidden.problem.thetas))
    fit = hidden.objective.linearise_at(nothing)
    shaped = [c for c in hidden.candidates if c.name in ("friction_slip", "friction_fade")]
    plain = next(c for c in hidden.candidates if c.name == "viscous_drag")
    wanted = [*shaped[::-1], plain]
    derivatives = columns(hidden.objective, fit, wanted)
    for column, c in zip(derivatives.T, wanted, strict=True):
        shapes = {(c.name, key): value for key, value in c.shapes}
        alone = hidden.objective.relinearise(fit, fit.theta, shapes).psi[:, c.index]
        np.testing.assert_allclose(column, alone, atol=1e-6 * np.abs(alone).max(initial=1.0))
    slip = [k for k, c in enumerate(wanted) if c.name == "friction_slip"]
    assert np.linalg.matrix_rank(derivatives[:, slip]) == len(slip)


def test_a_cause_in_the_model_explains_its_score_away(hidden):
    """Alone it is significant; beside it, nothing else is."""
    others = [c for c in hidden.candidates if c.name not in hidden.best.names]
    scores = hidden.scores(hidden.best, others, seed=4)
    assert scores.p_family_wise(scores.p_alone(scores.z).min()) > LEVEL
    first = hidden.null_scores
    place = next(i for i, c in enumerate(hidden.candidates) if c.name == "friction_speed")
    assert first.p_family_wise(first.p_alone(first.z)[place]) < LEVEL


@pytest.mark.slow
def test_each_of_two_causes_has_the_chance_that_is_its_own():
    """The one that is found first has explained the other, and alone seems surer than it is."""
    hidden = {"centrifugal": {"slope": 0.1}, "friction_speed": {"slope": 0.08}}
    search = searched(1, hidden, "mixed", LONGER)
    assert search.best.names == set(hidden)
    total = search.null.cost - search.best.cost
    for cause in search.best.causes:
        brings, p = search.established(cause, search.best)
        fewer = search.without(cause, search.best)
        assert brings == pytest.approx(fewer.cost - search.best.cost, abs=0.1)
        beside = search.scores(fewer, [cause], seed=1)
        assert beside.z[0] ** 2 == pytest.approx(brings, rel=0.3)
        assert brings < 0.8 * total
        assert p < LEVEL
    alone = [search.p_values[c.name] for c in search.best.causes]
    assert min(alone) < 1e-3 * max(
        search.established(c, search.best)[1] for c in search.best.causes
    )


def test_a_clean_drive_has_no_cause():
    search = searched(1, {})
    assert search.best is search.null
    assert search.best.causes == () and search.rivals == () and search.tied == []
    assert search.p_values == {}
    white = search.objective.linearise_at(search.null.fit.theta).r
    assert np.mean(white**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(white)))


def test_wear_and_an_offset_of_the_sensor_come_out_tied():
    """Both lower every reading of the position and the torque curve with it: one drive cannot tell
    worn pads from a sensor that reads too little."""
    amount = 0.95  # mm; an offset of 1 mm is the largest plausible one
    search = searched(1, {"wear": {"amount": amount}}, nominal=True)
    tied = [search.best, *search.tied]
    assert {h.names for h in tied} == {frozenset({"wear"}), frozenset({"position_offset"})}
    for h in tied:
        (value,), (std,) = sizes(search, h)
        assert h.causes[0].gain.key in ("amount", "offset")
        assert abs(abs(value) - amount) < 3 * std
        assert (value > 0) == (h.names == {"wear"})
        assert abs(h.cost - search.best.cost) < 0.5


@pytest.mark.statistics
@pytest.mark.parametrize("scenario", ["city", "launches"])
def test_false_findings_are_as_rare_as_stated(scenario):
    """40 clean drives of trucks drawn from the file's spreads, at 1 % each."""
    false = [seed for seed in range(40) if searched(seed, {}, scenario, LONGER).best.causes]
    assert binomtest(len(false), 40, 0.01, alternative="greater").pvalue > 0.01, false


@pytest.mark.statistics
def test_values_scatter_as_their_standard_deviations_say():
    """20 trucks with the same cause: found in nearly all, alone, at its size."""
    errors = []
    for seed in range(20):
        search = searched(seed, {"friction_speed": {"slope": SLOPE}}, duration=LONGER)
        if search.best.names == {"friction_speed"}:
            (value,), (std,) = sizes(search, search.best)
            errors.append((value - SLOPE) / std)
    assert len(errors) >= 17
    assert np.sum(np.square(errors)) < chi2.ppf(0.999, len(errors))
    assert abs(np.mean(errors)) < 3.3 / np.sqrt(len(errors))


@pytest.mark.slow
def test_two_numbers_of_one_effect_act_together_and_a_sensor_may_do_for_one_of_them():
    """Wear that is there and goes on; what is there already may be the sensor's offset as well."""
    search = searched(61, {"wear": {"amount": 1.2, "rate": 0.2}}, "heating", 900.0)
    sets = [search.best, *search.tied]
    gains = [{(c.name, c.gain.key) for c in h.causes} for h in sets]
    assert {("wear", "rate"), ("wear", "amount")} in gains
    assert {("wear", "rate"), ("position_offset", "offset")} in gains
    assert len(sets) == 2
    both = sets[gains.index({("wear", "rate"), ("wear", "amount")})]
    values, stds = sizes(search, search.released(both))
    for value, std, c in zip(values, stds, both.causes, strict=True):
        assert abs(value - {"amount": 1.2, "rate": 0.2}[c.gain.key]) < 3.0 * std
    for order in (sets, sets[::-1]):  # whichever is the likelier
        refined, spreads = refine(search)
        verdict = SearchVerdict(refined, order[0], order[1:], [], 0.0, spreads, [], False, [])
        causes = causes_of(verdict)
        assert {c.effect for c in causes} == {"wear", "position_offset"}
        words = sentence("ambiguous", verdict.sets, causes, None, FITS, {}, True)
        assert words.startswith("The data require one of: wear (")
        assert words.count("amount = ") == 1
        first = sizes_by_effect(order[0], sizes_of(causes))
        assert {(name, key) for name, numbers in first.items() for key in numbers} == {
            (c.name, c.gain.key) for c in order[0].causes
        }
