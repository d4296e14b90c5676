"""What a clutch brings to the tests that all clutches share: one file each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

Ranges = Mapping[str, tuple[float, float]]


Drive = Callable[[Vehicle, float, float], Signals]  # duration s, share of the sensors' noise


@dataclass(frozen=True)
class Plausible:
    """Where a model must make sense: (lower, upper) by state, input and regime flag.

    ``temperatures`` are the states that relax, ``surroundings`` the inputs they relax to,
    ``beyond`` further surroundings, °C, that an effect brings, and ``resting`` the values at which
    nothing slips and no power goes in.  ``warm`` are start values, by state, at which a drive
    excites every effect.  ``wound`` are states that are springs, each with the input that winds
    it: one that was wound the other way gives back what it took, and brakes only afterwards.
    """

    states: Ranges
    inputs: Ranges
    temperatures: tuple[str, ...]
    surroundings: tuple[str, ...]
    resting: Mapping[str, float]
    warm: Mapping[str, float]
    beyond: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    wound: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Setup:
    """A vehicle of one model by name or path, a ``drive`` of ``duration`` s by hand, the
    ``modes`` it goes through, and where the model is ``plausible``.

    ``catalogue``: the effects with their parameters and units as every user of the library knows
    them, one-sided ones with a (+).
    """

    vehicle: str | Path
    drive: Drive
    duration: float
    modes: tuple[str, ...]
    plausible: Plausible
    catalogue: Mapping[str, str]
