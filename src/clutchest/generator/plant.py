"""The truck, step by step: thermal network, clutch, engine, driveline, actuator, control unit.

All of it that is compiled stands in this one file, so that numba's cache never serves a kernel
older than what it calls; imported constants are frozen into it (touch this file if one
changes).  Numbers are those of ``effects.NUMBERS``.
"""

from __future__ import annotations

from math import exp, inf
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from clutchest.generator.scenarios import (
    DRIVE,
    GRAVITY,
    PER_METRE,
    POSITION,
    REST,
    ROLLING,
    TORQUE_RATE,
)
from clutchest.generator.surroundings import GEARBOX_TEMP, GRID
from clutchest.signals import Floats

STEP = 1e-3  # s: the control unit decides and the integrator steps once per STEP
FAST = 2  # steps between records of the fast quantities
MODES = ("open", "slipping", "locked", "retracted")

Record = Any  # a row of a structured array, its columns as attributes

# The integrated state.
BODY, HOUSING, DISC, ENGINE, SHAFT, SPEED, ENERGY, TORQUE = range(8)
# What the control unit is busy with.
_RESTING, _OPENING, _NEUTRAL, _LAUNCHING, _CLOSING, DRIVING, _UNLOADING, _HOLDING = range(8)

# What acts on the truck from outside these equations (see ``outsider``), 0 unless something does:
# share of the friction torque and torque (Nm) added to it, load on the engine (Nm) that no report
# contains, heat into the three masses (W), shift of the zero position and with it the curve (mm).
FOREIGN = (
    "torque_share",
    "torque",
    "engine_load",
    "body_heat",
    "housing_heat",
    "disc_heat",
    "zero_position",
)

# All that changes during a drive beside the integrated state.
SITUATION = np.dtype(
    [(name, np.int64) for name in ("phase", "leg", "gear", "next_gear", "bench", "held", "locked")]
    + [
        (name, np.float64)
        for name in (
            "since",
            "lock_time",
            "setpoint",
            "target",
            "trim",
            "sensed",
            "engine_before",
            "request",
            "brake",
            "command",
            "ratio",
            "sync_rate",
            "sync_speed",
            "sign",
            "carried",
            "motor",
            "port",
            "slave",
            "plate_before",
            "plate",
            "friction",
            "coolant",
            "ambient",
            "grade",
            *(f"foreign_{name}" for name in FOREIGN),
        )
    ]
)

IDLE = 62.8  # rad/s
_OPEN, _RETRACT = 11.5, -inf  # mm
_SHAFT_INERTIA, _SHAFT_DRAG = 0.4, 0.03  # kg m², Nm s: input shaft alone, in neutral
_ENGINE_LAG, _SERVO_LAG, _SERVO_RATE, _PORT = 0.08, 0.025, 45.0, 0.5  # s, s, mm/s, mm
_STANDING = 40e3  # N: brake of a standing truck
_AIR = 3.3  # kg/m: half of density · drag coefficient · frontal area


@njit(cache=True, error_model="numpy")
def expansion(body: float, disc: float, p: Record) -> float:
    """Δx0 (15), mm."""
    return p.expansion_body * (body - p.reference_temp) + p.expansion_disc * min(
        disc - body, p.disc_body_temp_cap
    )


@njit(cache=True, error_model="numpy")
def zero_reference(energy: float, s: Record, p: Record) -> float:
    """x0_ref after ``energy`` J of slip, mm."""
    return p.zero_position - p.wear_rate * 1e-6 * energy + s.foreign_zero_position


@njit(cache=True, error_model="numpy")
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
    torque = depth * depth * (p.torque_quadratic - p.torque_cubic * depth) * max(factor, 0.0)
    return max(torque + s.foreign_torque, 0.0)


@njit(cache=True, error_model="numpy")
def resistance(speed: float, s: Record, p: Record) -> float:
    """Force against the truck's motion, N."""
    return p.mass * GRAVITY * (ROLLING + s.grade) + _AIR * speed * speed + s.brake


