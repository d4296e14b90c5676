"""Actuator and clutch, step by step: its own integrator, its own friction code.

Exponential in the current, backward Euler in plate and bristles, each in closed form or by a few
Newton steps; semi-implicit Euler in the masses; controllers sampled.  All that is compiled stands
in this file, so that numba's cache never serves a kernel older than what it calls.  Numbers are
those of ``effects.NUMBERS``.
"""

from __future__ import annotations

from math import exp, log, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchest.native import compiled
from clutchest.signals import Floats

STEP = 2e-5  # s
SAMPLED = 5  # steps between samples of the controllers
FAST = 50  # steps between rows of inputs and records, unless a scenario is faster
MODES = ("open", "slipping", "locked")

Record = Any  # a row of a structured array, its columns as attributes

# What the rig or the road does, one row per so many steps, straight in between.
#   actuator  0 current controller, 1 voltage, 2 motor angle controller; ``asked`` A, V or rad;
#             3 current controller with the angle fed back: ``asked`` A, ``angle`` rad, ``turning``
#             rad/s
#   bench     0 complete, 1 pack removed, 2 ball-ramp output fixed, 3 motor alone, 4 rotor held
#   drive     0 slip controller (``driven`` rad/s), 1 servo torque (Nm), 2 wheels (left − right)/2
#   oil °C
PROFILE = np.dtype(
    [(name, np.float64) for name in ("asked", "driven", "oil", "mean_wheel", "angle", "turning")]
    + [(name, np.int64) for name in ("actuator", "bench", "drive")]
)
CURRENT, VOLTAGE, ANGLE, GUIDED = range(4)
COMPLETE, NO_PACK, OUTPUT_FIXED, MOTOR_ALONE, ROTOR_HELD = range(5)
SLIP, TORQUE, WHEELS = range(3)

# What changes during a run.
NAMES = (
    "current",
    "motor_speed",
    "motor_angle",
    "bearing",
    "ramp_bristle",
    "plate",
    "wind_up",
    "drive_speed",
    "drive_angle",
    "temp_pack",
    "temp_armature",
    "energy",
    "free_play",
    "current_integral",
    "servo_integral",
    "voltage",
    "servo_torque",
)
STATE = np.dtype([(name, np.float64) for name in NAMES])

# What is recorded.
RECORD = (
    "current",
    "motor_speed",
    "motor_angle",
    "pack_force",
    "free_play",
    "friction",
    "temp_pack",
    "temp_armature",
    "clutch_torque",
    "slip_speed",
    "voltage",
    "motor_torque",
    "servo_torque",
    "drive_angle",
    "oil",
    "energy",
    "mode",
    "wind_up",
    "plate",
    "asked",
)

_ANGLE_GAIN, _ANGLE_RATE = 2.0, 0.05  # A/rad and A s/rad: the rig's position loop, I6
_FLOOR = 1e-5  # Nm
_BARE = 0.01  # of the axial damping: what is left without a pack


@compiled
def spring(s: float, p: Record) -> float:
    """Reset spring (10), N, at displacement s, m."""
    ratio = p.spring_outer_diameter / p.spring_inner_diameter
    alpha = ((ratio - 1.0) / ratio) ** 2 / ((ratio + 1.0) / (ratio - 1.0) - 2.0 / log(ratio)) / pi
    h, t = p.spring_cone_height, p.spring_thickness
    lead = 4.0 * p.spring_young / (1.0 - p.spring_poisson**2)
    lead *= t**3 * s / (alpha * p.spring_outer_diameter**2)
    return lead * ((h / t - s / t) * (h / t - s / (2.0 * t)) + 1.0)


@compiled
def pack(depth: float, p: Record) -> tuple[float, float]:
    """Force (N) and stiffness (N/m) of the pack, ``depth`` m beyond its free play."""
    if depth <= 0.0:
        return 0.0, 0.0
    if p.soft <= 0.0:
        return p.pack_stiffness * depth, p.pack_stiffness
    yielded = 1.0 - exp(-depth / p.soft)  # surfaces bed in over the first micrometres
    return p.pack_stiffness * (depth - p.soft * yielded), p.pack_stiffness * yielded


@compiled
def press(plate: float, angle: float, free_play: float, h: float, bench: int, p: Record) -> float:
    """The plate's position after h s, m: d_e Δd/h = F_br − F_rs + F_lim − F_c, by Newton."""
    if bench == OUTPUT_FIXED:
        return 0.0  # held where the plate rests
    held = spring(p.spring_preload, p)
    push = spring(p.spring_preload + plate, p)
    damping = p.axial_damping * (_BARE if bench == NO_PACK else 1.0) / h
    damping *= 1.0 + p.foreign_damping
    d = plate
    for _ in range(12):
        twist = angle - p.ball_ramp_ratio * d - p.gear_backlash
        film = damping * (1.0 - p.loose * (1.0 if d < plate else 0.0))
        force = -push - film * (d - plate)
        slope = -film
        if twist > 0.0:
            force += p.ball_ramp_ratio * p.ball_ramp_stiffness * twist
            slope -= p.ball_ramp_ratio**2 * p.ball_ramp_stiffness
        if held - p.limiter_stiffness * d > 0.0:
            force += held - p.limiter_stiffness * d
            slope -= p.limiter_stiffness
        if bench != NO_PACK:
            carried, stiffness = pack(d - free_play, p)
            force -= carried
            slope -= stiffness
        change = -force / slope
        d += change
        if abs(change) < 1e-13:
            break
    return d


