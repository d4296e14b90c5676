"""The parameters by equation errors, each uncertain one within its prior: those that make the
errors least, and from there their mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from clutchest.identify.posterior_mean import ErrorBlock, mean_less_mode
from clutchest.models.experiments import EquationErrors
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

STEP = 0.02  # of a prior's standard deviation, over which derivatives are taken
ITERATIONS, ENOUGH = 30, 1e-5  # of −2 ln(probability) that a step still promises
HALVINGS = 8
FARTHEST = 1.0  # of a prior's standard deviation that a step goes: beyond, errors are not linear


@dataclass(frozen=True, slots=True)
class BenchPosterior:
    """Mean numbers, or the most probable ones: ``values`` of the parameters ``keys`` (n) with their
    joint ``covariance`` (n, n), in the parameters' units; ``own`` numbers of each record; ``scale``
    of each: by how much its equation errors exceed the noise, at least 1; ``cost`` at the most
    probable ones: −2 ln(probability) up to a constant."""

    keys: tuple[str, ...]
    values: Floats
    covariance: Floats
    own: tuple[Floats, ...]
    scale: tuple[float, ...]
    cost: float

    def of(self, key: str) -> tuple[float, float] | None:
        """Value and standard deviation of a parameter; None where it plays no part."""
        if key not in self.keys:
            return None
        i = self.keys.index(key)
        return float(self.values[i]), float(np.sqrt(self.covariance[i, i]))

    def parameters(self, vehicle: Vehicle) -> dict[str, float]:
        """All parameters of the vehicle, these in place of the file's."""
        every = {key: p.value for key, p in vehicle.parameters.items()}
        return every | dict(zip(self.keys, map(float, self.values), strict=True))


@dataclass(frozen=True, slots=True)
class _Unknowns:
    """What is fitted: parameters ``keys`` with value and standard deviation, then own numbers of
    every record."""

    keys: tuple[str, ...]
    base: Mapping[str, float]
    start: Floats
    unit: Floats
    low: Floats
    high: Floats
    counts: tuple[int, ...]
    acting: tuple[tuple[int, ...], ...]

    @classmethod
    def prior(
        cls, parts: Sequence[EquationErrors], vehicle: Vehicle, keys: Sequence[str]
    ) -> _Unknowns:
        """Those of the file, every parameter acting on every record."""
        own = np.concatenate([np.zeros((0, 2)), *(part.own for part in parts)])
        bounds = {p.key: (p.lower, p.upper) for p in vehicle.machine.parameters}
        known = [vehicle.parameters[key] for key in keys]
        limits = np.array([bounds[key] for key in keys]).reshape(-1, 2)
        endless = np.full(len(own), np.inf)
        return cls(
            tuple(keys),
            {key: p.value for key, p in vehicle.parameters.items()},
            np.concatenate([[p.value for p in known], own[:, 0]]),
            np.concatenate([[p.spread for p in known], own[:, 1]]),
            np.concatenate([limits[:, 0], -endless]),
            np.concatenate([limits[:, 1], endless]),
            tuple(len(part.own) for part in parts),
            (tuple(range(len(keys))),) * len(parts),
        )

    def of(self, part: EquationErrors, index: int, theta: Floats) -> Floats:
        """The equation errors of one record at ``theta``."""
        parameters, own = self.numbers(theta)
        return part.errors(parameters, own[index])

    def numbers(self, theta: Floats) -> tuple[dict[str, float], list[Floats]]:
        """Parameters and own numbers of each record at ``theta``, in units of the priors."""
        values = np.clip(self.start + self.unit * theta, self.low, self.high)
        n = len(self.keys)
        own = np.split(values[n:], np.cumsum(self.counts)[:-1]) if self.counts else []
        return {**self.base, **dict(zip(self.keys, values[:n].tolist(), strict=True))}, own


def fit_errors(
    parts: Sequence[EquationErrors],
    vehicle: Vehicle,
    held: Sequence[str] = (),
    widened: bool = True,
    mean: bool = True,
) -> BenchPosterior:
    """The parameters, those ``held`` excepted, given all equation errors: their ``mean``, else the
    most probable ones.

    Where errors exceed their noise, the standard deviations grow with them if ``widened``.
    """
    keys = [k for k, p in vehicle.parameters.items() if p.spread > 0 and k not in held]
    unknowns, scale = _acting(parts, vehicle, keys), np.ones(len(parts))
    acting, theta = unknowns.keys, np.zeros(len(unknowns.start))
    theta = _least(parts, unknowns, theta, scale)
    if widened:
        left = _errors(parts, unknowns, theta, scale)
        scale = np.array([max(1.0, float(np.sqrt(np.mean(r**2)))) for r in left])
        theta = _least(parts, unknowns, theta, scale)
    psi = _jacobian(parts, unknowns, theta, scale)
    covariance = np.asarray(np.linalg.inv(psi.T @ psi + np.eye(len(theta))), np.float64)
    cost, n = _cost(parts, unknowns, theta, scale), len(acting)
    if mean:
        blocks = _blocks(parts, unknowns, theta, scale, psi)
        theta = theta + mean_less_mode(blocks, covariance)
    numbers, own = unknowns.numbers(theta)
    unit = unknowns.unit[:n]
    return BenchPosterior(
        acting,
        np.array([numbers[key] for key in acting]),
        covariance[:n, :n] * np.outer(unit, unit),
        tuple(own),
        tuple(scale.tolist()),
        cost,
    )


