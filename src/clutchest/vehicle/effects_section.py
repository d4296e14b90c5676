"""``[effects]`` and ``[effects_spread]`` of a vehicle file: terms in the machine's equations."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from clutchest.models.error_curve import KIND, is_curve
from clutchest.vehicle.named_files import NamedFiles
from clutchest.vehicle.toml import TomlFile
from clutchest.vehicle.vehicle import ParameterValue

if TYPE_CHECKING:
    from clutchest.models.effects import Effect
    from clutchest.models.machine import Machine


def read_effects(
    file: TomlFile,
    machine: Machine,
    named: NamedFiles,
    parameters: Mapping[str, ParameterValue],
    other: Container[str] = (),
) -> dict[str, dict[str, ParameterValue]]:
    """Effect → number → value and spread, of the ``machine``'s library and the user's own files,
    of those ``named``, but curves and ``other`` ones.  ``parameters``: values at which an effect of
    the user's own is tried."""
    table = file.table(("effects",), file.data.get("effects", {}))
    table = {name: e for name, e in table.items() if not is_curve(name) and name not in other}
    spreads = file.table(("effects_spread",), file.data.get("effects_spread", {}))
    spreads = {name: entry for name, entry in spreads.items() if name not in other}
    file.known(("effects_spread",), spreads, table, "effect of [effects]")
    own_files = [path for path in named.effects if path not in named.patches]
    if not table and not own_files:
        return {}
    from clutchest.models.effects import with_files

    library = with_files(machine.effects, own_files, named.digests)
    file.known(("effects",), table, (*library, KIND), f"effect of '{machine.name}'")
    if own := [name for name in table if name not in machine.effects]:
        from clutchest.models.validate_effect import why_invalid

        values = {key: quantity.value for key, quantity in parameters.items()}
        for name in own:
            if wrong := why_invalid(library[name], machine, values):
                raise file.error(("effects", name), f"effect '{name}' {wrong}")
    return {
        name: _numbers(file, library[name], value, spreads.get(name, {}))
        for name, value in table.items()
    }


def _numbers(file: TomlFile, effect: Effect, value: Any, spread: Any) -> dict[str, ParameterValue]:
    """The numbers of one effect, each with the standard deviation of its gain."""
    at, spread_at = ("effects", effect.name), ("effects_spread", effect.name)
    entry, spreads = file.table(at, value), file.table(spread_at, spread)
    declared = {number.key: number for number in effect.parameters}
    file.known(at, entry, declared, f"parameter of effect '{effect.name}'")
    numbers = {
        key: file.quantity((*at, key), given, declared[key].unit, declared[key].least)
        for key, given in entry.items()
    }
    file.known(spread_at, spreads, numbers, f"number in [effects] of '{effect.name}'")
    for key, given in spreads.items():
        std = file.quantity((*spread_at, key), given, declared[key].unit, 0.0).value
        numbers[key] = replace(numbers[key], spread=std)
    for key, number in numbers.items():
        if number.spread > 0.0 and declared[key].shape:
            raise file.error(
                (*(spread_at if key in spreads else at), key),
                f"{effect.name}.{key} is a shape and takes no spread",
            )
    return numbers
