"""Residuals of a model as a discovery gives them back."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import NDArray

from clutchest.signals import Floats


@dataclass(frozen=True, slots=True)
class Bins:
    """Mean residual of one sensor in one mode over one covariate, in standard deviations.

    ``edges`` (b + 1), ``mean`` (b) with its standard error ``error`` (b), ``count`` (b);
    ``after`` (b) and ``after_error`` (b): the same residuals in the extended model.
    """

    sensor: str
    mode: str
    covariate: str
    edges: Floats
    mean: Floats
    error: Floats
    count: NDArray
    after: Floats
    after_error: Floats


@dataclass(frozen=True, slots=True)
class Level:
    """Of one sensor in one mode: mean square of the whitened innovations (1 if the model is
    right), their autocorrelation at lag 1, and how many."""

    sensor: str
    mode: str
    level: float
    lag: float
    count: int


@dataclass(frozen=True, slots=True)
class Misfit:
    """Residuals of the model.

    Per drive: ``time`` (K) s, ``sensor`` (K) index into ``sensors``; ``before`` and ``after`` (K),
    innovations over their standard deviation in the original and the extended model.  ``torque``:
    (time s, measured, simulated, extended) clutch torque in Nm while the clutch slips, the last
    two open loop.
    """

    sensors: tuple[str, ...]
    time: tuple[Floats, ...]
    sensor: tuple[NDArray, ...]
    before: tuple[Floats, ...]
    after: tuple[Floats, ...]
    torque: tuple[tuple[Floats, Floats, Floats, Floats], ...]
    bins: tuple[Bins, ...]
    levels: tuple[Level, ...]