@njit(cache=True, error_model="numpy")
def shaft_side(y: Floats, s: Record, p: Record) -> tuple[float, float]:
    """Inverse inertia (1/(kg m²)) and load (Nm) that the clutch drives."""
    if s.held:
        return 0.0, 0.0
    if s.ratio > 0.0:
        return s.ratio * s.ratio / p.mass, resistance(y[SPEED], s, p) / s.ratio
    sync = _SHAFT_INERTIA * s.sync_rate * (y[SHAFT] - s.sync_speed)
    return 1.0 / _SHAFT_INERTIA, _SHAFT_DRAG * y[SHAFT] + sync


@njit(cache=True, error_model="numpy")
def sticking(y: Floats, s: Record, p: Record) -> float:
    """The torque that keeps both sides of the clutch at one speed, Nm."""
    inverse, load = shaft_side(y, s, p)
    driving = (y[TORQUE] - s.foreign_engine_load) / p.engine_inertia
    return (driving + load * inverse) / (1.0 / p.engine_inertia + inverse)


@njit(cache=True, error_model="numpy")
def transmitted(y: Floats, plate: float, s: Record, p: Record) -> float:
    """The clutch's torque M_c on the shaft, Nm."""
    if s.locked:
        return sticking(y, s, p)
    return s.sign * capacity(y, plate, s, p) + p.drag * (y[ENGINE] - y[SHAFT]) / 100.0


@njit(cache=True, error_model="numpy")
def rates(y: Floats, plate: float, s: Record, p: Record, out: Floats) -> None:
    """dy/dt into ``out``: (12)–(14), (8), engine and driveline."""
    torque = transmitted(y, plate, s, p)
    power = 0.0 if s.locked else torque * (y[ENGINE] - y[SHAFT])
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
    inverse, load = shaft_side(y, s, p)
    out[ENGINE] = (y[TORQUE] - s.foreign_engine_load - torque) / p.engine_inertia
    out[SHAFT] = (torque - load) * inverse
    if s.held:
        out[SPEED] = 0.0
    elif s.ratio > 0.0:
        out[SPEED] = out[SHAFT] / s.ratio
    else:
        out[SPEED] = -resistance(y[SPEED], s, p) / p.mass
    out[ENERGY] = power
    out[TORQUE] = (s.request - y[TORQUE]) / _ENGINE_LAG


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def lock_or_pass(y: Floats, plate: float, s: Record, p: Record) -> None:
    """At equal speeds: stick if the clutch can carry what that takes, else slip on."""
    needed, limit = sticking(y, s, p), capacity(y, plate, s, p)
    s.locked = 1 if abs(needed) <= limit and limit > 0.0 else 0
    s.sign = 1.0 if needed > 0.0 else -1.0


@njit(cache=True, error_model="numpy")
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
            y[SHAFT] = 0.0
            s.held = 1


@njit(cache=True, error_model="numpy")
def _meet(y: Floats, s: Record, p: Record) -> None:
    """Make both speeds exactly one, keeping the angular momentum."""
    inverse, _ = shaft_side(y, s, p)
    weight = inverse * p.engine_inertia / (1.0 + inverse * p.engine_inertia)
    common = y[SHAFT] + weight * (y[ENGINE] - y[SHAFT])
    y[ENGINE] = common
    y[SHAFT] = common
    if s.ratio > 0.0 and not s.held:
        y[SPEED] = common / s.ratio


# --- the control unit: it knows speeds, position, reported torque and its own nominal curve ------


@njit(cache=True, error_model="numpy")
def _torque_limits(engine: float, p: Record) -> tuple[float, float]:
    full = min(max(0.45 + 0.55 * (engine - 60.0) / 50.0, 0.3), 1.0)
    full *= min(max((235.0 - engine) / 15.0, 0.0), 1.0)  # no more revolutions than that
    return -(60.0 + 0.9 * engine), full * p.engine_torque_max


