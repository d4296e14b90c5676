"""The parameters that make equation errors least, each uncertain one within its prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.models.experiments import EquationErrors
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

STEP = 0.02  # of a prior's standard deviation, over which derivatives are taken
ITERATIONS, ENOUGH = 30, 1e-5  # of −2 ln(probability) that a step still promises
HALVINGS = 8


@dataclass(frozen=True, slots=True)
class BenchPosterior:
    """Most probable numbers: ``values`` of the parameters ``keys`` (n) with their joint
    ``covariance`` (n, n), in the parameters' units; ``own`` numbers of each record; ``scale`` of
    each: by how much its equation errors exceed the noise, at least 1."""

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

    @classmethod
    def of(
        cls, parts: Sequence[EquationErrors], vehicle: Vehicle, keys: Sequence[str]
    ) -> _Unknowns:
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
        )

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
) -> BenchPosterior:
    """The most probable parameters, those ``held`` excepted, given all equation errors.

    Where errors exceed their noise, the standard deviations grow with them if ``widened``.
    """
    keys = [k for k, p in vehicle.parameters.items() if p.spread > 0 and k not in held]
    unknowns = _Unknowns.of(parts, vehicle, keys)
    scale = np.ones(len(parts))
    first = _jacobian(parts, unknowns, np.zeros(len(unknowns.start)), scale)
    acting = [key for i, key in enumerate(keys) if np.any(first[:, i] != 0.0)]
    unknowns = _Unknowns.of(parts, vehicle, acting)
    theta = np.zeros(len(unknowns.start))
    theta = _least(parts, unknowns, theta, scale)
    if widened:
        left = _errors(parts, unknowns, theta, scale)
        scale = np.array([max(1.0, float(np.sqrt(np.mean(r**2)))) for r in left])
        theta = _least(parts, unknowns, theta, scale)
    psi = _jacobian(parts, unknowns, theta, scale)
    covariance = np.linalg.inv(psi.T @ psi + np.eye(len(theta)))
    n, (_, own) = len(acting), unknowns.numbers(theta)
    unit = unknowns.unit[:n]
    return BenchPosterior(
        tuple(acting),
        unknowns.start[:n] + unit * theta[:n],
        covariance[:n, :n] * np.outer(unit, unit),
        tuple(own),
        tuple(scale.tolist()),
        _cost(parts, unknowns, theta, scale),
    )


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
    """−2 ln(probability) up to a constant."""
    return float(np.sum(_stacked(parts, unknowns, theta, scale) ** 2) + np.sum(theta**2))


def _jacobian(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> Floats:
    """Derivatives of all errors by all numbers, by central differences."""
    columns = [np.zeros((len(_stacked(parts, unknowns, theta, scale)), 0))]
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = STEP
        ahead, behind = (_stacked(parts, unknowns, theta + s, scale) for s in (step, -step))
        columns.append((ahead - behind) / (2 * STEP))
    return np.column_stack(columns)


def _least(
    parts: Sequence[EquationErrors], unknowns: _Unknowns, theta: Floats, scale: Floats
) -> Floats:
    """Gauss–Newton with priors; a step that does not improve is halved."""
    cost = _cost(parts, unknowns, theta, scale)
    for _ in range(ITERATIONS):
        r, psi = _stacked(parts, unknowns, theta, scale), _jacobian(parts, unknowns, theta, scale)
        gradient = psi.T @ r + theta
        step = -np.linalg.solve(psi.T @ psi + np.eye(len(theta)), gradient)
        if -step @ gradient < ENOUGH:
            break
        for _ in range(HALVINGS):
            if (new := _cost(parts, unknowns, theta + step, scale)) < cost:
                theta, cost = theta + step, new
                break
            step = step / 2
        else:
            break
    return theta
