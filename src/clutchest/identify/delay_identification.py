"""The delay of every signal, counted from the engine speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from clutchest.identify import equations
from clutchest.identify.delay import FEWEST, Delay, Stretch, estimate
from clutchest.identify.equations import Drive
from clutchest.identify.fit import Fitted
from clutchest.signals import Signals
from clutchest.vehicle import ParameterValue, Vehicle

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
    drives = [d for part in signals.drives if (d := Drive.of(part, vehicle))]
    found = _found(drives, vehicle.parameters["engine_inertia"])
    return {name: _fitted(name, found, mapped.delay) for name, mapped in vehicle.signals.items()}


def _found(drives: list[Drive], inertia: ParameterValue) -> Mapping[str, Delay | None]:
    def of(stretches: Callable[[Drive], list[Stretch]], shift: float = 0.0) -> Delay | None:
        return estimate([stretch for drive in drives for stretch in stretches(drive)], shift)

    def torque(by: float = 0.0) -> Delay | None:
        return of(lambda drive: equations.engine_torque(drive, inertia.value + by))

    def slave(late: float, by: float = 0.0) -> Delay | None:
        # its columns come later, not earlier: the delay has the opposite sign
        found = of(lambda d: equations.slave_position(d, late, inertia.value + by), SLAVE_SHIFT)
        return found and replace(found, value=-found.value)

    found = {
        "engine_torque": _with_doubt(torque(), torque(inertia.spread)),
        "input_shaft_speed": of(equations.input_shaft_speed),
        "vehicle_speed": of(equations.vehicle_speed),
    }
    if late := _sure(found["engine_torque"]):
        found["slave_position"] = _with_doubt(
            slave(late.value), slave(late.value + late.std), slave(late.value, inertia.spread)
        )
    if late := _sure(found.get("slave_position")):
        behind = of(equations.motor_position)
        found["motor_position"] = behind and Delay(
            late.value + behind.value,
            float(np.hypot(late.std, behind.std)),
            min(late.stretches, behind.stretches),
            behind.inside,
        )
    return found


def _with_doubt(delay: Delay | None, *moved: Delay | None) -> Delay | None:
    """``delay`` with what becomes of it when each given number is one standard deviation off."""
    if delay is None:
        return None
    shifts = [other.value - delay.value for other in moved if other]
    return replace(delay, std=float(np.linalg.norm([delay.std, *shifts])))


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
        return Fitted.unknown(
            before,
            "s",
            f"{low * 1e3:.0f} … {high * 1e3:.0f} ms is too wide to "
            f"be of use; needs more {NEEDS[name]}",
        )
    if high < 0:
        return Fitted.unknown(
            before,
            "s",
            f"{-delay.value * 1e3:.0f} ms ahead of engine_speed: "
            "that one is late, or the equation does not hold",
        )
    return Fitted(
        round(max(delay.value, 0.0), 5),
        "s",
        std=round(delay.std, 6),
        low=round(max(low, 0.0), 5),
        high=round(high, 5),
    )
