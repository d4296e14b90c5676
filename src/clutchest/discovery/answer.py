"""What a verdict states: causes with their sizes, rivals, and where the error is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.discovery.effect_drivers import drivers_of
from clutchest.discovery.goodness_of_fit import GoodnessOfFit
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import UNTESTED, Cause, Rival, Size
from clutchest.discovery.several_errors import TIED
from clutchest.discovery.verdict import SearchVerdict
from clutchest.discovery.where import Where
from clutchest.inference.map_fit import covariance
from clutchest.inference.problem import Problem

MOST_RIVALS = 6
Sizes = Mapping[tuple[str, str], Size]  # (effect, key) → size


def causes_of(verdict: SearchVerdict) -> tuple[Cause, ...]:
    """Those of the most likely set first; of an effect in several sets, each size as it is in the
    first that has it."""
    causes: dict[str, Cause] = {}
    for h in verdict.sets:
        for (name, key), size in _sizes_in(verdict, h).items():
            if name not in causes:
                cause = next(c for c in h.causes if c.name == name)
                statistic = verdict.search.established(cause, h)
                form = verdict.forms[name].form if name in verdict.forms else UNTESTED
                drivers = drivers_of(cause.effect, cause.gain.key, verdict.covariates)
                equation = cause.effect.equation
                causes[name] = Cause(name, equation, {}, *statistic, form, drivers)
            if key not in causes[name].parameters:
                parameters = {**causes[name].parameters, key: size}
                causes[name] = replace(causes[name], parameters=parameters)
    return tuple(causes.values())


def _sizes_in(verdict: SearchVerdict, h: CauseSet) -> dict[tuple[str, str], Size]:
    """The sizes of one set of causes: gains and shapes with their standard deviations."""
    search, spread = verdict.search, verdict.spreads[h.names]
    problem = search.problem
    fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes, search.free(h.causes))
    # what a healthy vehicle has of an effect is part of its size
    within = problem.tolerances(c.index for c in h.causes)
    free = np.setdiff1d(search.free(h.causes), within)
    bias, scatter = verdict.bias(h)
    variance = np.diag(covariance(search.objective, fit, free)) + spread.variance[free]
    std = np.sqrt(variance + scatter[free] ** 2)
    theta, sizes = fit.theta - bias, dict[tuple[str, str], Size]()
    for c in h.causes:
        unit = problem.units[c.index]
        of_noise, clock = std[free == c.index][0] * unit, problem.clock(c.index)
        value = float(theta[c.index] * unit)
        sizes[c.name, c.gain.key] = Size(value, float(np.hypot(of_noise, clock)))
        for key, shape in c.shapes:
            sizes[c.name, key] = Size(shape, spread.std.get((c.name, key), 0.0))
    return sizes


def sizes_of(causes: Sequence[Cause]) -> Sizes:
    """Every size of the causes."""
    return {(c.effect, key): size for c in causes for key, size in c.parameters.items()}


def sizes_by_effect(h: CauseSet, sizes: Sizes) -> dict[str, dict[str, Size]]:
    """Effect → key → size of the effects of a cause set."""
    by_effect: dict[str, dict[str, Size]] = {}
    for c in h.causes:
        for key in (c.gain.key, *(key for key, _ in c.shapes)):
            by_effect.setdefault(c.name, {})[key] = sizes[c.name, key]
    return by_effect


def rivals_of(problem: Problem, verdict: SearchVerdict) -> tuple[Rival, ...]:
    """Rejected sets, the most likely first; one of whose causes nothing remains is none."""
    rejected = [h for h in verdict.rejected if all(h.fit.theta[c.index] != 0.0 for c in h.causes)]
    return tuple(
        Rival(
            " and ".join(h.effects),
            h.cost - verdict.limit,
            {
                f"{c.name}.{key}" if len(h.causes) > 1 else key: value
                for c in h.causes
                for key, value in (
                    (c.gain.key, float(h.fit.theta[c.index] * problem.units[c.index])),
                    *c.shapes,
                )
            },
        )
        for h in sorted(rejected, key=cost_of)[:MOST_RIVALS]
    )


def where_of(
    verdict: str,
    causes: Sequence[Cause],
    errors: Sequence[Curve],
    others: Sequence[Sequence[Curve]],
    instead: Sequence[str],
    peaks: Mapping[str, str],
) -> Where | None:
    """The equation, and covariates ranked by how likely an error is that correlates with them; a
    state stands for its ``peaks`` as well; ``others``: curves of other equations with errors;
    ``instead``: equations in which the first may be as well, over what it is likeliest to there.
    Where forms are refuted, that which is most surely is the error, over its driver first; else the
    first cause is, over what its effect reads first."""
    if verdict == "none":
        return None
    as_likely = tuple(_where(equation, errors, peaks) for equation in instead)
    if verdict == "unknown":
        first, *also = (_most_significant(each, peaks) for each in (errors, *others))
        return replace(first, others=tuple(also), instead=as_likely)
    curves = {c.effect: c.form.curve for c in causes if c.form.refuted and c.form.curve is not None}
    of, own = causes[0], list(causes[0].drivers)
    if curves:
        of = min((c for c in causes if c.effect in curves), key=lambda c: c.form.p_value or 0.0)
        own = [curves[of.effect].covariate]
    where = replace(_where(of.equation, errors, peaks), instead=as_likely)
    if not own:
        return where
    return Where(of.equation, tuple(dict.fromkeys([*own, *where.covariates])), instead=as_likely)


def strongest_of(errors: Sequence[Curve], peaks: Mapping[str, str]) -> Where | None:
    """The most likely error, though none is established; None where no curve was tested."""
    return _most_significant(errors, peaks) if errors else None


def _most_significant(errors: Sequence[Curve], peaks: Mapping[str, str]) -> Where:
    """The error of the first curve's equation, as significant as the most significant one there."""
    where = _where(errors[0].equation, errors, peaks)
    return replace(where, p_value=min(c.p_value for c in errors if c.equation == where.equation))


def _where(equation: str, errors: Sequence[Curve], peaks: Mapping[str, str]) -> Where:
    own = [curve for curve in errors if curve.equation == equation]
    names = dict.fromkeys(peaks.get(curve.covariate, curve.covariate) for curve in own)
    least = max((curve.evidence for curve in own), default=0.0) - TIED
    likely = dict.fromkeys(peaks.get(c.covariate, c.covariate) for c in own if c.evidence >= least)
    # unless held-out drives say otherwise
    tied = [n for n in likely if n != next(iter(names))] if own and own[0].evidence >= least else []
    peak = bool(own) and own[0].covariate in peaks
    return Where(equation, tuple(names), peak=peak, tied=tuple(tied))


def distorted(fit: GoodnessOfFit) -> Where:
    """The sensor whose residuals are the least like noise."""
    return Where(f"sensor:{fit.tests[0].sensor}", (), distorted=True)
