"""What the equations of a healthy vehicle may be off by: ``[healthy]``, gains of effects, and
``[smooth_errors.torque]``, a covariate, how far off and over which length."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clutchest.models.declarations import ENERGY
from clutchest.models.effects.effect import TIME
from clutchest.vehicle.toml import Keys, TomlFile
from clutchest.vehicle.vehicle import HealthyGain, SmoothError

if TYPE_CHECKING:
    from clutchest.models.machine import Machine

HEALTHY, SECTION = "healthy", "smooth_errors"
SHORTEST = 1e-9  # unit of the covariate


def read_healthy_gains(file: TomlFile, machine: Machine) -> tuple[HealthyGain, ...]:
    """How far effects go in a healthy vehicle, those of unmodelled parts as far as the machine says
    unless the file does.  Raises ClutchestError with file and line."""
    table = file.table((HEALTHY,), file.data.get(HEALTHY, {}))
    effects = {**machine.effects, **machine.unmodelled}
    file.known((HEALTHY,), table, effects, "effect")
    gains = []
    for effect, value in table.items():
        stated = file.table((HEALTHY, effect), value)
        keys = [number.key for number in effects[effect].gains]
        file.known((HEALTHY, effect), stated, keys, f"gain of '{effect}'")
        for key, std in stated.items():
            gains.append(HealthyGain(effect, key, file.number((HEALTHY, effect, key), std, 0.0)))
    known = {gain.gain for gain in gains}
    usual = (
        HealthyGain(name, number.key, number.healthy)
        for name, effect in machine.unmodelled.items()
        for number in effect.gains
    )
    return (*gains, *(gain for gain in usual if gain.gain not in known))


def read_smooth_errors(file: TomlFile, machine: Machine) -> tuple[SmoothError, ...]:
    """What the equations of a healthy machine may be off by.  Raises ClutchestError with file and
    line."""
    table = file.table((SECTION,), file.data.get(SECTION, {}))
    terms = [name for name, term in machine.error_terms.items() if term.late is None]
    file.known((SECTION,), table, terms, "error term")
    covariates = {
        *machine.units,
        *(state.name for state in machine.states),
        *machine.covariates,
        *machine.smooth_over,
        *machine.made_covariates,
        ENERGY,
        TIME,
    }
    errors = []
    for term, value in table.items():
        over = file.table((SECTION, term), value)
        file.known((SECTION, term), over, covariates, "covariate")
        for name, entry in over.items():
            errors.append(_error(file, (SECTION, term, name), entry))
    return tuple(errors)


def _error(file: TomlFile, at: Keys, value: Any) -> SmoothError:
    entry = file.table(at, value)
    file.known(at, entry, ("std", "length"), "key of a smooth error")
    for key in ("std", "length"):
        if key not in entry:
            raise file.error(at, f"{'.'.join(at)} has no '{key}'")
    std = file.number((*at, "std"), entry["std"], 0.0)
    length = file.number((*at, "length"), entry["length"], SHORTEST)
    return SmoothError(at[1], at[2], std, length)
