"""What a simulated drive may be asked for beside its scenario, and that it can be understood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, TypedDict, get_type_hints

from clutchest.checked import check
from clutchest.errors import ClutchestError, nearest
from clutchest.generator import Mismatch, Outsider

Effects = Mapping[str, Mapping[str, float]]


class Options(TypedDict, total=False):
    """``duration`` s, default the scenario's own; ``onset`` s, from which the effects act, of
    machines whose generator can begin them within a drive; ``nominal``: parameters as they stand in
    the vehicle file, not drawn from their spreads; ``truck_seed``: seed of the parameters, default
    that of the drive; ``disturbances``: name → size of what varies during the drive, see
    :class:`clutchest.generator.Disturbances`; ``noise_ar``: AR(1) coefficient of all noise instead
    of the file's; ``outliers``: share of samples that are outliers; ``outsider``: an unmodelled
    effect, see :class:`clutchest.generator.Outsider`; ``mismatch``: what sets a
    healthy machine apart from its model, see :class:`clutchest.generator.Mismatch`;
    ``effects_files``: a user's own effects, which ``effects`` may name beside the library's."""

    duration: float | None
    onset: float
    nominal: bool
    truck_seed: int | None
    disturbances: Mapping[str, float]
    noise_ar: float | None
    outliers: float
    outsider: Outsider | None
    mismatch: Mismatch
    effects_files: Sequence[str | Path]


def checked_options(options: Mapping[str, Any]) -> None:
    """Raises ClutchestError for an option that is none, or of another type."""
    known = get_type_hints(Options)
    for name, value in options.items():
        if name not in known:
            raise ClutchestError(f"simulate has no option '{name}'{nearest(name, known)}")
        check(name, value, known[name])


def checked_effects(effects: Effects) -> Effects:
    """The same.  Raises ClutchestError where they are not numbers by name."""
    if not isinstance(effects, Mapping):
        raise ClutchestError(
            f"effects: expected {{'wear': {{'amount': 0.5}}}}, not {type(effects).__name__}"
        )
    for name, values in effects.items():
        if not isinstance(values, Mapping) or not all(isinstance(v, Real) for v in values.values()):
            raise ClutchestError(f"effect '{name}': expected numbers by name, not {values!r}")
    return effects
