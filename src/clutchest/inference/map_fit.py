"""The most probable numbers: Gauss–Newton steps on innovations made white, with priors.

Why not ``scipy.optimize.least_squares``: from the same begin on the same objective, 32 fits of one
cause to 8 drives of the blind suite (strong causes among them, from costs of 2000 on) took 7.9
evaluations each and 50 s altogether here, 15.0 and 88 s there (tolerances 1e-4; 18.9 and 106 s with
1e-6), before steps here were shortened to what is trusted.  Costs agreed within 0.1 but for three
fits of rivals that lag by 100 and more, which ended 1 to 2 higher here, and one higher there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.linear_solve import solved
from clutchest.inference.objective import NO_SHAPES, Objective
from clutchest.inference.unknowns import Shapes
from clutchest.inference.white_linearisation import Linearisation
from clutchest.memory import give_back
from clutchest.signals import Floats

COOLING = (1e4, 1e3, 1e2, 1e1)  # variance of the noise at the first steps, over its own
NEAR = 10.0  # mean square of the innovations: from here on steps lead on
SHARES = (1.0, 0.5, 0.2, 0.05)  # of a hot step, until it pays
GROWING = (0.0625, 0.25)  # of a drive's time: parts of it that are fitted first
STEPS, TURNS = 40, 6  # at most
ALIKE, LONGEST = 0.95, 10.0  # cosine of steps in one direction; by how much one is lengthened
AHEAD, BENT = 0.1, 0.75  # of a step: where the bend of its path is measured, and how large it is
SHORTER, LONGER = 0.25, 3.0  # times the last step: how far steps are trusted after it
POOR, GOOD = 0.25, 0.75  # of what a step promises, below which they are shorter, above, longer
DAMPING = (0.0, *np.geomspace(1e-2, 1e12, 48))  # of steps, one after another while they are long
SETTLED = 0.05  # of −2 ln(probability): a step that promises less is not taken
SURE = 0.2  # of that: what derivatives of the place before must promise less than
CLOSELY = 0.3  # of what a step promises, by which it may gain more or less: it is nearly linear
NEARLY = 0.1  # of what chance makes of a sum of squares: a fit that changed it by less is the last


class Tolerance(NamedTuple):
    """Where a fit ends: a step that promises less than ``step`` of −2 ln(probability), or where it
    is damped less than ``damped``, is not taken, and one that gained less than ``share`` of the
    cost was the last: what lies that far off need not be known to the last digit."""

    step: float = SETTLED
    damped: float = 5.0 * SETTLED
    share: float = 0.003


COARSE, FINE = Tolerance(), Tolerance(1e-4, 1e-4, 0.0)


def settle(
    objective: Objective,
    theta: Floats,
    gains: Sequence[int] = (),
    shapes: Shapes = NO_SHAPES,
    turns: int = TURNS,
    *,
    fitted: bool = False,
) -> tuple[Objective, Linearisation]:
    """The most probable nuisances, and ``gains`` (indices) where some are free too, others as in
    ``theta``; and an objective with the noise model of what is left: a step for the one, an
    estimate of the other, alternately, so many ``turns`` at most.  Where ``theta`` is ``fitted`` to
    nearly the same, the noise is estimated first.  No more turns where they come no nearer to each
    other.  Raises as :func:`with_noise_estimated` does."""
    free = np.concatenate([objective.problem.nuisances, gains]).astype(np.int64)
    begin = brought_near(objective, objective.linearise_at(theta, shapes, free), free)
    if np.isfinite(begin.cost) and not is_near(begin):
        # as if it were of the stated level, each digit of what is left would count
        objective = objective.in_white_noise_of(begin)
        begin = objective.relinearise(begin, begin.theta, active=free)
    lin = begin if fitted and is_near(begin) else improve(objective, begin, free, derivatives=False)
    del begin  # room for all derivatives
    changed, least = np.inf, NEARLY * np.sqrt(2.0 * len(lin.r))
    for _ in range(turns):
        before, last = lin.r @ lin.r, changed
        objective, lin = replace(objective, span=None), lin.as_point
        give_back()
        objective, lin = with_noise_estimated(objective, lin)
        objective = objective.with_span([lin.psi])
        lin = objective.judged(lin).only(free)  # room for those on the way
        lin = improve(objective, lin, free, derivatives=False)
        changed = float(abs(before - lin.r @ lin.r))
        if not least < changed < last:
            break
    return objective, lin


def fitted(objective: Objective, theta: Floats, shapes: Shapes = NO_SHAPES) -> Linearisation:
    """The most probable nuisances, from a ``theta`` on that may be far off; gains as there."""
    free = objective.problem.nuisances
    begin = brought_near(objective, objective.linearise_at(theta, shapes), free)
    return improve(objective, begin, free, derivatives=False)


def with_noise_estimated(
    objective: Objective, lin: Linearisation
) -> tuple[Objective, Linearisation]:
    """The objective with the noise model estimated at a linearisation, and that with every
    derivative.  Raises ClutchestError where the equations run away there."""
    with np.errstate(over="ignore", invalid="ignore"):
        lin = objective.relinearise(lin, lin.theta)
    if not (np.isfinite(lin.cost) and np.isfinite(lin.psi).all()):
        raise ClutchestError(
            "no numbers near the vehicle file's bring the model near these data; is it this "
            "machine?  A file of `clutchest identify`, or another log, may be nearer"
        )
    objective = objective.with_noise_of(lin)
    lin = lin.as_measured  # room for the white ones
    objective = objective.with_discrepancies(lin)
    return objective, objective.whitened(lin)


@np.errstate(over="ignore", invalid="ignore")  # of a part that leads nowhere
def brought_near(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64]
) -> Linearisation:
    """A linearisation far off, as near as steps in hot noise bring it; where that leads nowhere, by
    way of a growing part of the drives: small errors of heat sum up over a long one."""
    if is_near(lin := cooled(objective, lin, free)):
        return lin
    theta = np.where(np.isin(np.arange(len(lin.theta)), free), 0.0, lin.theta)
    for share in GROWING:
        part = objective.until(share)
        begin = cooled(part, part.linearise_at(theta, lin.shapes), free)
        theta = improve(part, begin, free, derivatives=False).theta
    grown = objective.linearise_at(theta, lin.shapes, free)
    return grown if grown.cost < lin.cost else lin


def is_near(lin: Linearisation) -> bool:
    """Whether steps lead on from there."""
    return bool(np.isfinite(lin.cost) and lin.r @ lin.r < NEAR * len(lin.r))


def cooled(objective: Objective, lin: Linearisation, free: NDArray[np.int64]) -> Linearisation:
    """A linearisation far off brought nearer: at once, such data would drag everything along that
    has no prior."""
    for heat in COOLING:
        if heat * len(lin.r) < NEAR * (lin.r @ lin.r):
            lin = _cooler(objective, lin, free, heat)
    return lin


def _cooler(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64], heat: float
) -> Linearisation:
    """A step, as long as it pays, with noise of ``heat`` times its variance."""

    def cost(at: Linearisation) -> float:
        return float(at.r @ at.r / heat + np.sum(objective.prior * at.theta**2))

    move = step(objective, lin, free, heat=heat)
    for share in SHARES:
        tried = objective.relinearise(lin, lin.theta + share * move, active=NO_DERIVATIVES)
        if cost(tried) < cost(lin):
            return objective.relinearise(lin, tried.theta, active=free)
    return lin


def most_probable(
    objective: Objective, free: NDArray[np.int64], theta: Floats, shapes: Shapes = NO_SHAPES
) -> Linearisation:
    """From ``theta`` on to the most probable values of the ``free`` ones (indices), nuisances among
    them; gains stay within their plausible sizes."""
    return improve(objective, objective.linearise_at(theta, shapes), free)


def improve(
    objective: Objective,
    lin: Linearisation,
    free: NDArray[np.int64],
    tolerance: Tolerance = COARSE,
    *,
    derivatives: bool = True,
    chords: int = 0,
) -> Linearisation:
    """The same from a linearisation on, with its ``derivatives``, which take several times as long
    as innovations; without them, by as many ``chords``: steps by those of the place before.

    Steps go as far as they are trusted (Levenberg, Marquardt; Moré 1978), in standard deviations of
    priors.  Valleys bend: those that are shortened bend as the valley does, and a full one may
    climb its wall a little, once, as the next often falls back onto its floor.
    """
    lin = best = _with_derivatives(objective, lin, free)
    trusted, climbed, slow, last = np.inf, False, False, np.zeros(len(lin.theta))
    for _ in range(STEPS):
        move, damping = _within(objective, lin, free, trusted if lin is best else np.inf)
        promised = _promised(objective, lin, move)
        if promised < (tolerance.damped if damping else tolerance.step):
            break
        if damping:
            path = move + _bend(objective, lin, move, free, damping)
        else:
            path = _lengthened(objective, lin, free, move, last)
        theta = objective.within_bounds(lin.theta + path, free)
        there = objective.relinearise(lin, theta, active=NO_DERIVATIVES)
        gained, kept = best.cost - there.cost, (lin.cost - there.cost) / promised
        last = path if gained > 0.0 and not damping else 0.0 * path
        if gained > 0.0:
            slight = gained < max(tolerance.step, tolerance.share * there.cost)
            ends, slow = slight and (slow or (not damping and kept > POOR)), slight
            if not (damping or ends or derivatives):
                there, ends = _by_chords(objective, lin, there, free, chords)
            if ends and not derivatives:
                return there
            if known := _known(objective, lin, there.theta, free):
                best, lin, climbed = known, known, False
                if ends:
                    break
                trusted = _trusted(trusted, move, kept)
                continue
        lost_little = not damping and -gained < promised
        if lost_little and promised < tolerance.damped:
            break
        if lin is best:
            trusted = SHORTER * _length(move)
        climbs = lost_little and not climbed
        climbed |= climbs
        lin = (_known(objective, lin, theta, free) if climbs else None) or best
    return best


def _within(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64], trusted: float
) -> tuple[Floats, float]:
    """A step (m) no longer than is ``trusted``, and its damping: 0 where it is a full one."""
    curvature, slope = _parabola(objective, lin)
    move, damping, every = np.zeros(len(slope)), 0.0, np.eye(len(slope))
    for damping in DAMPING:
        move = _lowest(objective, lin, free, curvature + damping * every, slope)
        if _length(move) <= trusted:
            break
    return move, damping


def _trusted(before: float, move: Floats, kept: float) -> float:
    """How far steps are trusted after a ``move`` that ``kept`` so much of what it promised."""
    if kept < POOR:
        return _length(move) / 2.0
    return max(before, LONGER * _length(move)) if kept > GOOD else before


def _length(move: Floats) -> float:
    return float(np.linalg.norm(move))


def _with_derivatives(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64]
) -> Linearisation:
    """The same with derivatives by the ``free`` thetas, where it has none at all."""
    if lin.active is not None and not len(lin.active):
        return objective.relinearise(lin, lin.theta, active=free)
    return lin


def _known(
    objective: Objective, lin: Linearisation, theta: Floats, free: NDArray[np.int64]
) -> Linearisation | None:
    """``theta`` (m) with derivatives; None where the equations run away by them."""
    there = objective.relinearise(lin, theta, active=free)
    return there if np.isfinite(there.cost) else None


def _by_chords(
    objective: Objective,
    lin: Linearisation,
    there: Linearisation,
    free: NDArray[np.int64],
    most: int,
) -> tuple[Linearisation, bool]:
    """As many as ``most`` steps from where one has led ``there`` from ``lin``, by the derivatives
    of that place, each where the one before gained nearly what it promised.  Where they lead, and
    whether none leads further."""
    kept, promised = lin.cost - there.cost, _promised(objective, lin, there.theta - lin.theta)
    for left in range(most, -1, -1):
        chord = replace(there, by_active=lin.by_active, active=lin.active)
        move = step(objective, chord, free)
        nearly = abs(kept - promised) < CLOSELY * promised
        if (promised := _promised(objective, chord, move)) < SURE * SETTLED:
            return there, True
        if not (left and nearly):
            break
        theta = objective.within_bounds(there.theta + move, free)
        further = objective.relinearise(there, theta, active=NO_DERIVATIVES)
        kept = there.cost - further.cost
        there = further if kept > 0.0 else there
    return there, False


def _lengthened(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64], move: Floats, last: Floats
) -> Floats:
    """A step; where steps go on and on in one direction, one to where they lead (Aitken).

    Along a ridge, derivatives that are nearly alike take turns, and what little each of them is
    off makes a step too short.
    """
    along, square = move @ last, last @ last
    if along <= 0.0 or along < ALIKE * np.sqrt(square * (move @ move)) or along >= square:
        return move
    times = min(float(square / (square - along)), LONGEST)
    return objective.within_bounds(lin.theta + times * move, free) - lin.theta


def _bend(
    objective: Objective,
    lin: Linearisation,
    move: Floats,
    free: NDArray[np.int64],
    damping: float,
) -> Floats:
    """By how much (m) the path along the valley's floor bends away from a damped ``move``: geodesic
    acceleration (Transtrum and Sethna 2012), from the innovations a little way ahead.  Nothing
    where that is so much that the path is none of second order."""
    ahead = objective.relinearise(lin, lin.theta + AHEAD * move, active=NO_DERIVATIVES)
    bend = np.zeros(len(lin.theta))
    if not np.isfinite(ahead.cost):
        return bend
    curved = 1.0 / AHEAD * ((ahead.r - lin.r) / AHEAD - lin.change(move))
    inner = (lin.information + np.diag(objective.prior + damping))[np.ix_(free, free)]
    bend[free] = -solved(inner, lin.slope(curved)[free])
    return bend if 2.0 * _length(bend) < BENT * _length(move) else np.zeros(len(bend))


def step(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64], heat: float = 1.0
) -> Floats:
    """Gauss–Newton's step (m), zero where not ``free``; a gain that would leave its plausible
    sizes stops at their end, and the others make the best of that.  With ``heat`` the data
    count for less."""
    return _lowest(objective, lin, free, *_parabola(objective, lin, heat))


def _parabola(objective: Objective, lin: Linearisation, heat: float = 1.0) -> tuple[Floats, Floats]:
    """Half the second derivative (m, m) of the cost at a linearisation, and half the first (m)."""
    curvature = lin.information / heat + np.diag(objective.prior + 1e-9)
    return curvature, lin.slope(lin.r) / heat + objective.prior * lin.theta


def _lowest(
    objective: Objective,
    lin: Linearisation,
    free: NDArray[np.int64],
    curvature: Floats,
    slope: Floats,
) -> Floats:
    """The step (m) to where a parabola is lowest, as far as the ``free`` ones may go."""
    step = np.zeros(len(lin.theta))
    while len(free):
        rest = -slope[free] - curvature[free] @ step + curvature[np.ix_(free, free)] @ step[free]
        step[free] = solved(curvature[np.ix_(free, free)], rest)
        aim = lin.theta + step
        out = free[(aim[free] < objective.low[free]) | (aim[free] > objective.high[free])]
        if not len(out):
            break
        step[out] = np.clip(aim[out], objective.low[out], objective.high[out]) - lin.theta[out]
        free = np.setdiff1d(free, out)
    return step


def without(
    objective: Objective, lin: Linearisation, free: NDArray[np.int64], gains: NDArray[np.int64]
) -> Floats:
    """``theta`` (m) with these ``gains`` (indices) at 0 and the ``free`` ones where they are most
    probable then, by derivatives at a linearisation."""
    theta = lin.theta.copy()
    theta[gains] = 0.0
    there = replace(lin, theta=theta, r=lin.r + lin.change(theta - lin.theta))
    return theta + step(objective, there, free)


def covariance(objective: Objective, lin: Linearisation, free: NDArray[np.int64]) -> Floats:
    """Of the ``free`` thetas (f), (f, f), as far as all is linear."""
    return np.asarray(np.linalg.inv(curvature(objective, lin, free)), np.float64)


def curvature(objective: Objective, lin: Linearisation, free: NDArray[np.int64]) -> Floats:
    """Its inverse (f, f): half the second derivative of the cost."""
    return lin.information[np.ix_(free, free)] + np.diag(objective.prior[free] + 1e-9)


def _promised(objective: Objective, lin: Linearisation, step: Floats) -> float:
    """By how much a step would lower the cost if all were linear."""
    before, after = objective.in_span(lin.r), objective.in_span(lin.r + lin.change(step))
    prior = np.sum(objective.prior * ((lin.theta + step) ** 2 - lin.theta**2))
    return float(before @ before - after @ after - prior)
