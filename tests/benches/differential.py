"""The active differential on its rig: two engagements, the slip turning round in the first."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import log, pi

import numpy as np

from benches import Plausible, Setup
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

# s against the motor's angle, rad: home, through the free play, pressed, eased, pressed, home
_TIME = (0.0, 0.3, 0.5, 0.9, 1.2, 1.4, 1.6, 1.8, 2.1, 2.4)
_ANGLE = (0.0, 0.0, 18.0, 21.0, 21.0, 19.0, 19.5, 20.0, 0.0, 0.0)
_TURNS = ((0.0, 1.3, 1.5, 2.6, 2.9, 4.8), (1.6, 1.6, -1.0, -1.0, 0.4, 0.4))  # slip, rad/s
_OIL = 80.0  # °C
_WARM = {"temp_pack": 110.0, "temp_armature": 60.0}
_FINE = 1e-3  # s


def drive(vehicle: Vehicle, duration: float, noise: float) -> Signals:
    """The motor's angle and the slip are prescribed, corners rounded over 60 ms; current, voltage
    and torque are those that the nominal equations ask for, quasi-static but for the rotor.

    Sample times are irregular; ``noise`` scales the vehicle file's sensor noise.
    """
    p = {key: value.value for key, value in vehicle.parameters.items()}
    grid = np.arange(-0.1, duration + 0.1, _FINE)
    angle = _rounded(np.interp(grid % _TIME[-1], _TIME, _ANGLE))
    slip = _rounded(np.interp(grid, *_TURNS))
    speed = np.gradient(angle, _FINE)
    force, load = _pressed(p, angle, speed)
    inertia = p["motor_inertia"] * np.gradient(speed, _FINE)
    warmth = _WARM["temp_armature"] - p["armature_reference_temp"]
    factor = p["torque_constant"] * (1 + p["torque_constant_temp_coefficient"] * warmth)
    resistance = p["armature_resistance"] * (1 + p["resistance_temp_coefficient"] * warmth)
    current = (load + inertia + _bearing(p, speed)) / factor
    voltage = resistance * current + p["back_emf_constant"] * speed
    voltage += p["armature_inductance"] * np.gradient(current, _FINE)
    torque = _wound(p, slip, force)

    def along(values: Floats) -> Callable[[Floats], Floats]:
        return lambda t: np.interp(t, grid, values)

    columns: dict[str, tuple[str, float, Callable[[Floats], Floats]]] = {
        "armature_voltage": ("V", 0.01, along(voltage)),
        "armature_current": ("A", 0.01, along(current)),
        "motor_angle": ("rad", 0.01, along(angle)),
        "slip_speed": ("rad/s", 0.01, along(slip)),
        "clutch_torque": ("Nm", 0.01, along(torque)),
        "oil_temp": ("°C", 0.2, lambda t: _OIL + 0.2 * t),
        "armature_temp": ("°C", 0.2, lambda t: _WARM["temp_armature"] + 0.2 * t),
    }
    rng = np.random.default_rng(7)
    signals = {}
    for name, (unit, period, at) in columns.items():
        t = np.arange(0.0, duration, period)
        t = t + rng.uniform(0.0, 0.1 * period, len(t))
        value = at(t) + noise * vehicle.signals[name].noise * rng.standard_normal(len(t))
        signals[name] = Signal.of(name, unit, t, value)
    return Signals(signals, end=duration)


def _rounded(course: Floats) -> Floats:
    window = np.hanning(round(0.06 / _FINE))
    half = len(window) // 2
    course = np.pad(course, half, mode="edge")
    return np.convolve(course, window / window.sum(), mode="same")[half:-half]


def _spring(p: Mapping[str, float], s: float) -> float:
    """Almen and Laszlo's force, N."""
    thick, high = p["spring_thickness"], p["spring_cone_height"]
    ratio = p["spring_outer_diameter"] / p["spring_inner_diameter"]
    shape = ((ratio - 1) / ratio) ** 2 / ((ratio + 1) / (ratio - 1) - 2 / log(ratio)) / pi
    scale = 4 * p["spring_young"] / (1 - p["spring_poisson"] ** 2)
    scale *= thick / (shape * p["spring_outer_diameter"] ** 2)
    return float(scale * s * ((high - s) * (high - s / 2) + thick**2))


