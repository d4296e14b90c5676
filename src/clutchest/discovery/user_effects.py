"""A user's own hypotheses: effects from files of theirs, checked before anything is read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from clutchest.errors import ClutchestError
from clutchest.models.effects import Effect, effects_of_file
from clutchest.models.machine import Machine
from clutchest.models.validate_effect import why_invalid
from clutchest.vehicle import Vehicle


def user_effects(files: Sequence[str | Path], vehicle: Vehicle) -> list[Effect]:
    """Every effect of these ``files`` that the vehicle has not in its model already.

    Raises ClutchestError, with the file's name, for one that cannot be tested.
    """
    values = {key: quantity.value for key, quantity in vehicle.parameters.items()}
    effects: dict[str, Effect] = {}
    for path in dict.fromkeys(Path(file).resolve() for file in files):
        for name, effect in effects_of_file(path).items():
            if name in vehicle.effects:
                continue
            wrong = why_invalid(effect, vehicle.machine, values)
            if wrong or (wrong := _why_untestable(effect, vehicle.machine, effects)):
                raise ClutchestError(f"{path}: effect '{name}' {wrong}")
            effects[name] = effect
    return list(effects.values())


def _why_untestable(effect: Effect, machine: Machine, effects: dict[str, Effect]) -> str | None:
    """Why an effect that may stand in the model cannot be tested."""
    if effect.lateness:
        return "has a delay that varies: it cannot be tested, only stated in the vehicle file"
    taken = [("the library", machine.effects), ("another file", effects)]
    for where, names in taken:
        if effect.name in names:
            return f"has the name of one in {where}, expected another"
    return None