def _blocks(
    parts: Sequence[EquationErrors],
    unknowns: _Unknowns,
    theta: Floats,
    scale: Floats,
    psi: Floats,
) -> list[ErrorBlock]:
    """The errors of every record about ``theta``, with their rows of ``psi``."""
    blocks, first, row = [], len(unknowns.keys), 0
    for i, (part, s) in enumerate(zip(parts, scale, strict=True)):
        errors = partial(_stepped, part, i, unknowns, theta, float(s))
        rows = slice(row, row + len(errors(np.zeros(len(theta)))))
        acting = (*unknowns.acting[i], *range(first, first + unknowns.counts[i]))
        blocks.append(ErrorBlock(errors, acting, psi[rows]))
        first, row = first + unknowns.counts[i], rows.stop
    return blocks


def _stepped(
    part: EquationErrors, index: int, unknowns: _Unknowns, theta: Floats, scale: float, step: Floats
) -> Floats:
    return unknowns.of(part, index, theta + step) / scale


def _acting(parts: Sequence[EquationErrors], vehicle: Vehicle, keys: Sequence[str]) -> _Unknowns:
    """The parameters that act on any record, and on which."""
    every = _Unknowns.prior(parts, vehicle, keys)
    psi = _jacobian(parts, every, np.zeros(len(every.start)), np.ones(len(parts)))
    rows = np.cumsum([len(part.errors(every.base, part.own[:, 0])) for part in parts])[:-1]
    moves = [np.any(block[:, : len(keys)] != 0.0, axis=0) for block in np.split(psi, rows)]
    kept = np.flatnonzero(np.any([np.zeros(len(keys), bool), *moves], axis=0))
    found = _Unknowns.prior(parts, vehicle, [keys[int(k)] for k in kept])
    return replace(found, acting=tuple(tuple(np.flatnonzero(of[kept])) for of in moves))


def _errors(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> list[Floats]:
    parameters, own = unknowns.numbers(theta)
    return [part.errors(parameters, of) / s for part, of, s in zip(parts, own, scale, strict=True)]


def _stacked(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> Floats:
    return np.concatenate([np.zeros(0), *_errors(parts, unknowns, theta, scale)])


def _cost(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> float:
    """−2 ln(probability) up to a constant; infinite where a step goes too far."""
    with np.errstate(over="ignore"):
        return float(np.sum(_stacked(parts, unknowns, theta, scale) ** 2) + np.sum(theta**2))


def _jacobian(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> Floats:
    """Derivatives of all errors by all numbers, by central differences, of each record by those
    that act on it."""
    first, blocks = len(unknowns.keys), []
    for i, (part, s) in enumerate(zip(parts, scale, strict=True)):
        acts = [*unknowns.acting[i], *range(first, first + unknowns.counts[i])]
        first += unknowns.counts[i]
        block = np.zeros((len(unknowns.of(part, i, theta)), len(theta)))
        for k in acts:
            step = np.zeros(len(theta))
            step[k] = STEP
            ahead, behind = (unknowns.of(part, i, theta + way) for way in (step, -step))
            block[:, k] = (ahead - behind) / (2 * STEP * s)
        blocks.append(block)
    return np.concatenate([np.zeros((0, len(theta))), *blocks])


def _least(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> Floats:
    """Gauss–Newton with priors; a step that does not improve is halved, and none is so long that
    it ends in a minimum far from what was known, which a long first step may improve into."""
    cost = _cost(parts, unknowns, theta, scale)
    for _ in range(ITERATIONS):
        r, psi = _stacked(parts, unknowns, theta, scale), _jacobian(parts, unknowns, theta, scale)
        gradient = psi.T @ r + theta
        step = -np.linalg.solve(psi.T @ psi + np.eye(len(theta)), gradient)
        if -step @ gradient < ENOUGH:
            break
        step *= min(1.0, FARTHEST / float(np.abs(step).max()))
        for _ in range(HALVINGS):
            if (new := _cost(parts, unknowns, theta + step, scale)) < cost:
                theta, cost = theta + step, new
                break
            step = step / 2
        else:
            break
    return theta
