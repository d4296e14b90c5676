"""What the data of one drive could tell at best: distances in standard deviations.

The generator alone is asked.  A drive's exact readings are replayed open loop, by a truck with the
drive's own numbers and by trucks of others: inputs are what sensors showed, since whoever reads the
log sees what driver and control unit did, whatever made them do it.  The differences of whole
drives, made white by the noise that the sensors are stated to have, are the derivatives of
generalised least squares.  Everything that is not known may explain a cause away: the truck's
numbers at the price of their priors, and other effects of the library free of charge within their
plausible sizes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from types import MappingProxyType

import numpy as np
from scipy.optimize import lsq_linear

from blind.drives import Drive
from blind.outsiders import Outsider
from blind.seen import Seen, Truck
from clutchest.generator import EFFECTS
from clutchest.generator.replay import record
from clutchest.models import machine_of
from clutchest.models.effects import Effect, Number
from clutchest.signals import Floats
from clutchest.simulated import Effects

Shapes = Mapping[tuple[str, str], float]  # (effect, key of a shape) → value
NOMINAL: Shapes = MappingProxyType({})
STEPS, SETTLED = 40, 0.05  # of a fit: at most so many, until so little is promised
DAMPED = 1e-3  # least damping of a step, once one has failed
KEPT = 0.1  # of what a step promises, what may be lacking before derivatives count as stale
NUDGE = 1e-6  # of a largest plausible size, for derivatives
CLOSE, NEAREST = 5.0, 3  # d′; rivals nearer than this by first order are fitted in full, and so
# many of the nearest in any case: far from what is hidden, a first order makes them seem further


@dataclass(frozen=True)
class Fit:
    """The most probable numbers: nuisances ``z`` (m) in standard deviations, ``gains`` (k) in
    largest plausible sizes; ``cost``: −2 ln(probability), 0 at best."""

    z: Floats
    gains: Floats
    cost: float

    @property
    def distance(self) -> float:
        """In standard deviations."""
        return float(np.sqrt(max(self.cost, 0.0)))


class Oracle:
    """Of one drive; ``scenario``: of another one by the same truck."""

    def __init__(self, drive: Drive, scenario: str | None = None) -> None:
        self.drive, self.scenario = drive, scenario
        library = machine_of(drive.vehicle.model).effects
        self.effects = {name: effect for name, effect in library.items() if name in EFFECTS}
        shown, own = record(drive.request(scenario=scenario))
        self.truck = Truck.of(drive, own)
        self.clean = Seen(drive, self.truck, shown, own)

    def twin(self, effects: Effects | None = None, outsider: Outsider | None = None) -> Seen:
        """The drive with a cause in it and no noise: driver and control unit react to it."""
        shown, own = record(self.drive.request(effects, outsider, scenario=self.scenario))
        return Seen(self.drive, self.truck, shown, own)

    # --- distances ---------------------------------------------------------------------------

    def distance(self, twin: Seen, causes: Sequence[str] = (), shapes: Shapes = NOMINAL) -> float:
        """d′ of a twin from the nearest sizes of the effects ``causes`` acting together in these
        ``shapes``; from the model without a cause where there are none."""
        begin = self._fit(twin)
        if not causes:
            return begin.distance
        # from where the drive began, and from the numbers that come nearest without a cause
        return min(self._fit(twin, causes, shapes, z).distance for z in (None, begin.z))

    def nearest(
        self, twin: Seen, beside: Sequence[str] = (), *, whole: bool = True
    ) -> dict[str, float]:
        """d′ of a twin from every effect of the library acting with ``beside``, in the shape that
        comes closest: name → distance.  Far ones to first order, and every choice of a shape; all
        of them unless the ``whole`` is asked for."""
        base = self._fit(twin, beside)
        own = self._derivatives(twin, base, beside, NOMINAL)[0]
        begins = (base, own), (replace(base, z=twin.nought), twin.nuisances)
        found: dict[str, tuple[float, Shapes, Floats]] = {}
        told: dict[str, float] = {}
        for name, shapes in self._grid():
            if name in beside:
                continue
            for at, by in begins:
                d = self._first_order(twin, at, by, (name, *beside), shapes)
                if at is base:
                    told[name] = min(told.get(name, d), d)
                tried = d, shapes, at.z
                found[name] = min(found.get(name, tried), tried, key=itemgetter(0))
        for i, name in enumerate(sorted(found, key=lambda name: found[name][0])):
            distance, shapes, begin = found[name]
            if whole and (i < NEAREST or distance < CLOSE):
                fit = self._fit(twin, (name, *beside), shapes, begin)
                told[name] = min(told[name], fit.distance)
        return told

    def per_largest(self, gain: str, beside: str | None = None, shapes: Shapes = NOMINAL) -> float:
        """d′ of the gain ``effect.key`` at its largest plausible size, to first order; with every
        gain of the effect ``beside`` free."""
        name, key = gain.split(".")
        causes = (name, beside) if beside else (name,)
        numbers = self._gains(causes)
        columns = self._columns(self.clean, causes, shapes)
        index = next(i for i, (n, number) in enumerate(numbers) if (n, number.key) == (name, key))
        others = [i for i, (n, _) in enumerate(numbers) if n == beside]
        return self._left(columns[:, index], columns[:, others])

    def excited(self) -> dict[str, float]:
        """``effect.gain`` → d′ at its largest plausible size, in the shape that shows most."""
        most: dict[str, float] = {}
        for name, shapes in self._grid():
            columns = self._columns(self.clean, (name,), shapes)
            for (_, number), column in zip(self._gains((name,)), columns.T, strict=True):
                gain = f"{name}.{number.key}"
                most[gain] = max(most.get(gain, 0.0), self._left(column, columns[:, :0]))
        return most

    def _left(self, column: Floats, free: Floats) -> float:
        """What of a derivative (K,) no nuisance and none of the ``free`` ones (K, k) explains."""
        own = np.column_stack([self.clean.nuisances, free])
        prior = np.r_[np.ones(len(self.clean.nought)), np.full(free.shape[1], 1e-9)]
        across = own.T @ column
        left = column @ column - across @ np.linalg.solve(own.T @ own + np.diag(prior), across)
        return float(np.sqrt(max(left, 0.0)))

    # --- fits --------------------------------------------------------------------------------

    def _grid(self) -> list[tuple[str, Shapes]]:
        """Every effect in every shape that a search tries."""
        return [
            (name, shapes)
            for name, effect in self.effects.items()
            for shapes in (NOMINAL, *grid(effect))
        ]

    def _gains(self, causes: Sequence[str]) -> list[tuple[str, Number]]:
        return [(name, number) for name in causes for number in self.effects[name].gains]

    def _acting(self, causes: Sequence[str], gains: Floats, shapes: Shapes) -> Effects:
        """These effects at ``gains`` of their largest plausible sizes."""
        acting: dict[str, dict[str, float]] = {
            name: {
                n.key: shapes.get((name, n.key), n.default)
                for n in self.effects[name].parameters
                if n.shape
            }
            for name in causes
        }
        for (name, number), gain in zip(self._gains(causes), gains, strict=True):
            acting[name][number.key] = float(gain) * number.upper
        return acting

    def _columns(
        self, seen: Seen, causes: Sequence[str], shapes: Shapes, at: Fit | None = None
    ) -> Floats:
        """Derivatives (K, k) of a drive's white misfit by the gains of ``causes``."""
        count = len(self._gains(causes))
        z, gains = (seen.nought, np.zeros(count)) if at is None else (at.z, at.gains)
        tried = []
        for i, one in enumerate(np.eye(count)):
            step = NUDGE if gains[i] + NUDGE <= 1.0 else -NUDGE
            tried.append((self._acting(causes, gains + step * one, shapes), step))
        return seen.by_effects(tried, z, self._acting(causes, gains, shapes))

    def _first_order(
        self, seen: Seen, base: Fit, own: Floats, causes: Sequence[str], shapes: Shapes
    ) -> float:
        """The distance that derivatives at ``base`` promise, those by nuisances being ``own``."""
        gains = np.r_[np.zeros(len(self._gains(causes)) - len(base.gains)), base.gains]
        fit = Fit(base.z, gains, base.cost)
        r = self._residual(seen, fit, causes, shapes)
        columns = self._columns(seen, causes, shapes, fit)
        return _step(own, r, fit, columns, self._lowest(causes)).distance

    def _residual(self, seen: Seen, fit: Fit, causes: Sequence[str], shapes: Shapes) -> Floats:
        raw = seen.misfit(fit.z, self._acting(causes, fit.gains, shapes))
        return seen.white(raw[:, None])[:, 0]

    def _fit(
        self,
        seen: Seen,
        causes: Sequence[str] = (),
        shapes: Shapes = NOMINAL,
        begin: Floats | None = None,
    ) -> Fit:
        """The most probable numbers with the gains of ``causes`` free: Levenberg–Marquardt from
        where the drive began, or from ``begin`` (m), every cost that of a whole replay; derivatives
        follow by Broyden's rule while they serve."""
        lowest, damping, fresh = self._lowest(causes), 0.0, True
        fit = Fit(seen.begun if begin is None else begin, np.zeros(len(lowest)), 0.0)
        r = self._residual(seen, fit, causes, shapes)
        fit = replace(fit, cost=float(r @ r + fit.z @ fit.z))
        own, columns = self._derivatives(seen, fit, causes, shapes)
        for _ in range(STEPS):
            promised = _step(own, r, fit, columns, lowest, damping)
            if fit.cost - promised.cost < SETTLED:
                if fresh:
                    break
                (own, columns), fresh = self._derivatives(seen, fit, causes, shapes), True
                continue
            tried_r = self._residual(seen, promised, causes, shapes)
            tried = replace(promised, cost=float(tried_r @ tried_r + promised.z @ promised.z))
            z, gains = tried.z - fit.z, tried.gains - fit.gains
            lacks = (tried_r - r - own @ z - columns @ gains) / (z @ z + gains @ gains)
            if tried.cost < fit.cost:
                good = tried.cost - promised.cost < KEPT * (fit.cost - promised.cost)
                own, columns = own + np.outer(lacks, z), columns + np.outer(lacks, gains)
                fit, r, damping, fresh = tried, tried_r, 0.2 * damping, fresh and good
            elif not fresh:
                (own, columns), fresh = self._derivatives(seen, fit, causes, shapes), True
            else:
                damping = max(4.0 * damping, DAMPED)
        return fit

    def _derivatives(
        self, seen: Seen, fit: Fit, causes: Sequence[str], shapes: Shapes
    ) -> tuple[Floats, Floats]:
        """By nuisances (K, m) and by gains (K, k)."""
        if not (fit.z.any() or fit.gains.any()):
            return seen.nuisances, self._columns(seen, causes, shapes, fit)
        own = seen.by_nuisances(fit.z, self._acting(causes, fit.gains, shapes))
        return own, self._columns(seen, causes, shapes, fit)

    def _lowest(self, causes: Sequence[str]) -> Floats:
        """The least plausible gains, in largest plausible ones."""
        return np.array([number.lower / number.upper for _, number in self._gains(causes)])


