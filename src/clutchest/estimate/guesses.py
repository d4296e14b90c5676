"""What guessed and wide numbers of a vehicle file do to the energies of a replay, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from clutchest.compute.records import Belief
from clutchest.estimate.run import Engagement
from clutchest.estimate.whole_log import Compiled
from clutchest.models.effects.effect import PARAMETER
from clutchest.shown import counted, plus_minus
from clutchest.vehicle import Vehicle

SHARE = 0.05  # of the variance of the energy; a parameter that brings less is not named
MOST_NAMED = 3


def energy_std_from(compiled: Compiled, belief: Belief) -> dict[str, float]:
    """Parameter → standard deviation in J that its spread brings into the slip energy, the largest
    first; only those that bring a share of it."""
    brought = np.abs(belief.sE * compiled.spread)
    variance = float(belief.E[1] + np.sum(brought**2))
    order = np.argsort(-brought, kind="stable")
    return {
        compiled.thetas[k][1]: float(brought[k])
        for k in order
        if compiled.thetas[k][0] == PARAMETER and brought[k] ** 2 > SHARE * variance
    }


def guesses(vehicle: Vehicle, energy_from: Mapping[str, float]) -> list[str]:
    """Which numbers of the vehicle file are guesses, and which of these matter for the energy."""
    words = []
    if vehicle.guessed:
        every = len(vehicle.guessed) == len(vehicle.parameters)
        names = f"all {len(vehicle.guessed)}" if every else ", ".join(vehicle.guessed)
        matter = [key for key in energy_from if key in vehicle.guessed][:MOST_NAMED]
        words.append(f"guessed parameters, by {vehicle.path.name}: {names}")
        if matter:
            brought = ", ".join(f"{key} ±{_short(energy_from[key] / 1e3)} kJ" for key in matter)
            words[0] += f"; into the slip energy they bring {brought}{_determined(vehicle, matter)}"
    words += [
        f"guessed, by {vehicle.path.name}: 100 % of {name} is {signal.reference:g} "
        f"{vehicle.machine.units[name]}; torque and energy scale with it, and their standard "
        "deviations do not contain that"
        for name, signal in vehicle.signals.items()
        if signal.reference_guessed
    ]
    return words


def uncertain_slips(slips: Sequence[Engagement]) -> list[str]:
    """That slip events are not listed, and why."""
    if not slips:
        return []
    energy = sum(slip.energy_J for slip in slips)
    spread = sum(slip.energy_std_J for slip in slips)  # the same parameters in each: they add up
    seconds = sum(slip.duration_s for slip in slips)
    return [
        f"not listed: {counted(len(slips), 'slip event')} of {seconds:.1f} s, with "
        f"{plus_minus(energy / 1e3, spread / 1e3, 'kJ')}: the spreads of the parameters leave open "
        "whether there was any"
    ]


def _determined(vehicle: Vehicle, keys: Sequence[str]) -> str:
    """By which procedures these parameters are determined, in words."""
    words = []
    for procedure in vehicle.machine.procedures:
        if own := [key for key in keys if key in procedure.parameters]:
            words.append(f"{procedure.name} ({', '.join(own)})")
    return f"; clutchest identify determines them: {', '.join(words)}" if words else ""


def _short(value: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"
