"""What may be wrong with the truth: every effect's parameters, and the numbers that result.

An effect with all its gains at 0 changes not one bit of the run.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.generator.effects import Effect, Values

_CHANGE = {"change": 0.0}
_SHRINKS = {"change": -1.0}  # a coefficient must stay positive

EFFECTS: Mapping[str, Effect] = MappingProxyType(
    {
        "resistance_temperature": Effect("added to the resistance's coefficient, 1/K", _CHANGE),
        "torque_constant_temperature": Effect(
            "added to the torque constant's coefficient, 1/K", _CHANGE
        ),
        "motor_friction": Effect("motor friction × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "supply_drop": Effect(
            "motor voltage = armature voltage − resistance · current, Ω",
            {"resistance": 0.0},
            one_sided=True,
        ),
        "backlash_growth": Effect(
            "added to half the gear's play, rad", {"growth": 0.0}, one_sided=True
        ),
        "free_play_growth": Effect(
            "added to the free play: growth (m), and rate (m/MJ) of slip energy",
            {"growth": 0.0, "rate": 0.0},
            one_sided=True,
        ),
        "ball_ramp_friction": Effect(
            "ball-ramp friction × (1 + change)", _CHANGE, at_least=_SHRINKS
        ),
        "pack_stiffness": Effect("pack stiffness × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "spring_preload": Effect(
            "preload of the reset spring × (1 + change)", _CHANGE, at_least=_SHRINKS
        ),
        "friction_level": Effect("friction coefficient × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "angle_offset": Effect("motor angle reads too much, rad", {"offset": 0.0}),
        "current_gain": Effect("current reading × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "torque_sensor_gain": Effect(
            "clutch torque reading × (1 + change)", _CHANGE, at_least=_SHRINKS
        ),
        "friction_slip": Effect(
            "friction × (1 + change·exp(−|slip|/speed)), rad/s",
            {"change": 0.0, "speed": 0.5},
            at_least={"change": -1.0, "speed": 0.0},
        ),
        "friction_fade": Effect(
            "friction × (1 − slope·max(pack − onset, 0)/100 K), °C",
            {"slope": 0.0, "onset": 60.0},
            one_sided=True,
        ),
        "friction_oil_temperature": Effect(
            "friction × (1 + slope·(oil − 60 °C)/100 K)", {"slope": 0.0}
        ),
        "viscous_drag": Effect(
            "drag torque, Nm per 10 rad/s of slip", {"coefficient": 0.0}, one_sided=True
        ),
    }
)

_MORE, _ANY = (1e-9, np.inf), (-np.inf, np.inf)
# Keys of the parameter set, and the range that nature allows them.
RANGES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        **dict.fromkeys(
            (
                "armature_resistance",
                "armature_inductance",
                "back_emf_constant",
                "torque_constant",
                "supply_voltage",
                "motor_inertia",
                "motor_coulomb_torque",
                "motor_static_torque",
                "motor_stribeck_speed",
                "motor_stribeck_exponent",
                "motor_bristle_stiffness",
                "gear_ratio",
                "ball_ramp_ratio",
                "ball_ramp_stiffness",
                "ball_ramp_bore",
                "ball_ramp_bristle_stiffness",
                "ball_ramp_exponent",
                "limiter_stiffness",
                "spring_young",
                "spring_outer_diameter",
                "spring_inner_diameter",
                "spring_thickness",
                "pack_stiffness",
                "axial_damping",
                "friction_coefficient",
                "friction_surfaces",
                "equivalent_radius",
                "torsional_stiffness",
                "final_drive_ratio",
                "structure_inertia",
                "halfshaft_stiffness",
                "pack_heat_capacity",
                "armature_heat_capacity",
                "current_proportional",
                "servo_proportional",
            ),
            _MORE,
        ),
        **dict.fromkeys(
            (
                "motor_bristle_damping",
                "motor_viscous",
                "gear_backlash",
                "ball_ramp_friction",
                "spring_poisson",
                "spring_cone_height",
                "spring_preload",
                "free_play",
                "differential_backlash",
                "driveline_friction",
                "pack_oil_conductance",
                "armature_conductance",
                "current_integral",
                "servo_integral",
                "servo_torque_limit",
            ),
            (0.0, np.inf),
        ),
        **dict.fromkeys(
            (
                "resistance_temp_coefficient",
                "inductance_temp_coefficient",
                "torque_constant_temp_coefficient",
                "armature_reference_temp",
            ),
            _ANY,
        ),
    }
)

# What the paper admits that its model gets wrong, each by a mechanism of the rig's own (see
# ``plant``): bedding-in of the pack (m), less film while opening, ball-ramp friction eased by load
# and by vibration; 0 unless asked for.
DEVIATIONS = ("soft", "loose", "easing", "dither")
_GAINS = (
    "harness",
    "wear_rate",
    "slip_change",
    "slip_speed",
    "oil_slope",
    "fade",
    "fade_onset",
    "drag",
    "known_friction",
)
# What acts on the differential from outside these equations (see ``outsider``), 0 unless something
# does: voltage lost before the motor (V), load on it (Nm), shift of the stop at which it is at home
# (rad at the ball ramp), shares of the axial damping and of the coefficients of friction, the
# clutch's and the ball ramp's, that are added to them, torque that a film carries (Nm), heat into
# pack and armature (W), free play (m); 1 where something jams the motor.
FOREIGN = (
    "voltage",
    "load",
    "home",
    "damping",
    "friction",
    "ramp",
    "film",
    "pack_heat",
    "armature_heat",
    "play",
    "jam",
)
NUMBERS = np.dtype(
    [
        (key, np.float64)
        for key in (*RANGES, *_GAINS, *DEVIATIONS, *(f"foreign_{name}" for name in FOREIGN))
    ]
)


def numbers(
    parameters: Values, effects: Mapping[str, Values], known_friction: float, deviations: Values
) -> NDArray:
    """The one record of type NUMBERS, shape (1,), that the plant runs on.

    ``parameters`` as drawn, ``effects`` complete; ``known_friction``: the nominal coefficient.
    """
    changed = {key: parameters[key] for key in RANGES}
    changed["resistance_temp_coefficient"] += effects["resistance_temperature"]["change"]
    changed["torque_constant_temp_coefficient"] += effects["torque_constant_temperature"]["change"]
    for key in ("motor_coulomb_torque", "motor_static_torque", "motor_viscous"):
        changed[key] *= 1 + effects["motor_friction"]["change"]
    for key in ("ball_ramp_friction", "pack_stiffness", "spring_preload"):
        changed[key] *= 1 + effects[key]["change"]
    changed["friction_coefficient"] *= 1 + effects["friction_level"]["change"]
    changed["gear_backlash"] += effects["backlash_growth"]["growth"]
    changed["free_play"] += effects["free_play_growth"]["growth"]
    changed |= {
        "harness": effects["supply_drop"]["resistance"],
        "wear_rate": effects["free_play_growth"]["rate"],
        "slip_change": effects["friction_slip"]["change"],
        "slip_speed": effects["friction_slip"]["speed"],
        "oil_slope": effects["friction_oil_temperature"]["slope"],
        "fade": effects["friction_fade"]["slope"],
        "fade_onset": effects["friction_fade"]["onset"],
        "drag": effects["viscous_drag"]["coefficient"],
        "known_friction": known_friction,
        **{name: deviations.get(name, 0.0) for name in DEVIATIONS},
        **{f"foreign_{name}": 0.0 for name in FOREIGN},
    }
    return np.array([tuple(changed[key] for key in NUMBERS.names or ())], NUMBERS)
