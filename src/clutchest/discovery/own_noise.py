"""Errors that pass for noise: hypotheses compared each with the noise model of its own residuals.

Noise is estimated from what the model leaves.  Where that is many times what the sensors are stated
to have, and slow, an autoregressive model takes an error of the equations for its own, and the
score of the cause at 0 says little: causes that act beyond a threshold only begin far from there.
So the candidates are fitted from plausible sizes on, and what is compared is the likelihood with
the determinant of the noise's covariance in it.  Discrepancies are left to that noise meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.candidate_scores import by_shapes, columns, scored, spanned
from clutchest.discovery.candidates import CandidateCause, settings
from clutchest.discovery.search import LEADERS, LEVEL, Search, free_of
from clutchest.inference.concurrent_fits import concurrently
from clutchest.inference.estimated_noise import LONGEST
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import TURNS, improve, settle, step
from clutchest.inference.noise_model import NoiseModel
from clutchest.inference.objective import FAR, Objective
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

LOUD = 3.0  # rms innovation, of the stated noise, from which on some of it may be an error
ENOUGH = 30.0  # of 2 Δ ln L, noise included, by which a cause must be more likely than none
LEADS = 10.0  # the same after one turn, from which on a cause may become so
SLIGHT = 0.5  # the same: a turn that gained less was the last
LIKELY = 3.0  # the same by first order, from which on one that acts from nothing on is fitted
SIZE = 0.3  # of its largest plausible size, from which a fit begins where the effect states none

Settled = tuple[float, Objective, Linearisation]


def with_noise_of_likeliest(search: Search) -> Search:
    """The search with the noise model of the likeliest cause, where one is far likelier than none
    and what the model without a cause leaves is no noise of the stated level; else as it is, and
    where of a record so long that its noise is known well a score is significant."""
    known = sum(len(drive.readings.t) for drive in search.problem.drives) > LONGEST
    significant = search.null_scores.least_p <= LEVEL
    if (known and significant) or not loud(search.null.fit, search.objective):
        return search
    begin = as_loud(search)
    likely = _likely_by_first_order(search, begin)
    scores = zip(search.candidates, search.null_scores.z, strict=True)
    tasks = [(c, size) for c, z in scores if c in likely for size in _sizes(c, float(z))]

    def fitted(task: tuple[CandidateCause, float], turns: int) -> Settled:
        cause, size = task
        theta = search.null.fit.theta.copy()
        theta[cause.index] = size / cause.gain.upper
        return _settled(begin, (cause,), theta, turns)

    def judged(task: tuple[CandidateCause, float], turns: int) -> tuple[float, Linearisation]:
        """The cost and where the fit ends: all fits together would not have room."""
        cost, _, fit = fitted(task, turns)
        return cost, fit.bare

    every = len(search.problem.thetas)
    # what is known after one turn leads on: only the best are followed to the end
    fits = concurrently(search.problem, every, lambda task: judged(task, 1), tasks)
    leaders = sorted(range(len(fits)), key=lambda i: fits[i][0])[:LEADERS]
    without, _, _ = _settled(begin, (), search.null.fit.theta, turns=1)
    if not leaders or without - fits[leaders[0]][0] < LEADS:
        return search
    ends = concurrently(search.problem, every, lambda i: judged(tasks[i], TURNS), leaders)
    for i, end in zip(leaders, ends, strict=True):
        fits[i] = end
    own: dict[CandidateCause, tuple[float, Linearisation]] = {}
    for (cause, _), (cost, fit) in zip(tasks, fits, strict=True):
        if cause not in own or cost < own[cause][0]:
            own[cause] = cost, fit
    best = min(leaders, key=lambda i: fits[i][0])
    none, _, _ = _settled(begin, (), search.null.fit.theta)
    if none - fits[best][0] < ENOUGH:
        return search
    others = concurrently(
        search.problem, every, lambda i: _likeliest_without(begin, tasks[i][0], fits[i][1]), leaders
    )
    none = min(none, *others)
    if none - fits[best][0] < ENOUGH:
        return search
    gained = {cause: (none - cost, fit) for cause, (cost, fit) in own.items()}
    _, objective, fit = fitted(tasks[best], TURNS)
    return replace(_judged_by(search, objective, fit), begins=gained)


def _likely_by_first_order(search: Search, objective: Objective) -> list[CandidateCause]:
    """The candidates that may lead: those that act from a size on, of which a slope at 0 says
    nothing, and others that would by one step from the model without a cause."""
    null, free = search.null.fit, search.free(())
    fit = objective.linearise_at(null.theta, null.shapes)

    def after(at: Linearisation, of: NDArray[np.int64]) -> float:
        """The cost where a step of these thetas (indices) leads, to first order."""
        move = step(objective, at, of)
        rest = [innovations.r + innovations.change(move) for innovations in at.raw]
        return _cost(objective, rest, at.theta + move)

    without, likely = after(fit, free), [c for c in search.candidates if c.gain.trials]
    rest = [c for c in search.candidates if not c.gain.trials]
    for some, shapes in by_shapes(fit, rest):
        at = objective.relinearise(fit, fit.theta, shapes) if shapes else fit
        likely += [
            rest[i] for i in some if without - after(at, np.append(free, rest[i].index)) >= LIKELY
        ]
    return likely


def _likeliest_without(begin: Objective, cause: CandidateCause, fit: Linearisation) -> float:
    """The cost without a cause where fits from one with it lead: they may end elsewhere, and
    better, than from the vehicle file's numbers.  From noise as that fit leaves it they stay near;
    in white noise they may leave what it has found."""
    theta = fit.theta.copy()
    theta[cause.index] = 0.0
    at = begin.linearise_at(fit.theta, fit.shapes, NO_DERIVATIVES)
    near = _likelier(begin.in_noise_of(at), (), theta, TURNS)
    return min(near[0], _settled(begin, (), theta)[0])


def _sizes(cause: CandidateCause, z: float) -> tuple[float, ...]:
    """Where fits of a cause of score ``z`` begin, in the unit of its gain: where it acts from
    nothing on, on the side on which the score is."""
    gain = cause.gain
    if gain.trials:
        return gain.trials
    return (SIZE * (gain.upper if gain.one_sided or z > 0.0 else gain.lower),)


def loud(fit: Linearisation, objective: Objective) -> dict[str, float]:
    """Sensor → its rms innovation at a fit, of its stated noise, where that is ``LOUD`` or more
    without what noise of the inputs and discrepancies most probably did: both are stated, too."""
    at = objective.linearise_at(fit.theta, fit.shapes, NO_DERIVATIVES)
    drives = objective.problem.drives
    sensor = np.concatenate([drive.readings.sensor for drive in drives])
    r = np.concatenate([innovations.r for innovations in objective.less_scatter(at)])
    names = [each.name for each in objective.problem.compiled.model.sensors]
    times = {names[i]: float(np.sqrt(np.mean(r[sensor == i] ** 2))) for i in np.unique(sensor)}
    return {name: each for name, each in times.items() if each >= LOUD}


def _settled(
    begin: Objective, causes: Sequence[CandidateCause], theta: Floats, turns: int = TURNS
) -> Settled:
    """The most probable numbers from ``theta`` (m) on, with noise as they leave it after so many
    ``turns`` at most; and −2 ln(probability), that of the noise included.  The first fit is one by
    the objective ``begin``."""
    gains = [c.index for c in causes]
    objective, fit = settle(begin, theta, gains, settings(tuple(causes)), turns)
    settled = _costed(objective, fit)
    near = objective.in_noise_of(fit)
    return min(settled, _likelier(near, causes, fit.theta, turns), key=lambda each: each[0])


def _likelier(
    objective: Objective, causes: Sequence[CandidateCause], theta: Floats, turns: int
) -> Settled:
    """Numbers from ``theta`` (m) on and noise that they leave, in turns, as long as both together
    become likelier.  What :func:`settle` ends with is not the likeliest: its noise is what would be
    left if candidates had taken their shares, too."""
    free, shapes = free_of(objective.problem, causes), settings(tuple(causes))
    best, objective = None, replace(objective, span=None)
    for _ in range(turns):
        fit = objective.linearise_at(theta, shapes, free)
        made = _costed(objective, improve(objective, fit, free, derivatives=False))
        if best is not None and made[0] > best[0] - SLIGHT:
            return min(best, made, key=lambda each: each[0])
        best, theta = made, made[2].theta
        objective = objective.in_noise_of(made[2])
    assert best is not None
    return best


def _costed(objective: Objective, fit: Linearisation) -> Settled:
    """A fit with its cost, in noise as it leaves it."""
    cost = _cost(objective, [innovations.r for innovations in fit.raw], fit.theta)
    return cost, replace(objective, span=None), fit


def as_loud(search: Search) -> Objective:
    """An objective in white noise as loud as what the model without a cause leaves."""
    known, null = search.objective, search.null.fit
    begin = Objective.of(replace(search.problem, discrepancies=()))
    begin = replace(begin, prior=known.prior, low=known.low, high=known.high)
    return begin.in_white_noise_of(begin.linearise_at(null.theta, null.shapes, NO_DERIVATIVES))


def _cost(objective: Objective, innovations: Sequence[Floats], theta: Floats) -> float:
    """−2 ln(probability) of ``innovations`` (K) of each drive at ``theta`` (m) in noise as they
    show it, that of the noise included."""
    cost, _ = as_noise(objective, innovations)
    return cost + float(np.sum(objective.prior * theta**2))


def as_noise(objective: Objective, innovations: Sequence[Floats]) -> tuple[float, NoiseModel]:
    """−2 ln(probability) of ``innovations`` (K) of each drive as noise, and the noise that they
    show."""
    own, cost = NoiseModel.fit(objective.stretches, innovations), 0.0
    for s, each in zip(objective.stretches, innovations, strict=True):
        white = own.whiten(s, each)
        order = np.minimum(s.place, own.level.shape[1] - 1)
        level = own.level[np.searchsorted(own.groups, s.group), order]
        cost += float(np.sum(np.minimum(white**2, FAR**2)) + 2.0 * np.sum(np.log(level)))
    return cost if np.isfinite(cost) else np.inf, own


def _judged_by(search: Search, objective: Objective, fit: Linearisation) -> Search:
    """A search that has found nothing yet, with another noise model, that of a ``fit``."""
    objective = replace(objective, problem=search.problem)
    at = objective.linearise_at(fit.theta, fit.shapes)
    objective = objective.with_noise_of(at).with_discrepancies(at)
    at = objective.white_at(fit.theta, fit.shapes)
    null = objective.white_at(search.null.fit.theta)
    objective = spanned(objective, [at, null], search.candidates)
    free = free_of(search.problem, ())
    null = improve(objective, objective.judged(null), free, derivatives=False)
    null = objective.white_at(null.theta)
    derivatives = columns(objective, null, search.candidates)
    scores = scored(objective, null, free, search.candidates, derivatives, seed=1)
    none = replace(search.null, fit=null).bare
    return replace(search, objective=objective, null=none, best=none, null_scores=scores)
