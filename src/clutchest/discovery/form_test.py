"""Whether the form of a cause holds: a curve over the cause's own driver, beside the cause.

A cause may be significant though its form is wrong: the truth only resembles it.  Beside its gain
and its shapes, which stay free, the data may want a curve over what drives it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.discovery.deviation import FormDeviation, deviation
from clutchest.discovery.effect_drivers import Standin, by_shapes, drivers_of, standin
from clutchest.discovery.noise_blocks import noise_blocks
from clutchest.discovery.nuisances import Nuisances
from clutchest.discovery.residual_curves import (
    CandidateCurve,
    Curve,
    CurvesAt,
    places,
)
from clutchest.discovery.result import HELD, REFUTED, Form, FormCurve
from clutchest.discovery.search import CLOSE, Search
from clutchest.inference.covariates import hats
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import ABSENT, Projection
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

LEVEL = 0.01  # p-value of a form, over all drivers of the effect, below which it is refuted
INEXACT = 0.01  # of an effect, by how much its form may be off where it is right
NEGLIGIBLE = 1e-3  # of a curve, squared: what derivatives are not exact to
POINTS = 41  # of a picture
SEED = 4
CONSTANT = 0.1  # of a change by an effect: one that varies by less is none of its driver
WIDEST = 10.0  # standard deviation of a curve that stands for a form, in sizes of the effect
BENDS = 5  # of a curve where its effect acts
CLOSEST = 0.01  # of a driver's range: from one knot to the next
MINOR = 0.1  # of what one cause explains: one that explains less may be no more than its form


@dataclass(frozen=True, slots=True)
class TestedForm:
    """The ``form`` of a cause as it is reported, its ``drivers``, and where it is refuted the
    ``worth`` of the curve that the data want over one of them, the ``curve`` that they want beside
    the effect as it was fitted, where an error term stands for it; the ``columns`` (K, c) of all
    that the data may want over that driver."""

    form: Form
    drivers: tuple[str, ...] = ()
    worth: float = 0.0
    curve: Curve | None = None
    columns: Floats | None = None


def tested_forms(search: Search, h: CauseSet, *, wider: bool = False) -> dict[str, TestedForm]:
    """The test of every effect of a cause set, by name; ``wider``: its gain also over what else
    drives the error that stands for it."""
    fit = search.objective.white_at(h.fit.theta, h.fit.shapes)
    at = CurvesAt.of(search.objective, fit)
    beside = _beside(search, fit, h)
    own = {name: [c for c in h.causes if c.name == name] for name in h.effects}
    return {name: _tested(at, beside, causes, wider) for name, causes in own.items()}


@dataclass(frozen=True, slots=True)
class _Driver:
    """What is tested over a driver of a cause: the ``table`` of a curve, and the ``cause`` or the
    ``term`` that stands for it there."""

    table: CandidateCurve
    cause: CandidateCause
    term: Standin | None


def _tested(
    at: CurvesAt, beside: Nuisances, causes: Sequence[CandidateCause], wider: bool
) -> TestedForm:
    """The form of one effect, of which ``causes`` are the gains."""
    drivers = _drivers(at, causes, wider)
    names = tuple(dict.fromkeys(driver.table.covariate for driver in drivers))
    if not drivers:
        return TestedForm(Form(None, "nothing that may drive it varies in this log"))
    for cause, term in {d.cause: d.term for d in drivers if d.term}.items():
        beside = beside.also(term.off[:, None], abs(float(at.fit.theta[cause.index])))
    deviations = [
        _deviation(at, beside, derivatives[:, columns])
        for derivatives, some in at.derivatives([driver.table for driver in drivers])
        for _, columns in some
    ]
    least = min(range(len(drivers)), key=lambda i: deviations[i].p_value)
    driver, found = drivers[least], deviations[least]
    tests = sum(each.freedom > 0 for each in deviations)
    if not tests:
        reason = "this log does not tell one form from another"
        return TestedForm(Form(None, reason), names)
    p_value = float(-np.expm1(tests * np.log1p(-found.p_value)))
    # what is wanted beside the effect as it is: its own gains and shapes stay where they are
    held = np.setdiff1d(
        beside.free, [*(c.index for c in causes), *range(len(at.fit.theta), len(beside.prior))]
    )
    alone = Nuisances(at.fit, held, at.objective.prior)
    (wanted,) = at.tested(alone, [driver.table], SEED)
    refuted = p_value < LEVEL
    form = Form(REFUTED if refuted else HELD, "", p_value, _pictured(at, driver, wanted))
    if not refuted:
        return TestedForm(form, names)
    ((columns, _),) = at.derivatives([driver.table])
    worth = found.statistic - 2.0 * found.freedom
    late = None if driver.term else _of_delay(at, driver)
    curve = wanted if driver.term else at.tested(alone, [late], SEED)[0] if late else None
    return TestedForm(form, names, worth, curve, columns)


def _of_delay(at: CurvesAt, driver: _Driver) -> CandidateCurve | None:
    """The curve over a driver that a vehicle file can state of a signal's delay, where the effect
    is one; None where it is not."""
    problem, table, cause = at.problem, driver.table, driver.cause
    place = places(problem)
    for name, term in problem.compiled.machine.error_terms.items():
        if name in place and term.late and term.late[0] in cause.effect.delays:
            seconds = abs(float(at.fit.theta[cause.index])) * problem.units[cause.index]
            size = seconds / problem.units[place[name]]
            return table._replace(term=name, theta=place[name], unit=size)
    return None


def _deviation(at: CurvesAt, beside: Nuisances, columns: Floats) -> FormDeviation:
    """What the data want over one driver, by derivatives ``columns`` (K, c), beside the effect."""
    gram = columns.T @ columns
    of = Projection.of(beside.at, beside.free, beside.prior).out_of(columns)
    blocks = noise_blocks(at.problem)
    return deviation(
        of.pure, beside.at.r, of.score, of.information, blocks, NEGLIGIBLE * gram, INEXACT
    )


def _pictured(at: CurvesAt, driver: _Driver, wanted: Curve) -> FormCurve:
    """Over the driver: what the effect does, and what the data want."""
    problem, table, cause = at.problem, driver.table, driver.cause
    size = float(at.fit.theta[cause.index])
    grid = np.linspace(table.at[0], table.at[-1], POINTS)
    basis = hats(grid, table.at)
    if driver.term is None:
        of, unit, scale = cause.gain_name, cause.gain.unit, float(problem.units[cause.index])
        own = np.full(POINTS, size)
    else:
        term = problem.compiled.machine.error_terms[table.term]
        of, unit, scale = table.term, term.unit, term.size
        share = driver.term.over([v[table.covariate] for v in at.values], _acts(problem), grid)
        assert share is not None
        own = size * share
    std = np.sqrt(np.sum((wanted.off @ basis.T) ** 2, axis=0))
    data = own + basis @ wanted.coefficients
    gain = driver.term is None
    return FormCurve(table.covariate, of, unit, grid, scale * own, scale * data, scale * std, gain)


def beside_forms(search: Search, h: CauseSet, forms: Mapping[str, TestedForm]) -> Nuisances:
    """What is free at a cause set: nuisances, gains, shapes, and curves over the drivers of those
    effects whose forms are refuted."""
    fit = search.objective.white_at(h.fit.theta, h.fit.shapes)
    beside = _beside(search, fit, h)
    for tested_form in forms.values():
        if tested_form.columns is not None:
            beside = beside.also(tested_form.columns, WIDEST)
    return beside.explained()


def fewer_causes(search: Search) -> CauseSet | None:
    """The best without a cause that improves the fit too little beside the others at their final
    shapes, or beside the curve that stands for a form that is refuted: it made up for it."""
    best = search.best
    if len(best.causes) < 2:
        return None
    fits = [search.without(cause, best) for cause in best.causes]
    fewer = min(fits, key=cost_of)
    if fewer.cost - best.cost < search.least_gain(fewer):
        return fewer
    if (without := _no_more_than_form(search, fits)) is not None:
        return without
    forms = tested_forms(search, search.released(best))
    if not any(tested_form.form.refuted for tested_form in forms.values()):
        return None
    wrong, first = max(forms.items(), key=lambda each: each[1].worth)
    beside = beside_forms(search, best, {wrong: first})
    rest = [i for i, c in enumerate(best.causes) if c.name != wrong]
    explained = {i: _explained(beside, best.causes[i].index) for i in rest}
    least = min(explained, key=lambda i: explained[i], default=None)
    return None if least is None or explained[least] > search.least_gain() else fits[least]


def _no_more_than_form(search: Search, fits: Sequence[CauseSet]) -> CauseSet | None:
    """Of the best without one cause each, one without which the form of a much stronger cause is
    refuted, by a curve that explains as much as the cause does."""
    explained = [fewer.cost - search.best.cost for fewer in fits]
    for fewer, own in zip(fits, explained, strict=True):
        strong = {
            c.name for c, e in zip(search.best.causes, explained, strict=True) if own < MINOR * e
        }
        if not strong:
            continue
        forms = tested_forms(search, search.released(fewer), wider=True)
        if any(forms[n].form.refuted and forms[n].worth > own - CLOSE for n in strong):
            return fewer
    return None


def _explained(beside: Nuisances, gain: int) -> float:
    """By how much a gain improves the fit beside all else, 2 Δ ln L, to first order."""
    column = beside.at.by(np.array([gain]))
    rest = beside.free[beside.free != gain]
    of = Projection.of(beside.at, rest, beside.prior).out_of(column)
    information = max(float(of.information[0, 0]), ABSENT)
    return float(beside.at.theta[gain] + of.score[0] / information) ** 2 * information


def _beside(search: Search, fit: Linearisation, h: CauseSet) -> Nuisances:
    """Nuisances, gains and shapes of a cause set."""
    beside = Nuisances(fit, search.free(h.causes), search.objective.prior)
    for cause in h.causes:
        columns = by_shapes(search.objective, fit, cause)
        beside = beside.also(columns, np.inf) if columns.size else beside
    return beside


def _drivers(at: CurvesAt, causes: Sequence[CandidateCause], wider: bool) -> list[_Driver]:
    """Of the gains ``causes`` of one effect; ``wider``: with what else drives their error."""
    known, drivers = at.varying(), []
    for cause in causes:
        names: Sequence[str] = drivers_of(cause.effect, cause.gain.key, known)
        term = standin(at.objective, at.fit, cause)
        names = names or _functions(at, term, known) or _of_equation(at.problem, cause, known)
        for name in names:
            drivers += _over(at, cause, term, name)
        if wider and term:
            own = at.problem.compiled.machine.error_terms[term.term].covariates
            for name in [name for name in known if name in own and name not in names]:
                drivers += _over(at, cause, None, name)
    return drivers


def _functions(at: CurvesAt, term: Standin | None, known: Sequence[str]) -> list[str]:
    """Covariates of which the error that stands for an effect is a function, but no constant."""
    if term is None:
        return []
    acts, found = _acts(at.problem), list[str]()
    for name in known:
        values, bends = [v[name] for v in at.values], at.bends(name)
        share = term.over(values, acts, bends[0]) if bends else None
        if share is not None and np.ptp(share) > CONSTANT * np.abs(share).max():
            found.append(name)
    return found


def _over(at: CurvesAt, cause: CandidateCause, term: Standin | None, name: str) -> list[_Driver]:
    """A cause over one covariate, by a smooth curve and by one that bends where the cause acts:
    none where the covariate does not vary, or the cause does nothing."""
    problem, size = at.problem, float(at.fit.theta[cause.index])
    values, acts = [v[name] for v in at.values], _acts(problem)
    found = at.bends(name)
    if not found or size == 0.0:
        return []
    equation = cause.effect.equation
    share = term.over(values, acts, found[0]) if term else None
    if term is None or share is None:
        table = CandidateCurve(
            cause.gain_name, equation, cause.index, name, found[0], abs(size), NEGLIGIBLE
        )
        return [_Driver(table, cause, None)]
    strength = [a * np.nan_to_num(s) ** 2 for a, s in zip(acts, term.share, strict=True)]
    closer = _closer(found[0], np.concatenate(values), np.concatenate(strength))
    drivers = []
    for bends in (found[0], closer):
        if (share := term.over(values, acts, bends)) is not None:
            unit, place = float(np.abs(size * share).max()), places(problem)[term.term]
            table = CandidateCurve(term.term, equation, place, name, bends, unit, NEGLIGIBLE)
            drivers.append(_Driver(table, cause, term))
    return drivers


def _closer(bends: Floats, value: Floats, strength: Floats) -> Floats:
    """The knots ``bends``, and more of them where an effect acts with this ``strength`` (K) at
    these values (K) of its driver."""
    order = np.argsort(value)
    shares = np.cumsum(strength[order])
    where = np.linspace(0.0, 1.0, BENDS + 2)[1:-1] * shares[-1]
    more = value[order][np.minimum(np.searchsorted(shares, where), len(order) - 1)]
    every = np.unique(np.concatenate([bends, np.clip(more, bends[0], bends[-1])]))
    apart = np.diff(every, prepend=-np.inf) > CLOSEST * (bends[-1] - bends[0])
    return np.asarray(every[apart | np.isin(every, bends[[0, -1]])])


def _acts(problem: Problem) -> list[Floats]:
    """Where errors act, 1, and where not, 0, at every event of each drive."""
    acts = [drive.tracked.act.astype(float) for drive in problem.drives]
    return acts if any(act.any() for act in acts) else [np.ones(len(act)) for act in acts]


def _of_equation(problem: Problem, cause: CandidateCause, known: Sequence[str]) -> list[str]:
    """Covariates of the errors of a cause's equation: the gain of one that reads none may depend
    on any."""
    terms = problem.compiled.machine.error_terms.values()
    own = [term.covariates for term in terms if term.equation == cause.effect.equation]
    return [name for name in known if any(not names or name in names for names in own)]
