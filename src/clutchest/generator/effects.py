"""What may be wrong with the truck: every effect's parameters, and the numbers that result.

An effect with all its gains at 0 changes not one bit of the drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError, nearest
from clutchest.generator import structure
from clutchest.generator.structure import Structure

Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Effect:
    """``what`` it does, its ``parameters`` (name → value where none is given), and whether it is
    ``one_sided``: only positive values are physical."""

    what: str
    parameters: Values
    one_sided: bool = False
    at_least: Values = field(default_factory=dict)  # parameter → bound that must be exceeded


# Per name of a parameter, a magnitude that no truck reaches: beyond it a drive is nonsense.
LARGEST: Values = MappingProxyType(
    {
        "amount": 20.0,
        "rate": 10.0,
        "offset": 20.0,
        "shift": 5.0,
        "play": 5.0,  # mm, mm/MJ
        "change": 4.0,
        "slope": 5.0,
        "fraction": 1.0,
        "speed": 1e3,
        "onset": 1e3,  # –, rad/s, °C
        "bias": 3500.0,
        "coefficient": 1e4,
        "conductance": 1e4,
        "delay": 2.0,  # Nm, W/K, s
    }
)

_CHANGE = {"change": 0.0}
_SHRINKS = {"change": -1.0}  # a coefficient must stay positive

EFFECTS: Mapping[str, Effect] = MappingProxyType(
    {
        "wear": Effect(
            "pads thinner by amount (mm), and by rate (mm/MJ) of slip energy",
            {"amount": 0.0, "rate": 0.0},
            one_sided=True,
        ),
        "position_offset": Effect("slave sensor reads too much, mm", {"offset": 0.0}),
        "friction_level": Effect("torque × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "friction_slip": Effect(
            "torque × (1 + change·exp(−|slip|/speed)), rad/s",
            {"change": 0.0, "speed": 10.0},
            at_least={"change": -1.0, "speed": 0.0},
        ),
        "friction_speed": Effect("torque × (1 + slope·|slip|/100 rad/s)", {"slope": 0.0}),
        "friction_temperature": Effect(
            "torque × (1 + slope·(disc − 100 °C)/100 K)", {"slope": 0.0}
        ),
        "friction_fade": Effect(
            "torque × (1 − slope·max(disc − onset, 0)/100 K)",
            {"slope": 0.0, "onset": 200.0},
            one_sided=True,
        ),
        "torque_gain": Effect("reported engine torque × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "torque_bias": Effect("reported engine torque + bias, Nm", {"bias": 0.0}),
        "torque_delay": Effect("reported engine torque is late, s", {"delay": 0.0}, one_sided=True),
        "position_delay": Effect("slave position is late, s", {"delay": 0.0}, one_sided=True),
        "engine_inertia": Effect("engine inertia × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "kiss_point": Effect("kiss point + shift, mm", {"shift": 0.0}),
        "torque_curve": Effect("torque × (1 + change·depth below the kiss point in mm)", _CHANGE),
        "expansion_body": Effect(
            "expansion by the body × (1 + change)", _CHANGE, at_least=_SHRINKS
        ),
        "expansion_disc": Effect(
            "expansion by the disc × (1 + change)", _CHANGE, at_least=_SHRINKS
        ),
        "heat_capacity_disc": Effect("disc's capacity × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "heat_capacity_body": Effect("body's capacity × (1 + change)", _CHANGE, at_least=_SHRINKS),
        "heat_split": Effect("more of the slip power into the body", {"fraction": 0.0}),
        "transmission_heat_path": Effect(
            "body loses heat to a gearbox of 80 °C, W/K", {"conductance": 0.0}, one_sided=True
        ),
        "coolant_coupling": Effect(
            "engine-body conductance × (1 + change)", _CHANGE, at_least=_SHRINKS
        ),
        "housing_airflow": Effect(
            "housing-ambient conductance × (1 + slope·speed/20 m/s)", {"slope": 0.0}
        ),
        "position_hysteresis": Effect(
            "play of this half-width between slave and plate, mm", {"play": 0.0}, one_sided=True
        ),
        "centrifugal": Effect("torque × (1 + slope·(engine speed/100 rad/s)²)", {"slope": 0.0}),
        "viscous_drag": Effect(
            "drag torque, Nm per 100 rad/s of slip, also when open",
            {"coefficient": 0.0},
            one_sided=True,
        ),
    }
)

# Keys of the parameter set, and the range that nature allows them.
RANGES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        **dict.fromkeys(
            (
                "heat_capacity_body",
                "heat_capacity_housing",
                "heat_capacity_disc",
                "engine_inertia",
                "engine_torque_max",
            ),
            (1e-3, np.inf),
        ),
        **dict.fromkeys(
            (
                "conductance_engine_body",
                "conductance_body_housing",
                "conductance_housing_ambient",
                "conductance_disc_body",
                "expansion_body",
                "expansion_disc",
                "torque_quadratic",
                "disc_body_temp_cap",
            ),
            (0.0, np.inf),
        ),
        **dict.fromkeys(
            ("reference_temp", "zero_position_ref", "position_origin", "kiss_point"),
            (-np.inf, np.inf),
        ),
        "heat_fraction_body": (0.0, 1.0),
        "torque_cubic": (-np.inf, 0.0),
    }
)

_GAINS = (
    "wear_rate",
    "slip_change",
    "slip_speed",
    "speed_slope",
    "temperature_slope",
    "fade_slope",
    "fade_onset",
    "curve_change",
    "gearbox_conductance",
    "airflow_slope",
    "play",
    "centrifugal_slope",
    "drag",
)
# What the truck's own control unit believes, and the truck around the clutch.
_TRUCK = ("zero_position", "known_cubic", "known_quadratic", "known_kiss", "known_inertia", "mass")

NUMBERS = np.dtype(
    [(key, np.float64) for key in (*RANGES, *_GAINS, *_TRUCK, *structure.NAMES)]
    + [("curve", np.float64, (structure.CURVE_POINTS,))]
)


def complete(
    effects: Mapping[str, Values],
    known: Mapping[str, Effect] = EFFECTS,
    largest: Values = LARGEST,
) -> dict[str, dict[str, float]]:
    """Every effect with every parameter, those not given at their defaults.

    Raises ClutchestError for an unknown effect or parameter, and for a value nature excludes.
    """
    for name, given in effects.items():
        if name not in known:
            raise ClutchestError(f"unknown effect '{name}'" + nearest(name, known))
        effect = known[name]
        for key, value in given.items():
            if key not in effect.parameters:
                raise ClutchestError(
                    f"effect '{name}' has no parameter '{key}'" + nearest(key, effect.parameters)
                )
            if not isfinite(value):
                raise ClutchestError(f"effect '{name}': {key} = {value} is not a finite number")
            if effect.one_sided and value < 0:
                raise ClutchestError(f"effect '{name}': {key} = {value:g}, expected 0 or more")
            if value <= effect.at_least.get(key, -np.inf):
                raise ClutchestError(
                    f"effect '{name}': {key} = {value:g}, "
                    f"expected more than {effect.at_least[key]:g}"
                )
            if abs(value) > largest[key]:
                raise ClutchestError(
                    f"effect '{name}': {key} = {value:g}, expected a magnitude "
                    f"of at most {largest[key]:g}"
                )
    return {name: {**effect.parameters, **effects.get(name, {})} for name, effect in known.items()}


def numbers(
    parameters: Values,
    known: Values,
    effects: Mapping[str, Values],
    zero_position: float,
    mass: float,
    parts: Structure | None = None,
) -> NDArray:
    """The one record of type NUMBERS, shape (1,), that the plant runs on.

    ``parameters`` as drawn, ``known`` as the control unit believes them; ``effects`` complete;
    ``zero_position`` mm: x0_ref at the start, before wear; ``mass`` of the truck, kg; ``parts`` it
    has beside the plain ones.
    """
    changed = {
        key: parameters[key] * (1 + effects[key]["change"])
        if key
        in (
            "engine_inertia",
            "expansion_body",
            "expansion_disc",
            "heat_capacity_disc",
            "heat_capacity_body",
        )
        else parameters[key]
        for key in RANGES
    }
    changed["conductance_engine_body"] *= 1 + effects["coolant_coupling"]["change"]
    changed["kiss_point"] += effects["kiss_point"]["shift"]
    split = changed["heat_fraction_body"] + effects["heat_split"]["fraction"]
    changed["heat_fraction_body"] = min(max(split, 0.0), 1.0)
    changed |= {
        "wear_rate": effects["wear"]["rate"],
        "slip_change": effects["friction_slip"]["change"],
        "slip_speed": effects["friction_slip"]["speed"],
        "speed_slope": effects["friction_speed"]["slope"],
        "temperature_slope": effects["friction_temperature"]["slope"],
        "fade_slope": effects["friction_fade"]["slope"],
        "fade_onset": effects["friction_fade"]["onset"],
        "curve_change": effects["torque_curve"]["change"],
        "gearbox_conductance": effects["transmission_heat_path"]["conductance"],
        "airflow_slope": effects["housing_airflow"]["slope"],
        "play": effects["position_hysteresis"]["play"],
        "centrifugal_slope": effects["centrifugal"]["slope"],
        "drag": effects["viscous_drag"]["coefficient"],
        "zero_position": zero_position - effects["wear"]["amount"],
        "known_cubic": known["torque_cubic"],
        "known_quadratic": known["torque_quadratic"],
        "known_kiss": known["kiss_point"],
        "known_inertia": known["engine_inertia"],
        "mass": mass,
    }
    values = {**changed, **(parts or Structure()).numbers()}
    return np.array([tuple(values[key] for key in NUMBERS.names or ())], NUMBERS)
