"""What a search comes to: the causes that stand, and whether something without a name is left."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp

from clutchest.discovery.alternative_modes import (
    cause_in_alternative_mode,
    model_in_alternative_mode,
)
from clutchest.discovery.holdout_gain import on_another
from clutchest.discovery.residual_curves import Curve, curves
from clutchest.discovery.result import Gain
from clutchest.discovery.search import MOST, Hypothesis, Search
from clutchest.discovery.shape_profile import Spread, refine
from clutchest.inference.problem import Problem
from clutchest.progress import Progress

# Family-wise chance that noise is taken for a cause without a name; several times as much in truth,
# as curves follow small errors of integration and of time stamps too (of 93 drives in which nothing
# is hidden, three came out below 0.001).
UNNAMED = 0.0001
# Chance of noise from which on other drives may take a finding back.  Below, it is there in this
# log, whatever they say: a drive may have been spoilt by what passes.
SURE = 1e-5

HeldOut = Callable[[], Problem]  # drives held out, linearised when they are asked for


@dataclass(frozen=True, slots=True)
class Judged:
    """The answer of one log.

    ``best`` the causes that stand, ``tied`` others that the data do not exclude, of sizes as the
    data say, ``lost`` those they do; ``limit``: what the best costs at plausible sizes, as those
    that lost have them.  ``spreads``: what is not known of shapes.  ``errors`` of the model as it
    is as curves, the likeliest first; ``unnamed``: whether they say more than any cause.
    ``dropped``: names of causes that the drives held out do not bear out.
    """

    best: Hypothesis
    tied: Sequence[Hypothesis]
    lost: Sequence[Hypothesis]
    limit: float
    spreads: Mapping[frozenset[str], Spread]
    errors: list[Curve]
    unnamed: bool
    dropped: Sequence[str]

    @property
    def verdict(self) -> str:
        """As ``discovery.json`` has it."""
        if self.unnamed:
            return "unknown"
        return "none" if not self.best.chosen else "ambiguous" if self.tied else "named"

    @property
    def sets(self) -> list[Hypothesis]:
        """The best and those tied with it."""
        return [self.best, *self.tied]


def judge(search: Search, other: HeldOut | None, progress: Progress | None) -> Judged:
    """Search, and say what stands; ``other``: drives that may take doubtful causes back."""
    errors = _left_over(search, search.null)
    if _significant(errors) and model_in_alternative_mode(search):
        errors = _left_over(search, search.null)
    search.run(progress)
    for _ in range(MOST):  # a place that was left must not be come back to for ever
        if not cause_in_alternative_mode(search):
            break
        search.run(progress)
        errors = _left_over(search, search.null)
    dropped = backward_eliminated(search, other) if other else []
    spreads, tied, left = refine(search), search.tied(), errors
    lost = [h for h in search.rivals if h not in tied]
    limit = search.best.cost
    if search.best.chosen:
        tied = [search.released(h).bare for h in tied]
        search.best = search.released(search.best)
        left = _left_over(search, search.best)
    unnamed = _significant(left)
    if len(search.best.chosen) > 1:  # one curve may do as much as several causes
        errors = _left_over(search, search.null)
        most = max((curve.worth for curve in errors), default=0.0)
        unnamed |= most > search.null.cost - search.best.cost
    return Judged(search.best, tied, lost, limit, spreads, errors, unnamed, dropped)


def backward_eliminated(search: Search, other: HeldOut) -> list[str]:
    """Take back causes that might be noise beside others, and that the drives held out do not
    bear out: names."""
    dropped, borne_out = list[str](), set[int]()
    while len(search.best.chosen) > 1:
        doubts = [
            (search.established(c, search.best)[1], c)
            for c in search.best.chosen
            if c.index not in borne_out
        ]
        p, cause = max(doubts, key=lambda doubt: doubt[0], default=(0.0, None))
        if cause is None or p <= SURE:
            break
        fewer = search.without(cause)
        gained = on_another(search, search.best, other(), fewer)
        if gained.total > 0.0 and search.stays(2.0 * gained.total, fewer):
            borne_out.add(cause.index)
            continue
        search.settle_for(fewer)
        dropped.append(cause.name)
    return dropped


def rejected_by_holdout(search: Search, judged: Judged, gained: Gain) -> bool:
    """Whether a finding might be noise and is none when what other drives ``gained`` counts as
    well."""
    more = 2.0 * gained.total
    if judged.unnamed:
        p = judged.errors[0].p_value
        likelier = exp(min(-more / 2.0, 700.0))
        return p > SURE and p * likelier > UNNAMED
    p = max(search.established(c, judged.best)[1] for c in judged.best.chosen)
    return p > SURE and not search.stays(more)


def _significant(errors: Sequence[Curve]) -> bool:
    return bool(errors) and errors[0].p_value < UNNAMED


def _left_over(search: Search, h: Hypothesis) -> list[Curve]:
    """What neither nuisances nor the causes of a hypothesis explain."""
    fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes)
    fit = replace(fit, raw=())  # room for the curves
    return curves(search.objective, fit, search.free(h.chosen), seed=3)
