"""The delay of every signal, counted from the engine speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from clutchest.identify import equations
from clutchest.identify.delay import FEWEST, Delay, Stretch, estimate
from clutchest.identify.equations import Drive
from clutchest.identify.fit import Fitted
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

LOOSEST = 0.02  # s, standard deviation beyond which a delay is not told
SLAVE_SHIFT = -0.3  # s: the position's is looked for with the opposite sign

# what a signal's delay needs to be seen in, in words
NEEDS = {
    "engine_torque": "stretches with the clutch open, beyond kiss_point + open_margin, in which "
    "the torque moves",
    "input_shaft_speed": "stretches with the clutch locked",
    "vehicle_speed": "stretches locked in one gear",
    "slave_position": "slips of half a second and more, and the delay of engine_torque",
    "motor_position": "stretches with the actuator off its stop, and the delay of slave_position",
}


def delays(signals: Signals, vehicle: Vehicle) -> dict[str, Fitted]:
    """Of every mapped signal.  A delay that is not determined says why."""
    found = _found([d for part in signals.drives if (d := Drive.of(part, vehicle))])
    return {name: _fitted(name, found, mapped.delay) for name, mapped in vehicle.signals.items()}


def _found(drives: list[Drive]) -> Mapping[str, Delay | None]:
    def of(stretches: Callable[[Drive], list[Stretch]], shift: float = 0.0) -> Delay | None:
        return estimate([stretch for drive in drives for stretch in stretches(drive)], shift)

    found: dict[str, Delay | None] = {
        "engine_torque": of(equations.engine_torque),
        "input_shaft_speed": of(equations.input_shaft_speed),
        "vehicle_speed": of(equations.vehicle_speed),
    }
    if torque := _sure(found["engine_torque"]):

        def slave(by: float) -> Delay | None:
            late = of(lambda drive: equations.slave_position(drive, torque.value + by), SLAVE_SHIFT)
            # there the columns come later, not earlier
            return late and Delay(-late.value, late.std, late.stretches, late.inside)

        position, moved = slave(0.0), slave(torque.std)
        if position and moved:  # the torque's own doubt is the position's as well
            std = float(np.hypot(position.std, moved.value - position.value))
            found["slave_position"] = Delay(position.value, std, position.stretches,
                                            position.inside)  # fmt: skip
    if slave_late := _sure(found.get("slave_position")):
        behind = of(equations.motor_position)
        if behind:
            found["motor_position"] = Delay(
                slave_late.value + behind.value,
                float(np.hypot(slave_late.std, behind.std)),
                min(slave_late.stretches, behind.stretches),
                behind.inside,
            )
    return found


def _sure(delay: Delay | None) -> Delay | None:
    return delay if delay and delay.inside and delay.std < LOOSEST else None


def _fitted(name: str, found: Mapping[str, Delay | None], before: float) -> Fitted:
    """What is written of one signal's delay; ``before`` is the vehicle file's."""
    if name == "engine_speed":
        return Fitted.unknown(before, "s", "the clock from which the others are counted")
    if name not in NEEDS:
        return Fitted.unknown(before, "s", "nothing that moves fast follows from it")
    delay = found.get(name)
    if delay is None:
        return Fitted.unknown(before, "s", f"needs at least {FEWEST} {NEEDS[name]}")
    if not delay.inside:
        return Fitted.unknown(before, "s", "no delay within reach explains it better than others")
    low, high = delay.value - delay.reach, delay.value + delay.reach
    if delay.std >= LOOSEST:
        return Fitted.unknown(before, "s", f"{low * 1e3:.0f} … {high * 1e3:.0f} ms is too wide to "
                              f"be of use; needs more {NEEDS[name]}")  # fmt: skip
    if high < 0:
        return Fitted.unknown(before, "s", f"{-delay.value * 1e3:.0f} ms ahead of engine_speed: "
                              "that one is late, or the equation does not hold")  # fmt: skip
    return Fitted(round(max(delay.value, 0.0), 5), "s", std=round(delay.std, 6),
                  low=round(max(low, 0.0), 5), high=round(high, 5))  # fmt: skip