@compiled
def level(force: float, speed: float, p: Record) -> float:
    """Coulomb level of the ball ramp (7), Nm; with what the deviations of the rig make of it."""
    share = p.ball_ramp_friction * (1.0 + p.foreign_ramp) / (1.0 + p.easing * force / 3e4)
    share *= 1.0 - p.dither * speed * speed / (speed * speed + 400.0)
    return max(share * p.ball_ramp_bore / 2.0 * abs(force), _FLOOR)


@compiled
def friction_coefficient(slip: float, oil: float, pack: float, p: Record) -> float:
    """μ with what slip and the temperatures of oil and pack make of it."""
    mu = p.friction_coefficient * (1.0 + p.slip_change * exp(-abs(slip) / p.slip_speed))
    mu *= 1.0 - p.fade * max(pack - p.fade_onset, 0.0) / 100.0
    return mu * (1.0 + p.oil_slope * (oil - 60.0) / 100.0) * (1.0 + p.foreign_friction)


@compiled
def limited(value: float, most: float) -> float:
    """Within ±most."""
    return min(max(value, -most), most)


@compiled
def control(y: Record, asked: float, driven: float, c: Record, h: float, p: Record) -> None:
    """One sample of the controllers: armature voltage and servo torque."""
    if c.actuator == VOLTAGE:
        y.voltage = limited(asked, p.supply_voltage)
    else:
        wanted = asked
        if c.actuator == ANGLE:
            lag = asked - y.motor_angle
            wanted = limited(_ANGLE_GAIN * lag - _ANGLE_RATE * y.motor_speed, 20.0)
        if c.actuator == GUIDED:
            lag, slow = c.angle - y.motor_angle, c.turning - y.motor_speed
            wanted = limited(asked + _ANGLE_GAIN * lag + _ANGLE_RATE * slow, 30.0)
        error = wanted - y.current
        y.current_integral += h * p.current_integral * error
        free = p.current_proportional * error + y.current_integral
        y.voltage = limited(free, p.supply_voltage)
        y.current_integral += h * p.current_integral / p.current_proportional * (y.voltage - free)
    if c.drive == SLIP:
        error = p.final_drive_ratio * driven - y.drive_speed
        y.servo_integral += h * p.servo_integral * error
        free = p.servo_proportional * error + y.servo_integral
        y.servo_torque = limited(free, p.servo_torque_limit)
        excess = y.servo_torque - free
        y.servo_integral += h * p.servo_integral / p.servo_proportional * excess


@compiled
def actuate(y: Record, c: Record, h: float, p: Record) -> None:
    """Motor, gear, ball ramp and plate over h s: (1)–(9)."""
    warm = y.temp_armature - p.armature_reference_temp
    R = p.armature_resistance * (1.0 + p.resistance_temp_coefficient * warm)
    L = p.armature_inductance * (1.0 + p.inductance_temp_coefficient * warm)
    Kt = p.torque_constant * (1.0 + p.torque_constant_temp_coefficient * warm)
    across = y.voltage - p.foreign_voltage
    settled = (across - p.back_emf_constant * y.motor_speed) / (R + p.harness)
    y.current = settled + (y.current - settled) * exp(-h / L * (R + p.harness))  # (1)

    w = y.motor_speed
    g = p.motor_coulomb_torque + (p.motor_static_torque - p.motor_coulomb_torque) * exp(
        -(abs(w / p.motor_stribeck_speed) ** p.motor_stribeck_exponent)
    )
    before = y.bearing
    sigma = p.motor_bristle_stiffness
    y.bearing = (before + h * w) / (1.0 + h * sigma * abs(w) / g)  # (4)
    friction = sigma * y.bearing + p.motor_bristle_damping * (y.bearing - before) / h
    friction += p.motor_viscous * w  # (5)

    load = 0.0
    if c.bench < MOTOR_ALONE:
        angle = y.motor_angle / p.gear_ratio
        twist = angle - p.ball_ramp_ratio * y.plate - p.gear_backlash
        home = min(angle + p.gear_backlash - p.foreign_home, 0.0) * p.ball_ramp_stiffness
        torque = max(twist, 0.0) * p.ball_ramp_stiffness
        most = level(p.ball_ramp_ratio * torque, w, p)
        sigma = p.ball_ramp_bristle_stiffness
        if twist > 0.0:
            way = h * w / p.gear_ratio
            if p.ball_ramp_exponent == 1.0:
                y.ramp_bristle = (y.ramp_bristle + way) / (1.0 + sigma * abs(way) / most)  # (8)
            else:
                left = 1.0 - sigma * y.ramp_bristle / most * (1.0 if way > 0.0 else -1.0)
                y.ramp_bristle += (
                    way * abs(left) ** p.ball_ramp_exponent * (1.0 if left > 0.0 else -1.0)
                )
        y.ramp_bristle = limited(y.ramp_bristle, most / sigma)
        load = torque + home
        if twist > 0.0:
            load += sigma * y.ramp_bristle  # (9)
    if p.foreign_jam > 0.0:
        y.motor_speed = 0.0
    elif c.bench != ROTOR_HELD:
        net = Kt * y.current - friction - load / p.gear_ratio - p.foreign_load
        y.motor_speed += h / p.motor_inertia * net
        y.motor_angle += h * y.motor_speed
    if c.bench < MOTOR_ALONE:
        y.plate = press(
            y.plate, y.motor_angle / p.gear_ratio, y.free_play + p.foreign_play, h, c.bench, p
        )
    loss = R * y.current * y.current + p.foreign_armature_heat
    cooling = p.armature_conductance * (y.temp_armature - c.oil)
    y.temp_armature += h / p.armature_heat_capacity * (loss - cooling)