@njit(cache=True, error_model="numpy")
def _govern(speed: float, y: Floats, s: Record, p: Record) -> None:
    """Engine towards ``speed``: what the clutch is felt to take, plus a share of the error."""
    s.setpoint += min(max(speed - s.setpoint, -80.0 * STEP), 80.0 * STEP)
    low, high = _torque_limits(y[ENGINE], p)
    request = s.sensed + 8.0 * p.known_inertia * (s.setpoint - y[ENGINE])
    s.request = min(max(request, low), high)


@njit(cache=True, error_model="numpy")
def _position_for(torque: float, y: Floats, s: Record, p: Record) -> float:
    """Command for ``torque`` by the nominal curve, trimmed by what the engine feels."""
    if torque <= 0.0:
        return p.known_kiss + 1.2 + s.trim
    depth = 2.0
    for _ in range(8):
        value = depth * depth * (p.known_quadratic - p.known_cubic * depth)
        slope = depth * (2.0 * p.known_quadratic - 3.0 * p.known_cubic * depth)
        depth = max(depth - (value - torque) / slope, 0.3 * depth)
    if torque > 60.0 and s.since > 0.5 and abs(y[ENGINE] - y[SHAFT]) > 3.0:
        slope = depth * (2.0 * p.known_quadratic - 3.0 * p.known_cubic * depth)
        s.trim += STEP * 3.0 * min(max(s.sensed - torque, -150.0), 150.0) / slope
        s.trim = min(max(s.trim, -2.5), 2.5)
    return p.known_kiss - depth + s.trim


@njit(cache=True, error_model="numpy")
def _gear_for(speed: float, engine: float) -> int:
    """The gear that turns the shaft closest to ``engine`` rad/s at ``speed`` m/s."""
    best = 0
    for k in range(len(PER_METRE)):
        if abs(PER_METRE[k] * speed - engine) < abs(PER_METRE[best] * speed - engine):
            best = k
    return best + 1


@njit(cache=True, error_model="numpy")
def _sliding(wish: float, since: float) -> float:
    """Slip left on purpose (rad/s) while closing after a gearshift: power is on early."""
    return (12.0 if wish > 0.0 else -6.0) * max(1.0 - since / 0.6, 0.0)


@njit(cache=True, error_model="numpy")
def _drive(wish: float, y: Floats, s: Record, p: Record) -> None:
    """In gear, closed: pedal, brake, and when to change gear."""
    s.command = _RETRACT
    total = p.mass + p.known_inertia * s.ratio * s.ratio
    s.brake = 0.0
    demand = (total * wish + resistance(y[SPEED], s, p)) / s.ratio
    low, high = _torque_limits(y[ENGINE], p)
    if not s.locked and s.since > 0.3:
        demand = min(demand, 0.8 * s.sensed)  # a clutch that slips unasked is relieved
    if demand < low:
        s.brake = (low - demand) * s.ratio
    demand = min(max(demand, low), high)
    s.request += min(max(demand - s.request, -2500.0 * STEP), 1800.0 * STEP)
    if s.since < 1.5:
        return
    wanted = s.gear
    if y[ENGINE] > 150.0 and wish > -0.1:
        wanted = max(_gear_for(y[SPEED], 100.0), s.gear)
    elif y[ENGINE] < 72.0:
        wanted = 0
    elif y[ENGINE] < 82.0 and wish > 0.05:
        wanted = min(_gear_for(y[SPEED], 125.0), s.gear)
    if wanted != s.gear:
        s.next_gear = wanted
        s.phase = _UNLOADING


