"""The truck's control unit and driver: it knows speeds, position, reported torque and its nominal
curve.

Its text joins that of the truck's other files in one generated module: see ``generator.plant``.
"""

from __future__ import annotations

from numpy.typing import NDArray

from clutchest.generator.physics import (
    resistance,
)
from clutchest.generator.scenarios import (
    DRIVE,
    PER_METRE,
    POSITION,
    REST,
    TORQUE_RATE,
)
from clutchest.generator.situation import (
    CLOSING,
    DRIVING,
    ENGINE,
    HOLDING,
    IDLE,
    LAUNCHING,
    NEUTRAL,
    OPENED,
    OPENING,
    RESTING,
    RETRACT,
    SHAFT,
    SPEED,
    STANDING,
    STEP,
    TORQUE,
    UNLOADING,
    Record,
)
from clutchest.native import compiled
from clutchest.signals import Floats

# --- the generated module goes on from here ---


@compiled
def _torque_limits(engine: float, p: Record) -> tuple[float, float]:
    full = min(max(0.45 + 0.55 * (engine - 60.0) / 50.0, 0.3), 1.0)
    full *= min(max((235.0 - engine) / 15.0, 0.0), 1.0)  # no more revolutions than that
    return -(60.0 + 0.9 * engine), full * p.engine_torque_max


@compiled
def _govern(speed: float, y: Floats, s: Record, p: Record) -> None:
    """Engine towards ``speed``: what the clutch is felt to take, plus a share of the error."""
    s.setpoint += min(max(speed - s.setpoint, -80.0 * STEP), 80.0 * STEP)
    low, high = _torque_limits(y[ENGINE], p)
    request = s.sensed + 8.0 * p.known_inertia * (s.setpoint - y[ENGINE])
    s.request = min(max(request, low), high)


@compiled
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


@compiled
def _gear_for(speed: float, engine: float) -> int:
    """The gear that turns the shaft closest to ``engine`` rad/s at ``speed`` m/s."""
    best = 0
    for k in range(len(PER_METRE)):
        if abs(PER_METRE[k] * speed - engine) < abs(PER_METRE[best] * speed - engine):
            best = k
    return best + 1


@compiled
def _sliding(wish: float, since: float) -> float:
    """Slip left on purpose (rad/s) while closing after a gearshift: power is on early."""
    return (12.0 if wish > 0.0 else -6.0) * max(1.0 - since / 0.6, 0.0)


@compiled
def _drive(wish: float, y: Floats, s: Record, p: Record) -> None:
    """In gear, closed: pedal, brake, and when to change gear."""
    s.command = RETRACT
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
        s.phase = UNLOADING


@compiled
def _neutral(leg: Record, wish: float, y: Floats, s: Record, p: Record) -> None:
    """Clutch open, gear out: bring shaft and engine to the next gear's speed, then engage."""
    s.command = OPENED
    coasting = resistance(y[SPEED], s, p) - s.brake
    s.brake = max(-wish * p.mass - coasting, 0.0) if y[SPEED] > 0.0 else STANDING
    if s.next_gear == 0 and not s.bench:
        _govern(IDLE, y, s, p)
        if leg.kind == DRIVE and leg.speed > 0.0 and y[SPEED] > 2.0:
            s.next_gear = _gear_for(y[SPEED], 115.0)
        elif y[SPEED] == 0.0 and s.since > 0.4:
            s.phase = CLOSING
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
        s.phase = HOLDING if s.bench else CLOSING if rolling else LAUNCHING


@compiled
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

    if s.phase == RESTING:
        s.command = RETRACT
        s.brake = STANDING
        _govern(IDLE, y, s, p)
        if driving or on_bench:
            s.next_gear = leg.gear if driving else 0
            s.bench = 1 if on_bench else 0
            s.phase = OPENING
    elif s.phase == DRIVING:
        _drive(wish, y, s, p)
    elif s.phase == UNLOADING:
        s.request += min(max(-s.request, -6000.0 * STEP), 6000.0 * STEP)
        if s.since > 0.3:
            s.phase = OPENING
    elif s.phase == OPENING:
        s.command = OPENED
        _govern(max(y[SHAFT], IDLE), y, s, p)
        if s.motor > OPENED - 0.8:
            s.gear, s.ratio, s.held = 0, 0.0, 0
            s.phase = NEUTRAL
    elif s.phase == NEUTRAL:
        _neutral(leg, wish, y, s, p)
    elif s.phase == LAUNCHING:
        s.brake = 0.0
        s.target = min(s.target + 700.0 * STEP, leg.torque)
        s.command = _position_for(s.target, y, s, p)
        _govern(leg.engine_speed, y, s, p)
        if s.held and s.carried * s.ratio > resistance(y[SPEED], s, p):
            s.held = 0
        if s.lock_time > 0.1:
            s.phase = DRIVING
    elif s.phase == CLOSING:
        s.target += (500.0 if s.ratio > 0.0 else 60.0) * STEP
        s.command = _position_for(s.target, y, s, p)
        _govern(y[SHAFT] + _sliding(wish, s.since) if s.ratio > 0.0 else IDLE, y, s, p)
        if s.lock_time > 0.1:
            s.phase = DRIVING if s.ratio > 0.0 else RESTING
    else:
        _hold(time, leg, legs[s.leg + 1].time, y, s, p)
        if not on_bench:
            s.bench = s.next_gear = 0
            s.phase = OPENING
    if s.phase != before:
        s.since = s.target = 0.0
        s.setpoint = y[ENGINE]


@compiled
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
        s.command = OPENED