def _step(
    own: Floats, r: Floats, fit: Fit, columns: Floats, lowest: Floats, damping: float = 0.0
) -> Fit:
    """Where the cost is least that is linearised by derivatives by nuisances, ``own`` (K, m), and
    gains, ``columns`` (K, k), gains within their plausible sizes; on the way there by as much as
    the ``damping`` allows."""
    whole = np.column_stack([columns, r])
    curvature, across = own.T @ own + np.eye(own.shape[1]), own.T @ whole
    across[:, -1] += fit.z
    damped = curvature + damping * np.diag(np.diag(curvature))
    answer = np.linalg.solve(damped, across)
    full = whole.T @ whole
    inner = full - across.T @ answer
    a, b = inner[:-1, :-1] + damping * np.diag(np.diag(full)[:-1]), inner[:-1, -1]
    gains = _within(a, b, lowest - fit.gains, 1.0 - fit.gains)
    z = -answer[:, -1] - answer[:, :-1] @ gains
    moved, ahead = r + own @ z + columns @ gains, fit.z + z
    return Fit(ahead, fit.gains + gains, float(moved @ moved + ahead @ ahead))


def _within(a: Floats, b: Floats, low: Floats, high: Floats) -> Floats:
    """g between ``low`` and ``high`` that minimises gᵀ a g + 2 gᵀ b."""
    if not len(b):
        return np.zeros(0)
    values, vectors = np.linalg.eigh(a)
    root = np.sqrt(np.maximum(values, 1e-9 * max(values[-1], 1e-9)))
    target = -(vectors.T @ b) / root
    return np.asarray(lsq_linear(root[:, None] * vectors.T, target, (low, high + 1e-12)).x)


def grid(effect: Effect) -> list[dict[tuple[str, str], float]]:
    """The shapes that a search would try, one at a time."""
    return [
        {(effect.name, number.key): value}
        for number in effect.parameters
        if number.shape
        for value in number.grid
    ]