@njit(cache=True, error_model="numpy")
def _neutral(leg: Record, wish: float, y: Floats, s: Record, p: Record) -> None:
    """Clutch open, gear out: bring shaft and engine to the next gear's speed, then engage."""
    s.command = _OPEN
    coasting = resistance(y[SPEED], s, p) - s.brake
    s.brake = max(-wish * p.mass - coasting, 0.0) if y[SPEED] > 0.0 else _STANDING
    if s.next_gear == 0 and not s.bench:
        _govern(IDLE, y, s, p)
        if leg.kind == DRIVE and leg.speed > 0.0 and y[SPEED] > 2.0:
            s.next_gear = _gear_for(y[SPEED], 115.0)
        elif y[SPEED] == 0.0 and s.since > 0.4:
            s.phase = _CLOSING
        return
    ratio = 0.0 if s.bench else PER_METRE[s.next_gear - 1]
    rolling = y[SPEED] > 0.0
    s.sync_rate = 16.0
    s.sync_speed = leg.shaft_speed if s.bench else ratio * y[SPEED]
    goal = s.sync_speed + _sliding(wish, 0.0) if rolling else leg.engine_speed
    _govern(goal, y, s, p)
    if s.since > 0.7 and (abs(y[ENGINE] - goal) < 5.0 or s.since > 3.0):
        s.sync_rate = 0.0
        s.gear, s.ratio = s.next_gear, ratio
        y[SHAFT] = s.sync_speed
        s.held = 0 if rolling else 1
        s.phase = _HOLDING if s.bench else _CLOSING if rolling else _LAUNCHING


@njit(cache=True, error_model="numpy")
def control(time: float, legs: NDArray, y: Floats, s: Record, p: Record) -> None:
    """One decision of the control unit and the driver."""
    while time >= legs[s.leg + 1].time:
        s.leg += 1
    leg, before = legs[s.leg], s.phase
    s.grade = leg.grade
    s.since += STEP
    s.lock_time = s.lock_time + STEP if s.locked else 0.0
    felt = y[TORQUE] - p.known_inertia * (y[ENGINE] - s.engine_before) / STEP
    s.engine_before = y[ENGINE]
    s.sensed += STEP / 0.05 * (felt - s.sensed)
    driving = leg.kind == DRIVE and leg.speed > 0.0
    on_bench = leg.kind != DRIVE and leg.kind != REST
    wish = min(max(0.4 * (leg.speed - y[SPEED]), -1.0), 0.8) if driving else -0.9

    if s.phase == _RESTING:
        s.command = _RETRACT
        s.brake = _STANDING
        _govern(IDLE, y, s, p)
        if driving or on_bench:
            s.next_gear = leg.gear if driving else 0
            s.bench = 1 if on_bench else 0
            s.phase = _OPENING
    elif s.phase == DRIVING:
        _drive(wish, y, s, p)
    elif s.phase == _UNLOADING:
        s.request += min(max(-s.request, -6000.0 * STEP), 6000.0 * STEP)
        if s.since > 0.3:
            s.phase = _OPENING
    elif s.phase == _OPENING:
        s.command = _OPEN
        _govern(max(y[SHAFT], IDLE), y, s, p)
        if s.motor > _OPEN - 0.8:
            s.gear, s.ratio, s.held = 0, 0.0, 0
            s.phase = _NEUTRAL
    elif s.phase == _NEUTRAL:
        _neutral(leg, wish, y, s, p)
    elif s.phase == _LAUNCHING:
        s.brake = 0.0
        s.target = min(s.target + 700.0 * STEP, leg.torque)
        s.command = _position_for(s.target, y, s, p)
        _govern(leg.engine_speed, y, s, p)
        if s.held and s.carried * s.ratio > resistance(y[SPEED], s, p):
            s.held = 0
        if s.lock_time > 0.1:
            s.phase = DRIVING
    elif s.phase == _CLOSING:
        s.target += (500.0 if s.ratio > 0.0 else 60.0) * STEP
        s.command = _position_for(s.target, y, s, p)
        _govern(y[SHAFT] + _sliding(wish, s.since) if s.ratio > 0.0 else IDLE, y, s, p)
        if s.lock_time > 0.1:
            s.phase = DRIVING if s.ratio > 0.0 else _RESTING
    else:
        _hold(time, leg, legs[s.leg + 1].time, y, s, p)
        if not on_bench:
            s.bench = s.next_gear = 0
            s.phase = _OPENING
    if s.phase != before:
        s.since = s.target = 0.0
        s.setpoint = y[ENGINE]


