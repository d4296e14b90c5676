"""An error of one equation as a curve over one covariate: data, as a vehicle file states it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clutchest.signals import Floats

KIND = "curve"  # the effect; several in one file are ``curve_1``, ``curve_2``, …
SIZE, DEVIATION = "size", "deviation"  # numbers of the effect
NEGLIGIBLE = 5e-7  # of an error's unit: a standard deviation that is none
ROUNDING = 1e-5  # of the largest standard deviation: what the rounding of a covariance makes

Numbers = Mapping[str, Mapping[str, float]]  # effect → number → value


@dataclass(frozen=True, slots=True)
class ErrorCurve:
    """The ``error_term`` takes ``values`` (c), in its units, at ``knots`` (c) of the ``covariate``:
    linear between knots, constant outside.

    ``covariance`` (c, c) of the values, in squared units; without one they are exact.
    """

    error_term: str
    covariate: str
    knots: tuple[float, ...]
    values: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...] = ()

    @property
    def deviations(self) -> Floats:
        """Principal deviations (d, c) of the values, each of one standard deviation."""
        if not self.covariance:
            return np.zeros((0, len(self.values)))
        variance, directions = np.linalg.eigh(np.array(self.covariance))
        std = np.sqrt(np.maximum(variance, 0.0))
        kept = std > max(NEGLIGIBLE, ROUNDING * std.max())
        return std[kept, None] * directions.T[kept]

    def shifted(self, by: Floats, std: Floats) -> ErrorCurve:
        """The same with each deviation (d) shifted ``by`` so many standard deviations, and known
        to ``std`` (d) of them."""
        moved = np.array(self.values) + by @ self.deviations
        scaled = std[:, None] * self.deviations
        return replace(self, values=rounded(moved), covariance=matrix(scaled.T @ scaled))


def rounded(values: Floats) -> tuple[float, ...]:
    """Values to six decimals."""
    return tuple(float(np.round(v, 6)) for v in values)


def matrix(covariance: Floats) -> tuple[tuple[float, ...], ...]:
    """A covariance to twelve digits."""
    return tuple(tuple(float(f"{v:.12g}") for v in row) for row in covariance)


def effect_of_deviation(name: str, k: int) -> str:
    """The effect that is the ``k``-th deviation of a curve of a signal's delay."""
    return f"{name}, deviation {k}"


def numbers_of(name: str, curve: ErrorCurve, timing: bool) -> tuple[Numbers, Numbers]:
    """Numbers of the effects that the curve ``name`` puts into the model, and their standard
    deviations: of an equation one effect, of a signal's delay (``timing``) one per deviation."""
    count = range(1, len(curve.deviations) + 1)
    if timing:
        others = [effect_of_deviation(name, k) for k in count]
        values = {name: {SIZE: 1.0}} | {each: {SIZE: 0.0} for each in others}
        return values, {each: {SIZE: 1.0} for each in others}
    keys = [f"{DEVIATION}_{k}" for k in count]
    spreads = {name: dict.fromkeys(keys, 1.0)} if keys else {}
    return {name: {SIZE: 1.0} | dict.fromkeys(keys, 0.0)}, spreads


def is_curve(name: str) -> bool:
    """Whether an entry of a vehicle file's ``[effects]`` states a curve, by its name."""
    return name == KIND or name.startswith(f"{KIND}_")


def free_name(taken: Sequence[str]) -> str:
    """The first of ``curve_1``, ``curve_2``, … that is not taken."""
    names = (f"{KIND}_{k}" for k in range(1, len(taken) + 2))
    return next(name for name in names if name not in taken)
