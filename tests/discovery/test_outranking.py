"""Curves that explain more than causes with names do: which of them contain these."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import clutchest
from clutchest.discovery import outranking
from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.outranking import better_as_curve, contains
from clutchest.discovery.residual_curves import Curve, CurvesAt
from clutchest.discovery.search import CLOSE, Search, begin
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.problem import Problem
from clutchest.models.error_term_effects import error_term_effects

TRUCK = clutchest.load_vehicle("truck")
EFFECTS = ("torque_bias", "torque_gain", "friction_level")


@pytest.fixture(scope="module")
def search() -> Search:
    signals = clutchest.simulate(TRUCK, "launches", 5, duration=60.0)
    library = TRUCK.machine.effects
    effects = (*(library[name] for name in EFFECTS), *error_term_effects(TRUCK.machine))
    return begin(with_fitted_gains(Problem.of(signals, TRUCK, effects)))


def a_set(search: Search, *names: str) -> CauseSet:
    causes = {c.name: c for c in search.candidates}
    return CauseSet(tuple(causes[name] for name in names), search.null.fit)


def at_none(search: Search) -> CurvesAt:
    fit = search.objective.white_at(search.null.fit.theta, search.null.fit.shapes)
    return CurvesAt.of(search.objective, fit)


def a_curve(term: str, covariate: str, at: tuple[float, ...], worth: float = 0.0) -> Curve:
    none = np.zeros(len(at))
    equation = term.partition(",")[0]
    return Curve(term, equation, covariate, np.array(at), none, np.diag(none), worth, worth, 1.0)


@pytest.mark.parametrize(
    ("names", "inside"),
    [
        (("torque_bias",), True),
        (("torque_bias", "torque_gain"), True),
        (("torque_bias", "friction_level"), False),
    ],
)
def test_a_line_over_a_reading_contains_its_bias_and_its_gain(search, names, inside):
    report = a_curve("sensor:engine_torque, added", "engine_torque", (0.0, 600.0, 1200.0))
    assert contains(at_none(search), a_set(search, *names), report) == inside


def test_a_gain_is_in_no_curve_over_something_else(search):
    curve = a_curve("sensor:engine_torque, added", "engine_speed", (60.0, 100.0, 200.0))
    assert not contains(at_none(search), a_set(search, "torque_bias", "torque_gain"), curve)


@pytest.mark.parametrize(("causes", "least"), [(1, 100.0 + CLOSE), (2, 100.0), (3, 100.0 - CLOSE)])
def test_one_curve_outranks_causes_the_sooner_the_more_they_are(monkeypatch, search, causes, least):
    monkeypatch.setattr(outranking, "contains", lambda *_: False)
    best = SimpleNamespace(causes=("cause",) * causes, fit=search.null.fit)
    for worth, outranks in ((least - 1.0, False), (least + 1.0, True)):
        curves = [SimpleNamespace(worth=worth), SimpleNamespace(worth=0.0)]
        assert better_as_curve(search, best, {}, 100.0, curves) == outranks


@pytest.mark.parametrize(("refuted", "outranks"), [(False, False), (True, True)])
def test_what_contains_causes_outranks_them_only_where_a_form_is_refuted(search, refuted, outranks):
    best = a_set(search, "torque_bias", "torque_gain")
    forms = {"torque_gain": SimpleNamespace(form=SimpleNamespace(refuted=refuted))}
    curve = a_curve("sensor:engine_torque, added", "engine_torque", (0.0, 600.0, 1200.0), 104.0)
    assert better_as_curve(search, best, forms, 100.0, [curve]) == outranks
    elsewhere = a_curve("engine_speed", "slip_speed", (0.0, 50.0, 100.0), 104.0)
    assert better_as_curve(search, best, forms, 100.0, [curve, elsewhere])