def _pressed(p: Mapping[str, float], angle: Floats, speed: Floats) -> tuple[Floats, Floats]:
    """Pack force, N, and what ball ramp and its friction ask of the motor, Nm."""
    ramp, stiffness = p["ball_ramp_ratio"], p["ball_ramp_stiffness"]
    back = _spring(p, p["spring_preload"] + p["free_play"])
    beyond = angle / p["gear_ratio"] - p["gear_backlash"]
    share = p["pack_stiffness"] / (stiffness * ramp**2 + p["pack_stiffness"])
    past = beyond - ramp * p["free_play"]
    force = share * np.maximum(stiffness * ramp * past - back, 0.0)
    film = p["axial_damping"] * speed / (p["gear_ratio"] * ramp)
    lifted = np.minimum(stiffness * np.maximum(beyond, 0.0), np.maximum(back + film, 0.0) / ramp)
    push = np.maximum(lifted, np.where(force > 0.0, (force + back) / ramp, 0.0))
    rubbing = p["ball_ramp_friction"] * p["ball_ramp_bore"] / 2 * ramp * push
    bent, bend = np.zeros(len(angle)), 0.0
    for k in range(1, len(angle)):  # the bristle follows the angle, held where that rests
        most = max(rubbing[k], 1e-4) / p["ball_ramp_bristle_stiffness"]
        way = (angle[k] - angle[k - 1]) / p["gear_ratio"] if beyond[k] > 0.0 else 0.0
        bend = min(max(bend + way - abs(way) * bend / most, -most), most)
        bent[k] = p["ball_ramp_bristle_stiffness"] * bend if beyond[k] > 0.0 else 0.0
    return force, (push + bent) / p["gear_ratio"]


def _bearing(p: Mapping[str, float], speed: Floats) -> Floats:
    """Friction of the motor's bearings, Nm, its sign turning over the Stribeck speed."""
    ratio = speed / p["motor_stribeck_speed"]
    coulomb, static = p["motor_coulomb_torque"], p["motor_static_torque"]
    level = coulomb + (static - coulomb) * np.exp(-(np.abs(ratio) ** p["motor_stribeck_exponent"]))
    return level * np.tanh(ratio) + p["motor_viscous"] * speed


def _wound(p: Mapping[str, float], slip: Floats, force: Floats) -> Floats:
    """Clutch torque, Nm: play and structure wind up with slip until the surfaces slide."""
    potential = p["friction_coefficient"] * p["friction_surfaces"] * p["equivalent_radius"] * force
    stiffness, play, wound = p["torsional_stiffness"], p["differential_backlash"], 0.0
    torque = np.empty(len(slip))
    for k, most in enumerate(potential / stiffness + play):
        wound = min(max(wound + _FINE * slip[k], -most), most)
        torque[k] = stiffness * (max(wound - play, 0.0) + min(wound + play, 0.0))
    return torque


_PLAUSIBLE = Plausible(
    states={
        "current": (-30.0, 30.0),
        "motor_speed": (-300.0, 300.0),
        "motor_angle": (-2.0, 30.0),
        "ball_ramp_bristle": (-0.2, 0.2),
        "pack_force": (0.0, 4e4),
        "wind_up": (-0.1, 0.1),
        "free_play": (0.0, 5e-4),
        "friction": (0.5, 1.5),
        "temp_pack": (-40.0, 250.0),
        "temp_armature": (-40.0, 180.0),
    },
    inputs={
        "armature_voltage": (-12.0, 12.0),
        "slip_speed": (-12.0, 12.0),
        "oil_temp": (-40.0, 130.0),
    },
    temperatures=("temp_pack", "temp_armature"),
    surroundings=("oil_temp",),
    resting={"slip_speed": 0.0, "current": 0.0},
    warm=_WARM,
    wound={"wind_up": "slip_speed"},
)
_CATALOGUE = {
    "resistance_temperature": "change 1/K",
    "torque_constant_temperature": "change 1/K",
    "motor_friction": "change 1",
    "supply_drop": "+ resistance Ω",
    "backlash_growth": "+ growth rad",
    "free_play_growth": "+ growth m, rate m/MJ",
    "ball_ramp_friction": "change 1",
    "pack_stiffness": "change 1",
    "spring_preload": "change 1",
    "friction_level": "change 1",
    "angle_offset": "offset rad",
    "current_gain": "change 1",
    "torque_sensor_gain": "change 1",
    "friction_slip": "change 1, speed rad/s",
    "friction_fade": "+ slope 1/(100 K), onset °C",
    "friction_oil_temperature": "slope 1/(100 K)",
    "viscous_drag": "+ coefficient Nm s/(10 rad)",
}
DIFFERENTIAL = Setup("alsd_rig", drive, 4.8, ("open", "slipping", "locked"), _PLAUSIBLE, _CATALOGUE)
