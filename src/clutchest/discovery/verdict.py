"""From a search to a verdict: the causes that are established, and whether an error without a name
remains."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from clutchest.discovery.alternative_modes import (
    cause_in_alternative_mode,
    model_in_alternative_mode,
)
from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.form_test import (
    TestedForm,
    beside_forms,
    fewer_causes,
    tested_forms,
)
from clutchest.discovery.holdout_gain import held_out_gain
from clutchest.discovery.noise_beside_curves import with_noise_beside_curves
from clutchest.discovery.nuisances import Nuisances
from clutchest.discovery.outranking import better_as_curve
from clutchest.discovery.refitted_curves import Located, located
from clutchest.discovery.residual_curves import Curve, curves
from clutchest.discovery.search import CLOSE, MOST, Search, run
from clutchest.discovery.several_errors import TIED, Errors, several_errors
from clutchest.discovery.shape_profile import Spread, refine
from clutchest.inference.map_fit import improve
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.progress import Progress
from clutchest.signals import Floats

# Family-wise p-value below which an error without a name is significant where drives held out may
# reject it.  In truth it is exceeded far more often, as curves follow small errors of structure,
# integration and time stamps too: of 177 healthy trucks unlike the model, three that gave no name
# lay between 1e-5 and 1e-4.  Without such drives it must be established.
UNNAMED = 1e-4
# p-value from which on held-out drives may reject a result.  Below, it is established by this log,
# whatever they say: a drive may be affected by something that does not last.
ESTABLISHED = 1e-5
CHANCE = 0.01  # p-value from which on what is left beside a single cause may be noise
LESS = (0.0, 1.0)  # parts of the discrepancies that the data show without an error

HeldOut = Callable[[], Problem]  # held-out drives, linearised when they are asked for


@dataclass(frozen=True, slots=True)
class SearchVerdict:
    """The answer of one log.

    ``search`` as it ended.  ``best`` the causes that are established, ``tied`` others that the data
    do not exclude, of sizes as the data say, ``rejected`` those they do; ``limit``: the cost of the
    best at plausible sizes, to which that of rejected ones is compared.  ``spreads``: the
    uncertainty of shapes.  ``errors`` of the model without a cause as curves, the most likely
    first, of a single cause whose form holds those where one may explain as much; ``unnamed``:
    whether they explain more than any cause.  ``dropped``: names of causes that are not confirmed
    on held-out drives.  ``forms``: the tests of the forms of all causes, by effect.  ``others``:
    errors without a name in other equations beside the first one's; ``instead``: equations in which
    that may be as well.  ``covariates`` over which curves were tested.
    """

    search: Search
    best: CauseSet
    tied: Sequence[CauseSet]
    rejected: Sequence[CauseSet]
    limit: float
    spreads: Mapping[frozenset[str], Spread]
    errors: Sequence[Curve]
    unnamed: bool
    dropped: Sequence[str]
    p_unnamed: float = 1.0
    forms: Mapping[str, TestedForm] = field(default_factory=dict)
    others: Sequence[Sequence[Curve]] = ()
    instead: Sequence[str] = ()
    covariates: frozenset[str] = frozenset()
    biases: Mapping[frozenset[str], tuple[Floats, Floats]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """As ``discovery.json`` has it."""
        if self.unnamed:
            return "unknown"
        return "none" if not self.best.causes else "ambiguous" if self.tied else "named"

    @property
    def sets(self) -> list[CauseSet]:
        """The best and those tied with it."""
        return [self.best, *self.tied]

    def bias(self, h: CauseSet) -> tuple[Floats, Floats]:
        """Of the numbers (m) of a set, where it is known, and its standard deviation."""
        none = np.zeros(len(h.fit.theta))
        return self.biases.get(h.names, (none, none))


def judge(search: Search, other: HeldOut | None, progress: Progress | None) -> SearchVerdict:
    """Search, and decide what is established; ``other``: drives that may reject doubtful causes."""
    errors, level = list[Curve](), UNNAMED if other else ESTABLISHED
    if not search.clear:  # a clear cause is asked for other modes itself
        errors = errors_without_causes(search)
        if significant(errors, level) and (moved := model_in_alternative_mode(search)) is not None:
            search, errors = moved, errors_without_causes(moved)
    search = run(search, progress)
    for _ in range(MOST):  # a mode that was left must not be entered for ever
        search, moves = cause_in_alternative_mode(search)
        if not moves:
            break
        search = run(search, progress)
        errors = []
    search, dropped = backward_eliminated(search, other) if other else (search, {})
    search, spreads = refine(search)
    for _ in range(MOST):
        if (fewer := fewer_causes(search)) is None:
            break
        search, spreads = refine(search.reduced_to(fewer))
    return _verdict(search, spreads, errors, dropped, level)


def _verdict(
    search: Search,
    spreads: Mapping[frozenset[str], Spread],
    errors: Sequence[Curve],
    dropped: Mapping[str, float],
    level: float,
) -> SearchVerdict:
    """Of a search that has ended; ``errors`` of the model without a cause, none where these were
    not asked for, as a cause was clear; one without a name has a p-value below ``level``.

    A curve must explain more than the ``dropped`` causes did, by more than its freedom: what
    held-out drives deny as a cause is no error without a name either.
    """
    best, tied, remaining = search.best, search.tied, errors
    rejected = [h for h in search.rivals if h not in tied]
    limit = best.cost
    if best.causes:
        tied = [search.released(h).bare for h in tied]
        best = search.released(best)
        remaining = _residual_errors(search, best)
    elif not errors:
        errors = remaining = errors_without_causes(search)
    denied = sum(dropped.values())
    unnamed = significant(remaining, level) and remaining[0].worth > denied
    forms, unnamed = _by_forms(search, best, unnamed, level)
    if best.causes:
        own = () if unnamed else _asked(best, forms, remaining)
        errors = errors_without_causes(search, own)
    p = errors[0].p_value if errors else 1.0
    unnamed, errors, (found, instead) = _unnamed_errors(
        search, best, forms, errors, remaining, unnamed, denied
    )
    for h in tied:
        forms |= {k: v for k, v in tested_forms(search, h).items() if k not in forms}
    search = replace(search, best=best)
    return SearchVerdict(
        search,
        best,
        tied,
        rejected,
        limit,
        spreads,
        errors,
        unnamed,
        [*dropped],
        p,
        forms,
        found[1:],
        instead,
        frozenset(curve.covariate for curve in (*remaining, *errors)),
    )


def _asked(
    best: CauseSet, forms: Mapping[str, TestedForm], remaining: Sequence[Curve]
) -> tuple[str, ...]:
    """The equation of a single cause whose form holds, and those in which a curve may explain
    clearly more than it does: by itself none explains more than beside the cause and the cause
    together.  None where any may."""
    if len(best.causes) > 1 or any(tested.form.refuted for tested in forms.values()):
        return ()
    own = [cause.effect.equation for cause in best.causes]
    return tuple(dict.fromkeys([*own, *(e.equation for e in remaining if e.worth > CLOSE)]))


def _unnamed_errors(
    search: Search,
    best: CauseSet,
    forms: Mapping[str, TestedForm],
    errors: Sequence[Curve],
    beside: Sequence[Curve],
    unnamed: bool,
    denied: float,
) -> tuple[bool, Sequence[Curve], Errors]:
    """Whether an error remains ``unnamed``, as it does where one without a name explains more than
    the best causes, and 2 Δ ln L of what was ``denied``, and errors ``beside`` a single cause are
    not what chance leaves; the ``errors`` of the model without a cause; and those that are
    established, by equation."""
    refuted = [effect for effect in best.effects if forms[effect].form.refuted]
    explained, count = search.null.cost - best.cost + denied, len(best.causes)
    held = len(refuted) < len(forms) and significant(beside, CHANCE)
    if count > 1 or held:  # a curve may explain as much as several, or more
        unnamed = unnamed or better_as_curve(search, best, forms, explained, errors)
    place = None
    if not unnamed and (count > 1 or refuted):
        # what explains most to first order may not do so in full
        place = located(search, errors, explained)
        errors = place.errors
        unnamed = count > 1 and better_as_curve(search, best, forms, explained, errors)
    tried = () if unnamed else refuted
    more = {e: _more_than_form(search, best, e, forms[e], errors) for e in tried}
    unnamed = unnamed or any(max(each.values()) > CLOSE for each in more.values())
    several, fitted = Errors([], []), place is not None and place.fitted
    if count == 1 and refuted:  # of several, each may make up for the form of others
        own = {c.effect.equation for c in best.causes}
        as_likely = {q: by for each in more.values() for q, by in each.items() if by > -TIED}
        several = Errors([], [q for q in as_likely if q not in own])
    if count == 1 and refuted and not unnamed and not fitted:
        quieter = _in_noise_beside_curves(search, errors)
        if quieter is not None and _elsewhere(best, forms, quieter.errors):
            unnamed, place = True, quieter
    elif unnamed and not fitted:
        place = located(search, _beside_less_discrepancies(search) or errors, explained)
        if not place.fitted:  # errors may pass for noise
            place = _in_noise_beside_curves(search, errors) or place
    if unnamed:
        assert place is not None
        errors, several = place.errors, several_errors(place, search.free(()), UNNAMED)
    if several.found:  # those of the leading equation first
        leading = several.found[0]
        errors = [*leading, *(c for c in errors if c.equation != leading[0].equation)]
    return unnamed, errors, several


def _in_noise_beside_curves(search: Search, errors: Sequence[Curve]) -> Located | None:
    """Where an error is by the noise that curves leave, where that is another one; ``errors`` of
    the model without a cause."""
    beside = with_noise_beside_curves(search, errors)
    if beside is search:
        return None
    own = _beside_less_discrepancies(beside) or _residual_errors(beside, beside.null)
    return located(beside, own)


def _elsewhere(best: CauseSet, forms: Mapping[str, TestedForm], errors: Sequence[Curve]) -> bool:
    """Whether a single cause whose form is refuted is in the wrong equation or over the wrong
    driver: some curve of the ``errors`` explains clearly more than its own do."""
    ((cause, tested),) = ((c.effect, forms[c.name]) for c in best.causes)
    own = [
        e.worth for e in errors if e.equation == cause.equation and e.covariate in tested.drivers
    ]
    return max(e.worth for e in errors) > max(own, default=0.0) + CLOSE


def _by_forms(
    search: Search, best: CauseSet, unnamed: bool, level: float
) -> tuple[dict[str, TestedForm], bool]:
    """The tests of the forms of the best, over what its effects read or, where that names errors
    beside it, over what else drives the errors that stand for them; and whether these remain
    ``unnamed``."""
    forms = tested_forms(search, best)
    if not unnamed or _by_form(search, best, forms, level):
        return forms, False
    wide = tested_forms(search, best, wider=True)
    return (wide, False) if _by_form(search, best, wide, level) else (forms, True)


def _by_form(search: Search, best: CauseSet, forms: Mapping[str, TestedForm], level: float) -> bool:
    """Whether errors beside the best are those of the forms of its causes: with the curves that
    the data want there none is significant."""
    if not any(tested.form.refuted for tested in forms.values()):
        return False
    beside = _residual_errors(search, best, beside_forms(search, best, forms))
    return not significant(beside, level)


def _more_than_form(
    search: Search, best: CauseSet, effect: str, tested: TestedForm, errors: Sequence[Curve]
) -> dict[str, float]:
    """How much more, 2 Δ ln L, the likeliest curve of each equation explains without a cause whose
    form is refuted than curves over its drivers do, or the effect with its form free: clearly more
    where it is in the wrong equation or over the wrong driver; ``errors`` of the model without a
    cause."""
    others = tuple(c for c in best.causes if c.name != effect)
    without = search.null
    if others:
        without = search.fitted(others, best.fit)
        errors = _residual_errors(search, without)
    equation = next(c.effect.equation for c in best.causes if c.name == effect)
    own = [e.worth for e in errors if e.equation == equation and e.covariate in tested.drivers]
    explained = max([without.cost - best.cost + tested.worth, *own])
    most: dict[str, float] = {equation: 0.0}
    for e in errors:
        most[e.equation] = max(most.get(e.equation, 0.0), e.worth)
    return {each: worth - explained for each, worth in most.items()}


def backward_eliminated(search: Search, other: HeldOut) -> tuple[Search, dict[str, float]]:
    """Backward elimination of causes that might be noise beside others and are not confirmed on
    held-out drives, and of established ones that cost more there than they explain in the log.  The
    search without them, in which the rest are judged anew: another set of as many causes may be
    more likely.  What each one eliminated had improved the fit by, 2 Δ ln L."""
    dropped, confirmed = dict[str, float](), set[int]()
    while len(search.best.causes) > 1:
        doubtful = [
            (*search.established(c, search.best), c)
            for c in search.best.causes
            if c.index not in confirmed
        ]
        worth, p, cause = max(doubtful, key=lambda each: each[1], default=(0.0, 0.0, None))
        if cause is None:
            break
        fewer = search.without(cause, search.best)
        more = 2.0 * held_out_gain(search, search.best, other(), fewer).total
        if (
            worth + more > 0.0
            if p <= ESTABLISHED
            else more > 0.0 and search.margin(fewer) + more >= 0.0
        ):
            confirmed.add(cause.index)
            continue
        search = search.reduced_to(fewer)
        confirmed.clear()
        dropped[cause.name] = dropped.get(cause.name, 0.0) + max(worth, 0.0)
    return search, {name: w for name, w in dropped.items() if name not in search.best.names}


def least_confirmed(verdict: SearchVerdict) -> float:
    """What a result must gain on held-out drives, ln(probability), not to be rejected: one that
    might be noise so much that it is significant when that counts as well; −∞ where the log alone
    establishes it."""
    search = verdict.search
    if verdict.unnamed:
        p = verdict.p_unnamed
        return float(np.log(p / UNNAMED)) if p > ESTABLISHED else -np.inf
    p = max(search.established(c, verdict.best)[1] for c in verdict.best.causes)
    return -search.margin() / 2.0 if p > ESTABLISHED else -np.inf


def significant(errors: Sequence[Curve], level: float) -> bool:
    """Whether the likeliest of the ``errors`` has a p-value below a ``level``."""
    return bool(errors) and errors[0].p_value < level


def _beside_less_discrepancies(search: Search) -> list[Curve]:
    """Errors beside the model without a cause, each beside as much of the discrepancies as is
    likeliest with it: beside all that the data show without it, an error that is there passes for
    wander in part, and what is sudden in the rest for its driver."""
    if not search.problem.discrepancies:
        return []
    objective, free = replace(search.objective, span=None), search.free(())
    at = objective.linearise_at(search.null.fit.theta).as_measured
    parts = objective.with_parts_of_discrepancies(at, free, LESS)
    most = max(likely for _, likely in parts)
    best: dict[tuple[str, str, int], Curve] = {}

    def beside(own: Objective) -> list[Curve]:
        """Those beside such a part of the discrepancies."""
        fit = replace(improve(own, own.whitened(at), free), raw=())
        return curves(own, fit, Nuisances(fit, free, own.prior), seed=3)

    for own, likely in parts:
        for curve in beside(own):
            lowered = replace(curve, evidence=curve.evidence + (likely - most))
            key = lowered.error_term, lowered.covariate, len(lowered.at)
            best[key] = max(best.get(key, lowered), lowered, key=lambda each: each.evidence)
    return sorted(best.values(), key=lambda curve: -curve.evidence)


def errors_without_causes(search: Search, equations: Collection[str] = ()) -> list[Curve]:
    """Errors of the model without a cause, in these ``equations`` alone where some are given."""
    return _residual_errors(search, search.null, equations=equations)


def _residual_errors(
    search: Search,
    h: CauseSet,
    beside: Nuisances | None = None,
    equations: Collection[str] = (),
) -> list[Curve]:
    """Errors that neither nuisances nor the causes of a set explain; or those ``beside``."""
    fit = search.objective.white_at(h.fit.theta, h.fit.shapes)
    beside = beside or Nuisances(fit, search.free(h.causes), search.objective.prior)
    return curves(search.objective, fit, beside, 3, equations)
