"""Thermal network, clutch, engine and driveline of the truck, step by step.

Its text joins that of the truck's other files in one generated module: see ``generator.plant``.
"""

from __future__ import annotations

from math import exp

from clutchest.generator.parts import (
    curve_error,
    delivered,
    heat_in_parts,
    is_soft,
    lag_and_stretch,
    pull,
)
from clutchest.generator.scenarios import (
    GRAVITY,
    ROLLING,
)
from clutchest.generator.situation import (
    AIR,
    BODY,
    DISC,
    ENERGY,
    ENGINE,
    ENGINE_LAG,
    HOUSING,
    SHAFT,
    SHAFT_DRAG,
    SHAFT_INERTIA,
    SPEED,
    STEP,
    TORQUE,
    Record,
)
from clutchest.generator.surroundings import (
    GEARBOX_TEMP,
)
from clutchest.native import compiled
from clutchest.signals import Floats

# --- the generated module goes on from here ---


@compiled
def expansion(body: float, disc: float, p: Record) -> float:
    """Δx0 (15), mm."""
    return p.expansion_body * (body - p.reference_temp) + p.expansion_disc * min(
        disc - body, p.disc_body_temp_cap
    )


@compiled
def zero_reference(energy: float, s: Record, p: Record) -> float:
    """x0_ref after ``energy`` J of slip, mm."""
    return p.zero_position - p.wear_rate * 1e-6 * energy + s.foreign_zero_position


@compiled
def capacity(y: Floats, plate: float, s: Record, p: Record) -> float:
    """The friction torque that the clutch can carry (16), Nm ≥ 0, at plate position mm."""
    worn = zero_reference(y[ENERGY], s, p) - p.zero_position_ref
    depth = p.kiss_point - (plate - expansion(y[BODY], y[DISC], p) - worn)
    if depth <= 0.0:
        return 0.0
    slip = abs(y[ENGINE] - y[SHAFT])
    factor = s.friction * (1.0 + p.curve_change * depth)
    factor *= 1.0 + p.slip_change * exp(-slip / p.slip_speed)
    factor *= 1.0 + p.speed_slope * slip / 100.0
    factor *= 1.0 + p.temperature_slope * (y[DISC] - 100.0) / 100.0
    factor *= 1.0 - p.fade_slope * max(y[DISC] - p.fade_onset, 0.0) / 100.0
    factor *= 1.0 + p.centrifugal_slope * y[ENGINE] * y[ENGINE] / 1e4
    factor *= 1.0 + s.foreign_torque_share
    if p.structured > 0.0:
        factor *= 1.0 + curve_error(depth, p)
    torque = depth * depth * (p.torque_quadratic - p.torque_cubic * depth) * max(factor, 0.0)
    return max(torque + s.foreign_torque, 0.0)


@compiled
def resistance(speed: float, s: Record, p: Record) -> float:
    """Force against the truck's motion, N."""
    return p.mass * GRAVITY * (ROLLING + s.grade) + AIR * speed * speed + s.brake


@compiled
def shaft_side(y: Floats, s: Record, p: Record) -> tuple[float, float]:
    """Inverse inertia (1/(kg m²)) and load (Nm) that the clutch drives."""
    if is_soft(s, p):
        return 1.0 / SHAFT_INERTIA, pull(y, s, p) / s.ratio
    if s.held:
        return 0.0, 0.0
    if s.ratio > 0.0:
        return s.ratio * s.ratio / p.mass, resistance(y[SPEED], s, p) / s.ratio
    sync = SHAFT_INERTIA * s.sync_rate * (y[SHAFT] - s.sync_speed)
    return 1.0 / SHAFT_INERTIA, SHAFT_DRAG * y[SHAFT] + sync


@compiled
def sticking(y: Floats, s: Record, p: Record) -> float:
    """The torque that keeps both sides of the clutch at one speed, Nm."""
    inverse, load = shaft_side(y, s, p)
    driving = (delivered(y, p) - s.foreign_engine_load) / p.engine_inertia
    return (driving + load * inverse) / (1.0 / p.engine_inertia + inverse)


@compiled
def transmitted(y: Floats, plate: float, s: Record, p: Record) -> float:
    """The clutch's torque M_c on the shaft, Nm."""
    if s.locked:
        return sticking(y, s, p)
    return s.sign * capacity(y, plate, s, p) + p.drag * (y[ENGINE] - y[SHAFT]) / 100.0


@compiled
def rates(y: Floats, plate: float, s: Record, p: Record, out: Floats) -> None:
    """dy/dt into ``out``: (12)–(14), (8), engine and driveline."""
    torque = transmitted(y, plate, s, p)
    power = 0.0 if s.locked else torque * (y[ENGINE] - y[SHAFT])
    if p.structured > 0.0:
        heat_in_parts(y, power, s, p, out)
        lag_and_stretch(y, s, p, out)
    else:
        _heat(y, power, s, p, out)
    inverse, load = shaft_side(y, s, p)
    out[ENGINE] = (delivered(y, p) - s.foreign_engine_load - torque) / p.engine_inertia
    out[SHAFT] = (torque - load) * inverse
    if s.held:
        out[SPEED] = 0.0
    elif is_soft(s, p):
        out[SPEED] = (pull(y, s, p) - resistance(y[SPEED], s, p)) / p.mass
    elif s.ratio > 0.0:
        out[SPEED] = out[SHAFT] / s.ratio
    else:
        out[SPEED] = -resistance(y[SPEED], s, p) / p.mass
    out[ENERGY] = power
    out[TORQUE] = (s.request - y[TORQUE]) / ENGINE_LAG


