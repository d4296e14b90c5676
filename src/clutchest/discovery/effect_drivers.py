"""What drives an effect: the covariates that its terms read, and the error that stands for it.

Both are read off the equations themselves, so that they hold for a user's own effect too.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.covariates import hats
from clutchest.discovery.error_term_effects import PREFIX
from clutchest.discovery.residual_curves import places
from clutchest.inference.linearisation import Modulation
from clutchest.inference.objective import Linearisation, Objective
from clutchest.inference.problem import Problem
from clutchest.models.effects import Effect
from clutchest.models.effects.effect import Gains
from clutchest.models.machine import ENERGY
from clutchest.models.model import POWER
from clutchest.signals import Floats

SAME = 1e-2  # of a derivative, squared: by how much an error that stands for an effect may differ
EXACT = 1e-9  # the same: rounding
STEP = 0.01  # of a shape: of its derivative
SMOOTH = 24  # knots of a curve that is to follow an effect over its driver
ENOUGH = 4000  # events that show whether it does
FUNCTION = 0.02  # of the largest change by an effect: what a function of its driver may be off by


class _Read:
    """Quantities of the equations as symbols of their own, made when they are read."""

    def __init__(self) -> None:
        self.symbols: dict[str, ca.SX] = {}

    def __getattr__(self, name: str) -> ca.SX:
        return self.symbols.setdefault(name, ca.SX.sym(name))


def drivers_of(effect: Effect, gain: str, covariates: Collection[str]) -> tuple[str, ...]:
    """Of the ``covariates`` those on which a change by ``gain`` depends: what the effect's terms
    read beside the quantity that they change, and the energy where they read the power; that
    quantity itself where they read nothing else."""
    g = Gains({number.key: ca.SX.sym(number.key) for number in effect.parameters})
    names: dict[str, None] = {}
    for quantity, term in effect.terms(g).items():
        read, value = _Read(), ca.SX.sym(quantity)
        by_gain = ca.jacobian(ca.SX(term(value, read)), getattr(g, gain))
        used = [n for n, s in read.symbols.items() if ca.depends_on(by_gain, s)]
        changed = not used and bool(ca.symvar(by_gain))
        names |= dict.fromkeys([quantity] if changed else used)
    known = [ENERGY if name == POWER else name for name in names]
    return tuple(name for name in known if name in covariates)


@dataclass(frozen=True, slots=True)
class Standin:
    """An error term that acts as a gain does: ``share`` of each drive (K), by how many of its units
    the error changes with one unit θ of the gain, at every event; NaN where it changes nothing.
    ``off`` (K, c): what the derivatives by gain and shapes, made of the error, differ by from the
    effect's own: noise of inputs, which is no sign of another form."""

    term: str
    share: tuple[Floats, ...]
    off: Floats

    def over(self, driver: Sequence[Floats], act: Sequence[Floats], at: Floats) -> Floats | None:
        """The share at values ``at`` (n) of a ``driver`` (of each drive, K); None where it is no
        function of it.  ``act`` (of each drive, K): events that count."""
        share, value, weight = (np.concatenate(each) for each in (self.share, driver, act))
        inside = np.flatnonzero((weight > 0.0) & np.isfinite(share))
        inside = inside[:: max(len(inside) // ENOUGH, 1)]
        if not len(inside) or not (largest := np.abs(share[inside]).max()):
            return None
        edges = np.unique(np.quantile(value[inside], np.linspace(0.0, 1.0, SMOOTH)))
        if len(edges) < 3:
            return None
        basis = hats(value[inside], edges)
        heights = np.linalg.lstsq(basis, share[inside], rcond=None)[0]
        off = np.sqrt(np.mean((basis @ heights - share[inside]) ** 2))
        return np.asarray(hats(at, edges) @ heights) if off < FUNCTION * largest else None


def standin(objective: Objective, fit: Linearisation, cause: CandidateCause) -> Standin | None:
    """The error term of the cause's own equation that acts as its gain does at a fit; None where
    there is none."""
    problem = objective.problem
    terms = problem.compiled.machine.error_terms
    own = fit.psi[:, cause.index]
    placed = places(problem)
    for name, term in terms.items():
        if name not in placed or term.equation != cause.effect.equation or not term.changes:
            continue
        shares = _shares(problem, fit, cause, name, next(iter(term.changes)))
        modulations = [Modulation(np.nan_to_num(s)[:, None], np.zeros(1, np.int64)) for s in shares]
        made = objective.modulated(fit, np.array([placed[name]]), modulations)[:, 0]
        if np.sum((made - own) ** 2) < SAME * np.sum(own**2):
            off = [made - own] if np.sum((made - own) ** 2) > EXACT * np.sum(own**2) else []
            off += _by_shapes(objective, fit, cause, name, next(iter(term.changes)))
            return Standin(name, tuple(shares), np.array(off).reshape(len(off), len(own)).T)
    return None


def _by_shapes(
    objective: Objective, fit: Linearisation, cause: CandidateCause, term: str, quantity: str
) -> list[Floats]:
    """Derivatives (K) by relative changes of each shape of a cause, made of an error term."""
    place, made = places(objective.problem)[term], list[Floats]()
    for key, value in cause.shapes:
        step = STEP * max(abs(value), STEP)
        sides = [
            _shares(
                objective.problem,
                replace(fit, shapes={**fit.shapes, (cause.name, key): value + by}),
                cause,
                term,
                quantity,
            )
            for by in (step, -step)
        ]
        modulations = [
            Modulation(np.nan_to_num(up - down)[:, None] / (2.0 * STEP), np.zeros(1, np.int64))
            for up, down in zip(*sides, strict=True)
        ]
        made.append(objective.modulated(fit, np.array([place]), modulations)[:, 0])
    return made


def _shares(
    problem: Problem, fit: Linearisation, cause: CandidateCause, term: str, quantity: str
) -> list[Floats]:
    """By how many units of an error term a ``quantity`` changes with one unit θ of a gain, at every
    event (K) of each drive; NaN where the error changes nothing."""
    model = problem.compiled.model
    written = model.expressions()
    rows = {(effect.name, key): i for i, (effect, key) in enumerate(model.numbers)}
    both = [rows[cause.name, cause.gain.key], rows[PREFIX + term, "size"]]
    by_numbers = ca.jacobian(getattr(written.quantities, quantity), written.g)
    wanted = ca.vertcat(*(by_numbers[0, row] for row in both))
    shares = []
    for i, (drive, at) in enumerate(zip(problem.drives, fit.implied, strict=True)):
        numbers, line = problem.numbers(fit.theta, fit.shapes, i), drive.line
        own, error = written.along(
            wanted, at.states, at.inputs, line.W[line.row], numbers.parameters, numbers.effects
        )
        acts = np.abs(error) > 1e-9
        shares.append(np.where(acts, own / np.where(acts, error, 1.0), np.nan))
    return [share * problem.units[cause.index] for share in shares]
