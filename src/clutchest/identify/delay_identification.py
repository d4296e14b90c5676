"""The delay of every signal, counted from the anchor of the machine's equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from clutchest.estimate.timeline import regimes
from clutchest.identify.delay import FEWEST, DelayEstimate, estimate
from clutchest.identify.fit import Fitted
from clutchest.identify.sensor_noise import far_off
from clutchest.models.delay_relations import STEP, DelayRelation, DelayStretch, GriddedSignals
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

LOOSEST = 0.02  # s, standard deviation beyond which a delay is not determined
FEWEST_SAMPLES = 8

Delays = Mapping[str, DelayEstimate | None]


def delays(signals: Signals, vehicle: Vehicle) -> dict[str, Fitted]:
    """Of every mapped signal.  A delay that is not determined says why."""
    anchor = anchor_of(vehicle)
    drives = [d for part in signals.drives if (d := gridded(part, vehicle, anchor))]
    estimates: dict[str, DelayEstimate | None] = {}
    for relation in vehicle.machine.delay_relations:
        estimates[relation.signal] = _estimated(relation, drives, vehicle, estimates)
    needs = {relation.signal: relation.needs for relation in vehicle.machine.delay_relations}
    return {
        name: _fitted(name, anchor, needs, estimates.get(name), mapped.delay)
        for name, mapped in vehicle.signals.items()
    }


def anchor_of(vehicle: Vehicle) -> str:
    """The signal from which delays are counted."""
    return vehicle.machine.equations(vehicle.signals).anchor


def gridded(signals: Signals, vehicle: Vehicle, anchor: str) -> GriddedSignals | None:
    """One drive on a grid, outliers left out; None where the ``anchor`` is missing."""
    present = {}
    for name, signal in signals.items():
        if signal.valid.sum() > FEWEST_SAMPLES:
            read = signal.only_valid()
            present[name] = read.take(~far_off(read.value))
    if anchor not in present:
        return None
    pace = present[anchor]
    time = np.arange(pace.time[0], pace.time[-1], STEP)
    parameters = {key: parameter.value for key, parameter in vehicle.parameters.items()}
    return GriddedSignals(parameters, present, time, regimes(time, present, vehicle).mode)


def _estimated(
    relation: DelayRelation, drives: list[GriddedSignals], vehicle: Vehicle, known: Delays
) -> DelayEstimate | None:
    """By one relation, its standard deviation with that of the numbers it takes as given."""
    before = {name: _determined(known.get(name)) for name in relation.after}
    given = {name: delay.value for name, delay in before.items() if delay}
    behind = _determined(known.get(relation.behind)) if relation.behind else None
    if len(given) < len(before) or (relation.behind and behind is None):
        return None

    def at(given: Mapping[str, float], moved: str = "", by: float = 0.0) -> DelayEstimate | None:
        def stretches(drive: GriddedSignals) -> list[DelayStretch]:
            parameters = dict(drive.parameters)
            if moved:
                parameters[moved] += by
            return relation.stretches(replace(drive, parameters=parameters), given)

        return _of(stretches, drives, relation)

    estimates = [at(given)]
    for name, delay in before.items():
        if delay:
            estimates.append(at({**given, name: delay.value + delay.std}))
    for key in relation.parameters:
        estimates.append(at(given, key, vehicle.parameters[key].spread))
    delay = _widened(*estimates)
    return delay and (_after(behind, delay) if behind else delay)


def _of(
    stretches: Callable[[GriddedSignals], list[DelayStretch]],
    drives: list[GriddedSignals],
    relation: DelayRelation,
) -> DelayEstimate | None:
    every = [stretch for drive in drives for stretch in stretches(drive)]
    delay = estimate(every, relation.shift)
    return replace(delay, value=-delay.value) if delay and relation.reversed else delay


def _widened(delay: DelayEstimate | None, *moved: DelayEstimate | None) -> DelayEstimate | None:
    """``delay`` with what becomes of it when each given number is one standard deviation off."""
    if delay is None:
        return None
    shifts = [other.value - delay.value for other in moved if other]
    return replace(delay, std=float(np.linalg.norm([delay.std, *shifts])))


def _after(first: DelayEstimate, more: DelayEstimate) -> DelayEstimate:
    """The sum of two delays."""
    return DelayEstimate(
        first.value + more.value,
        float(np.hypot(first.std, more.std)),
        min(first.stretches, more.stretches),
        more.inside,
    )


def _determined(delay: DelayEstimate | None) -> DelayEstimate | None:
    return delay if delay and delay.inside and delay.std < LOOSEST else None


def _fitted(
    name: str,
    anchor: str,
    needs: Mapping[str, str],
    delay: DelayEstimate | None,
    before: float,
) -> Fitted:
    """What is written of one signal's delay; ``before`` is the vehicle file's."""
    if name == anchor:
        return Fitted.unknown(before, "s", "the clock from which the others are counted")
    if name not in needs:
        return Fitted.unknown(before, "s", "the machine declares no relation that shows it")
    if delay is None:
        return Fitted.unknown(before, "s", f"needs at least {FEWEST} {needs[name]}")
    if not delay.inside:
        return Fitted.unknown(before, "s", "no delay within reach explains it better than others")
    low, high = delay.value - delay.reach, delay.value + delay.reach
    if delay.std >= LOOSEST:
        why = (
            f"standard deviation {delay.std * 1e3:.0f} ms, expected below {LOOSEST * 1e3:.0f}; "
            f"needs more {needs[name]}"
        )
        return Fitted.unknown(before, "s", why)
    if high < 0:
        why = (
            f"{-delay.value * 1e3:.0f} ms ahead of {anchor}: that one is late, or the equation "
            "does not hold"
        )
        return Fitted.unknown(before, "s", why)
    return Fitted(
        round(max(delay.value, 0.0), 5),
        "s",
        std=round(delay.std, 6),
        low=round(max(low, 0.0), 5),
        high=round(high, 5),
    )
