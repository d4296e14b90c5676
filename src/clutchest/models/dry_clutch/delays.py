"""How the delays of the truck's signals show, counted from the engine speed.

| signal | where | relation |
|---|---|---|
| engine_torque | clutch open | M_e = J_e dω_e/dt + bias |
| input_shaft_speed | locked | ω_i = ω_e |
| vehicle_speed | locked, in gear | v = ω_e / ratio |
| slave_position | slipping | M_e − J_e dω_e/dt = cubic of x (eq. 16; its coefficients per slip) |
| motor_position | off its stop | x_m = x − what the port trapped |
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchest.models.delay_relations import (
    STEP,
    DelayRelation,
    DelayStretch,
    GriddedSignals,
    Mask,
    rate,
    smoothed,
)
from clutchest.models.regimes import Mode
from clutchest.signals import Floats

SETTLED = 0.5  # s away from any slip, to count as locked for good


def engine_torque(drive: GriddedSignals, delays: Mapping[str, float]) -> list[DelayStretch]:
    """Clutch open: the torque speeds the engine up.

    The inertia is given: one that is fitted reads too low under noise, and the delay then goes to
    where the engine happens to be more lively.
    """
    if not drive.has("engine_torque", "slave_position"):
        return []
    width = drive.width("engine_torque", "engine_speed")
    torque = drive.smooth("engine_torque", width)
    needed = drive.parameters["engine_inertia"] * rate(drive.smooth("engine_speed", width))
    flag = (drive.mode == Mode.open) & drive.whole("engine_torque", "engine_speed")
    return [drive.stretch(rows, torque, needed, []) for rows in drive.rows(flag, 0.3, width)]


def input_shaft_speed(drive: GriddedSignals, delays: Mapping[str, float]) -> list[DelayStretch]:
    """Locked: both sides turn alike."""
    if not drive.has("input_shaft_speed"):
        return []
    shaft, engine, flag, width = _turning_together(drive, "input_shaft_speed")
    return [drive.stretch(rows, shaft, engine, []) for rows in drive.rows(flag, 1.0, width)]


def vehicle_speed(drive: GriddedSignals, delays: Mapping[str, float]) -> list[DelayStretch]:
    """Locked and in gear: the vehicle goes as fast as the engine turns."""
    if not drive.has("vehicle_speed"):
        return []
    speed, engine, flag, width = _turning_together(drive, "vehicle_speed")
    stretches = []
    for rows in drive.rows(flag & (speed > 1.0), 2.0, width):
        ratio = speed[rows] / np.maximum(engine[rows], 1.0)
        if np.ptp(ratio) < 0.1 * ratio.mean():  # one gear, and not out of it
            stretches.append(drive.stretch(rows, speed, None, [engine], level=False))
    return stretches


def slave_position(drive: GriddedSignals, delays: Mapping[str, float]) -> list[DelayStretch]:
    """Slipping: clutch torque is a cubic of the position."""
    if not drive.has("engine_torque", "slave_position"):
        return []
    p = drive.parameters
    width = drive.width("engine_torque", "engine_speed", "slave_position")
    acceleration = rate(drive.smooth("engine_speed", width))
    reported = drive.smooth("engine_torque", width)
    torque = np.interp(drive.time + delays["engine_torque"], drive.time, reported)
    carried = torque - p["engine_inertia"] * acceleration
    depth = p["kiss_point"] + p["position_origin"] - drive.raw("slave_position")
    slip = drive.raw("engine_speed") - drive.raw("input_shaft_speed")
    power = np.abs(carried * slip)
    flag = (drive.mode == Mode.slipping) & (depth > 0.5)
    flag &= drive.whole("engine_torque", "engine_speed", "slave_position")
    growth = p["expansion_disc"] / p["heat_capacity_disc"]  # (15), mm/J of a short slip
    heated = np.cumsum(np.where(drive.mode == Mode.slipping, power, 0.0)) * STEP * growth
    stretches = []
    for side in (slip > 3.0, slip < -3.0):
        for rows in drive.rows(flag & side, 0.4, width):
            # heat moves the curve as the slip goes on: by nominal numbers, the rest is fitted
            grown = heated - heated[rows[0]]
            inside = np.maximum(depth + grown, 0.0)
            slope = inside * (2 * p["torque_quadratic"] - 3 * p["torque_cubic"] * inside)
            elapsed = drive.time - drive.time[rows[0]]
            curve = [inside, inside**2, inside**3, grown * slope, elapsed * slope]
            own = [smoothed(column, width) for column in curve]
            stretches.append(drive.stretch(rows, carried, None, own))
    return stretches


def motor_position(drive: GriddedSignals, delays: Mapping[str, float]) -> list[DelayStretch]:
    """Off its stop the motor moves the piston: the motor's delay less the piston's."""
    if not drive.has("motor_position", "slave_position"):
        return []
    width = drive.width("motor_position", "slave_position")
    motor = drive.smooth("motor_position", width)
    slave = drive.smooth("slave_position", width)
    flag = (motor > 1.0) & drive.whole("motor_position", "slave_position")
    return [drive.stretch(rows, motor, None, [slave]) for rows in drive.rows(flag, 0.5, width)]


def _turning_together(drive: GriddedSignals, name: str) -> tuple[Floats, Floats, Mask, float]:
    """Signal ``name`` and engine speed, smoothed alike; where both are whole and the clutch is
    locked for good; the smoothing in s."""
    names = (name, "engine_speed")
    width = drive.width(*names)
    signal, engine = (drive.smooth(which, width) for which in names)
    slips = (drive.mode != Mode.locked) & (drive.mode != Mode.retracted)
    return signal, engine, drive.away_from(slips, SETTLED) & drive.whole(*names), width


DELAY_RELATIONS = (
    DelayRelation(
        "engine_torque",
        "stretches with the clutch open, beyond kiss_point + open_margin, in which the torque "
        "moves",
        engine_torque,
        parameters=("engine_inertia",),
    ),
    DelayRelation("input_shaft_speed", "stretches with the clutch locked", input_shaft_speed),
    DelayRelation("vehicle_speed", "stretches locked in one gear", vehicle_speed),
    DelayRelation(
        "slave_position",
        "slips of half a second and more, and the delay of engine_torque",
        slave_position,
        after=("engine_torque",),
        parameters=("engine_inertia",),
        reversed=True,
        shift=-0.3,
    ),
    DelayRelation(
        "motor_position",
        "stretches with the actuator off its stop, and the delay of slave_position",
        motor_position,
        behind="slave_position",
    ),
)