@njit(cache=True, error_model="numpy")
def _hold(time: float, leg: Record, end: float, y: Floats, s: Record, p: Record) -> None:
    """Slip on purpose, the shaft held."""
    _govern(leg.engine_speed, y, s, p)
    if leg.kind == POSITION:
        s.command = leg.start + (leg.end - leg.start) * (time - leg.time) / (end - leg.time)
    elif leg.torque > 0.0:
        s.target += min(max(leg.torque - s.target, -TORQUE_RATE * STEP), TORQUE_RATE * STEP)
        s.command = _position_for(s.target, y, s, p)
    else:
        s.target = 0.0
        s.command = _OPEN


@njit(cache=True, error_model="numpy")
def actuate(y: Floats, s: Record, p: Record) -> None:
    """Motor, slave piston and plate one STEP on, towards the command.

    Fully retracted, the hydraulic port opens and the piston rests on the clutch, wherever heat and
    wear have put it; from there the trapped fluid carries it.  Commands count from that position,
    so the truck follows the wear of its clutch, as any such truck does.
    """
    goal = -1.0 if s.command == _RETRACT else s.command
    rate = min(max((goal - s.motor) / _SERVO_LAG, -_SERVO_RATE), _SERVO_RATE)
    s.motor = max(s.motor + rate * STEP, 0.0)
    contact = zero_reference(y[ENERGY], s, p) + expansion(y[BODY], y[DISC], p) - p.position_origin
    if s.motor == 0.0:
        s.port = contact
    trapped = contact + (s.port - contact) * min(s.motor / _PORT, 1.0) + s.motor
    s.slave = max(contact, trapped)
    s.plate_before = s.plate
    s.plate = min(max(s.plate, s.slave - p.play), s.slave + p.play)


@njit(cache=True, error_model="numpy")
def run(
    begin: int,
    end: int,
    substeps: int,
    legs: NDArray,
    slow: Floats,
    numbers: NDArray,
    situation: NDArray,
    y: Floats,
    truth_every: int,
    fast: Floats,
    truth: Floats,
) -> None:
    """The STEPs ``begin`` … ``end`` − 1 of a drive; in pieces it is the same drive.

    ``slow`` (n, 3): friction, coolant, ambient every GRID s; ``situation``, ``numbers`` (1,)
    records.  Writes rows of ``fast`` (n, 6), every FAST STEPs: engine speed, shaft speed, slave,
    motor, engine torque, truck's speed; and of ``truth`` (n, 8), every ``truth_every`` STEPs: body,
    housing, disc, x0_ref, friction, clutch torque, slip energy, mode (index into MODES).
    """
    s, p = situation[0], numbers[0]
    work = np.empty((5, len(y)))
    for k in range(begin, end):
        time = k * STEP
        place = time / GRID
        row = int(place)
        share = place - row
        s.friction = slow[row, 0] + share * (slow[row + 1, 0] - slow[row, 0])
        s.coolant = slow[row, 1] + share * (slow[row + 1, 1] - slow[row, 1])
        s.ambient = slow[row, 2] + share * (slow[row + 1, 2] - slow[row, 2])
        s.carried = transmitted(y, s.plate, s, p)
        if k % FAST == 0:
            out = fast[k // FAST]
            out[0], out[1], out[2] = y[ENGINE], y[SHAFT], s.slave
            out[3], out[4], out[5] = s.motor, y[TORQUE], y[SPEED]
        if k % truth_every == 0:
            row_out = truth[k // truth_every]
            row_out[0], row_out[1], row_out[2] = y[BODY], y[HOUSING], y[DISC]
            row_out[3] = zero_reference(y[ENERGY], s, p)
            row_out[4], row_out[5], row_out[6] = s.friction, s.carried, y[ENERGY]
            if s.locked:
                row_out[7] = 3.0 if s.motor == 0.0 else 2.0
            else:
                row_out[7] = 1.0 if capacity(y, s.plate, s, p) > 0.0 else 0.0
        control(time, legs, y, s, p)
        actuate(y, s, p)
        advance(y, substeps, s, p, work)
