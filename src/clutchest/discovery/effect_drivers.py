"""What drives an effect: the covariates that its terms read, and the error that stands for it.

Both are read off the equations themselves, so that they hold for a user's own effect too.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from clutchest.casadi_later import one_at_a_time
from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.residual_curves import places
from clutchest.inference.covariates import hats
from clutchest.inference.linearisation import Modulation
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation
from clutchest.models.declarations import ENERGY
from clutchest.models.effects import Effect
from clutchest.models.effects.effect import Gains
from clutchest.models.error_term_effects import PREFIX
from clutchest.models.model import POWER
from clutchest.signals import Floats

SAME = 1e-2  # of a derivative, squared: by how much an error that stands for an effect may differ
SMOOTH = 24  # knots of a curve that is to follow an effect over its driver
ENOUGH = 4000  # events that show whether it does
FUNCTION = 0.02  # of the largest change by an effect: what a function of its driver may be off by


class _Read:
    """Quantities of the equations as symbols of their own, made when they are read."""

    def __init__(self) -> None:
        self.symbols: dict[str, ca.SX] = {}

    def __getattr__(self, name: str) -> ca.SX:
        return self.symbols.setdefault(name, ca.SX.sym(name))


@one_at_a_time
def drivers_of(effect: Effect, gain: str, covariates: Collection[str]) -> tuple[str, ...]:
    """Of the ``covariates`` those that the effect's terms read beside the quantity that they
    change, where that depends on ``gain``; the energy where they read the power."""
    g = _symbols(effect)
    names: dict[str, None] = {}
    for quantity, term in effect.terms(g).items():
        read = _Read()
        by_gain = ca.jacobian(ca.SX(term(ca.SX.sym(quantity), read)), getattr(g, gain))
        names |= dict.fromkeys(n for n, s in read.symbols.items() if ca.depends_on(by_gain, s))
    known = [ENERGY if name == POWER else name for name in names]
    return tuple(name for name in known if name in covariates)


@dataclass(frozen=True, slots=True)
class Standin:
    """An error term that acts as a gain does: ``share`` of each drive (K), by how many of its units
    the error changes with one unit θ of the gain, at every event; NaN where it changes nothing.
    ``off`` (K): what the derivative by θ, made of the error, differs by from the effect's own:
    noise of inputs, which is no sign of another form."""

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
    own = fit.psi[:, cause.index]
    placed, size = places(problem), float(np.sum(own**2))
    for name, term in problem.compiled.machine.error_terms.items():
        if name not in placed or term.equation != cause.effect.equation or not term.changes:
            continue
        changes = _Changes(problem, fit, next(iter(term.changes)))
        error = PREFIX + name, "size"
        shares = changes.over((cause.name, cause.gain.key), error)
        made = _acting(objective, fit, placed[name], [shares])[:, 0] * problem.units[cause.index]
        if np.sum((made - own) ** 2) < SAME * size:
            scaled = [share * problem.units[cause.index] for share in shares]
            return Standin(name, tuple(scaled), made - own)
    return None


def by_shapes(objective: Objective, fit: Linearisation, cause: CandidateCause) -> Floats:
    """Derivatives (K, s) by the shapes of a cause at a fit, exactly: where a shape changes what the
    effect changes, it does as a share of what the gain does."""
    quantity = next(iter(cause.effect.terms(_symbols(cause.effect))), None)
    if quantity is None or not cause.shapes:
        return np.zeros((len(fit.r), 0))
    changes = _Changes(objective.problem, fit, quantity)
    gain = cause.name, cause.gain.key
    shares = [changes.over((cause.name, key), gain) for key, _ in cause.shapes]
    return _acting(objective, fit, cause.index, shares) / objective.problem.units[cause.index]


def _acting(
    objective: Objective, fit: Linearisation, theta: int, shares: Sequence[Sequence[Floats]]
) -> Floats:
    """Derivatives (K, c) by an unknown that acts in proportion to each of the ``shares`` (c), of
    every drive."""
    drives = zip(*shares, strict=True)
    columns = np.arange(len(shares))
    modulations = [Modulation(np.nan_to_num(np.column_stack(own)), columns) for own in drives]
    return objective.modulated(fit, np.full(len(shares), theta), modulations)


@dataclass(frozen=True, slots=True)
class _Changes:
    """How numbers of effects change a ``quantity`` of the equations at a ``fit``."""

    problem: Problem
    fit: Linearisation
    quantity: str

    @one_at_a_time
    def over(self, number: tuple[str, str], other: tuple[str, str]) -> list[Floats]:
        """Derivative of the quantity by one number over that by another, of an effect and a key
        each, at every event of each drive; NaN where the other changes nothing."""
        model = self.problem.compiled.model
        written = model.expressions()
        rows = {(effect.name, key): i for i, (effect, key) in enumerate(model.numbers)}
        by_numbers = ca.jacobian(getattr(written.quantities, self.quantity), written.g)
        wanted = ca.vertcat(by_numbers[0, rows[number]], by_numbers[0, rows[other]])
        shares = []
        for i, (drive, at) in enumerate(zip(self.problem.drives, self.fit.implied, strict=True)):
            numbers, line = self.problem.numbers(self.fit.theta, self.fit.shapes, i), drive.line
            own, unit = written.along(
                wanted, at.states, at.inputs, line.W[line.row], numbers.parameters, numbers.effects
            )
            acts = np.abs(unit) > 1e-9
            shares.append(np.where(acts, own / np.where(acts, unit, 1.0), np.nan))
        return shares


def _symbols(effect: Effect) -> Gains:
    return Gains({number.key: ca.SX.sym(number.key) for number in effect.parameters})