@compiled
def slide(
    y: Record, slip: float, h: float, oil: float, stiffness: float, p: Record
) -> tuple[float, float]:
    """Clutch torque and friction potential, Nm, after slipping for h s."""
    force, _ = pack(y.plate - y.free_play - p.foreign_play, p)
    mu = friction_coefficient(slip, oil, y.temp_pack, p)
    potential = mu * p.friction_surfaces * p.equivalent_radius * force
    most = potential / stiffness + p.differential_backlash
    y.wind_up = limited(y.wind_up + h * slip, most)
    z = max(y.wind_up - p.differential_backlash, 0.0) + min(
        y.wind_up + p.differential_backlash, 0.0
    )
    return stiffness * z + p.drag * slip / 10.0 + p.foreign_film, potential


@compiled
def run(profile: NDArray, fast: int, y: Record, p: Record, out: Floats) -> None:
    """Along ``profile`` (K), rows ``fast`` steps apart, from its first row to its last; ``out``
    (K, RECORD) is filled."""
    h = STEP
    wheels = 1.0 / (1.0 / p.torsional_stiffness + 0.5 / p.halfshaft_stiffness)
    torque, potential, slip = 0.0, 0.0, 0.0
    for k in range(len(profile)):
        c = profile[k]
        last = profile[max(k - 1, 0)]
        for i in range(fast if k > 0 else 0):
            share = (i + 1.0) / fast
            asked = last.asked + share * (c.asked - last.asked)
            driven = last.driven + share * (c.driven - last.driven)
            if i % SAMPLED == 0:
                control(y, asked, driven, c, SAMPLED * h, p)
            pushing = y.servo_torque  # at the step's begin: by that at its end the mass is early
            if c.drive == TORQUE:
                y.servo_torque = driven
            actuate(y, c, h, p)
            if c.drive == WHEELS:
                slip = driven
                torque, potential = slide(y, slip, h, c.oil, wheels, p)
            else:
                slip = y.drive_speed / p.final_drive_ratio
                torque, potential = slide(y, slip, h, c.oil, p.torsional_stiffness, p)
                sign = limited(y.drive_speed / 0.02, 1.0)
                net = pushing - p.driveline_friction * sign - torque / p.final_drive_ratio
                y.drive_speed += h / p.structure_inertia * net
                y.drive_angle += h * y.drive_speed
            power = torque * slip
            y.energy += h * power
            y.free_play += h * p.wear_rate * 1e-6 * power
            cooling = p.pack_oil_conductance * (y.temp_pack - c.oil)
            heat = power - cooling + p.foreign_pack_heat
            y.temp_pack += h / p.pack_heat_capacity * heat
        warm = y.temp_armature - p.armature_reference_temp
        force, _ = pack(y.plate - y.free_play - p.foreign_play, p)
        if c.bench == NO_PACK:
            force = 0.0
        row = out[k]
        row[0], row[1], row[2] = y.current, y.motor_speed, y.motor_angle
        row[3], row[4] = force, y.free_play + p.foreign_play
        row[5] = p.friction_coefficient / p.known_friction
        row[6], row[7], row[8], row[9] = y.temp_pack, y.temp_armature, torque, slip
        row[10] = y.voltage
        row[11] = p.torque_constant * (1 + p.torque_constant_temp_coefficient * warm) * y.current
        row[12], row[13], row[14], row[15] = y.servo_torque, y.drive_angle, c.oil, y.energy
        held = abs(torque - p.drag * slip / 10.0 - p.foreign_film) < 0.999 * potential
        row[16] = 0.0 if force <= 0.0 else (2.0 if held else 1.0)
        row[17], row[18], row[19] = y.wind_up, y.plate, c.asked