@compiled
def _heat(y: Floats, power: float, s: Record, p: Record, out: Floats) -> None:
    """Rates of body, housing and disc with the slip ``power`` W: (12)–(14)."""
    to_disc = (1.0 - p.heat_fraction_body) * power
    from_disc = p.conductance_disc_body * (y[DISC] - y[BODY])
    to_housing = p.conductance_body_housing * (y[BODY] - y[HOUSING])
    airflow = 1.0 + p.airflow_slope * y[SPEED] / 20.0
    out[BODY] = (
        p.conductance_engine_body * (s.coolant - y[BODY])
        - to_housing
        + from_disc
        + power
        - to_disc
        - p.gearbox_conductance * (y[BODY] - GEARBOX_TEMP)
        + s.foreign_body_heat
    ) / p.heat_capacity_body
    out[HOUSING] = (
        to_housing
        - p.conductance_housing_ambient * airflow * (y[HOUSING] - s.ambient)
        + s.foreign_housing_heat
    ) / p.heat_capacity_housing
    out[DISC] = (to_disc - from_disc + s.foreign_disc_heat) / p.heat_capacity_disc


@compiled
def runge_kutta(y: Floats, begin: float, h: float, s: Record, p: Record, work: Floats) -> None:
    """One classical fourth-order step of ``h`` s into ``work[0]``; the plate moves linearly
    through the STEP, of which the share ``begin`` is over."""
    swing = s.plate - s.plate_before
    for i in range(len(y)):
        work[0, i] = y[i]
    for stage in range(1, 5):
        share = 0.0 if stage == 1 else 1.0 if stage == 4 else 0.5
        plate = s.plate_before + swing * (begin + share * h / STEP)
        if stage > 1:
            for i in range(len(y)):
                work[0, i] = y[i] + share * h * work[stage - 1, i]
        rates(work[0], plate, s, p, work[stage])
    for i in range(len(y)):
        work[0, i] = y[i] + h / 6.0 * (
            work[1, i] + 2.0 * work[2, i] + 2.0 * work[3, i] + work[4, i]
        )


@compiled
def lock_or_pass(y: Floats, plate: float, s: Record, p: Record) -> None:
    """At equal speeds: stick if the clutch can carry what that takes, else slip on."""
    needed, limit = sticking(y, s, p), capacity(y, plate, s, p)
    s.locked = 1 if abs(needed) <= limit and limit > 0.0 else 0
    s.sign = 1.0 if needed > 0.0 else -1.0


@compiled
def advance(y: Floats, substeps: int, s: Record, p: Record, work: Floats) -> None:
    """Integrate ``y`` over one STEP in place; lock-up and break-away are met within it."""
    for k in range(substeps):
        begin, end = k / substeps, (k + 1) / substeps
        if s.locked:
            lock_or_pass(y, s.plate_before + (s.plate - s.plate_before) * begin, s, p)
        elif y[ENGINE] != y[SHAFT]:
            s.sign = 1.0 if y[ENGINE] > y[SHAFT] else -1.0
        for last in (False, False, True):  # at most two meetings of the speeds in one piece
            h = (end - begin) * STEP
            runge_kutta(y, begin, h, s, p, work)
            before = (y[ENGINE] - y[SHAFT]) * s.sign
            after = (work[0, ENGINE] - work[0, SHAFT]) * s.sign
            meets = not s.locked and after < 0.0 and before >= 0.0 and not last
            if meets:
                share = before / (before - after)
                runge_kutta(y, begin, share * h, s, p, work)
                begin += share * (end - begin)
            for i in range(len(y)):
                y[i] = work[0, i]
            if meets:
                _meet(y, s, p)
                lock_or_pass(y, s.plate_before + (s.plate - s.plate_before) * begin, s, p)
            else:
                break
    if s.locked:
        y[SHAFT] = y[ENGINE]  # the same but for rounding
    if y[SPEED] < 0.0:
        y[SPEED] = 0.0
        if s.ratio > 0.0:
            s.held = 1
            if not is_soft(s, p):
                y[SHAFT] = 0.0


@compiled
def _meet(y: Floats, s: Record, p: Record) -> None:
    """Make both speeds exactly one, keeping the angular momentum."""
    inverse, _ = shaft_side(y, s, p)
    weight = inverse * p.engine_inertia / (1.0 + inverse * p.engine_inertia)
    common = y[SHAFT] + weight * (y[ENGINE] - y[SHAFT])
    y[ENGINE] = common
    y[SHAFT] = common
    if s.ratio > 0.0 and not s.held and not is_soft(s, p):
        y[SPEED] = common / s.ratio
