"""What a log says of each effect of the user's own: its value, its nearest rival, and why it was
not named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.result import Cause, Hypothesis, Size, either
from clutchest.discovery.search import LEVEL, Search
from clutchest.discovery.verdict import SearchVerdict
from clutchest.inference.map_fit import covariance
from clutchest.inference.score_test import NOT_EXCLUDED, d_prime
from clutchest.models.effects import Effect


def hypotheses(
    verdict: SearchVerdict, said: str, causes: Sequence[Cause], own: Sequence[Effect]
) -> tuple[Hypothesis, ...]:
    """One for each of the user's ``own`` effects; ``said``: the verdict in the end, ``causes`` the
    ones it states."""
    return tuple(_of(effect, verdict, said, causes) for effect in own)


def _of(effect: Effect, verdict: SearchVerdict, said: str, causes: Sequence[Cause]) -> Hypothesis:
    search, scores = verdict.search, verdict.search.null_scores
    mine = [i for i, c in enumerate(search.candidates) if c.name == effect.name]
    if not mine:
        why = "not tested: the equations of these signals do not have what it changes"
        return Hypothesis(effect.name, {}, None, None, None, why)
    i = mine[int(np.argmax(np.abs(scores.z[mine])))]
    if not np.isfinite(scores.std[i]):
        why = "not detectable: it has no influence on these readings"
        return Hypothesis(effect.name, {}, None, None, None, why)
    cause = search.candidates[i]
    alone = search.fitted((cause,), search.null.fit)
    size = float(alone.fit.theta[cause.index])
    detectable = float(scores.threshold(LEVEL)[i] / scores.std[i])
    # of what is not detected, the separability at the size that would be
    at = np.copysign(max(abs(size), detectable), size)
    others = [k for k, c in enumerate(search.candidates) if c.name != effect.name]
    apart = [d_prime(scores.information, scores.one_sided, i, at, k) for k in others]
    nearest = int(np.argmin(apart)) if apart else None
    stated = next((c.parameters for c in causes if c.effect == effect.name), None)
    return Hypothesis(
        effect.name,
        stated or _sizes(search, alone),
        float(scores.z[i]),
        None if nearest is None else search.candidates[others[nearest]].name,
        None if nearest is None else apart[nearest],
        "" if stated and said == "named" else _why_not(verdict, said, alone, float(scores.z[i])),
    )


def _sizes(search: Search, alone: CauseSet) -> dict[str, Size]:
    """Of one cause alone, with its standard deviation as far as all is linear."""
    (cause,), fit, problem = alone.causes, alone.fit, search.problem
    # what a healthy vehicle has of an effect is part of its size
    free = np.setdiff1d(search.free(alone.causes), problem.tolerances([cause.index]))
    unit = float(problem.units[cause.index])
    variance = np.diag(covariance(search.objective, fit, free))[free == cause.index][0]
    noise = float(np.sqrt(variance)) * unit
    std = float(np.hypot(noise, problem.clock(cause.index)))
    value = Size(float(fit.theta[cause.index]) * unit, std)
    return {cause.gain.key: value, **{key: Size(shape, 0.0) for key, shape in cause.shapes}}


def _why_not(verdict: SearchVerdict, said: str, alone: CauseSet, z: float) -> str:
    """Why an effect, fitted ``alone``, was not named."""
    search, (cause,) = verdict.search, alone.causes
    scores = search.null_scores
    place = search.candidates.index(cause)
    p = float(scores.p_family_wise(scores.p_alone(np.full(len(scores.std), z))[place]))
    if cause.name in verdict.dropped:
        return "not confirmed on held-out drives"
    if any(cause.name in h.names for h in verdict.sets):
        if said == "ambiguous":
            return f"these data do not separate it: {either([h.effects for h in verdict.sets])}"
        return "it does not explain all of the error" if said == "unknown" else "rejected"
    if p > LEVEL:
        return f"not significant: family-wise p = {p:.2g}, {LEVEL} is required"
    if said == "unknown":
        return "it does not explain the error"
    if said == "none":
        return "not confirmed on held-out drives"
    behind, names = alone.cost - verdict.limit, " and ".join(verdict.best.effects)
    if behind > NOT_EXCLUDED:
        return f"alone it explains less than {names}, by {behind:.1f} in 2 Δ ln L"
    return f"beside {names} it improves the fit by too little"
