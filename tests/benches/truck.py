"""The truck's clutch: launches every 12 s."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from benches import Plausible, Setup
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

# phase of a launch, s, against slip and input-shaft speed in rad/s, and openness of the clutch
_SLIP = ((0.0, 3.0, 5.5, 11.0, 12.0), (60.0, 70.0, 0.0, 0.0, 60.0))
_SHAFT = ((0.0, 3.0, 6.0, 10.0, 12.0), (40.0, 40.0, 70.0, 70.0, 40.0))
_HOME = ((5.8, 6.2, 10.6, 11.0), (1.0, 0.0, 0.0, 1.0))
_GRIP = (0.0, 2.0, 2.6, 3.6, 5.4, 5.8, 6.2, 10.6, 11.0, 12.0)
_POSITION = (12.0, 12.0, 7.5, 4.8, 4.5, 4.0, 0.0, 0.0, 12.0, 12.0)  # mm, of the cold clutch
_WARM = {"temp_body": 120.0, "temp_housing": 60.0, "temp_disc": 300.0}


def drive(vehicle: Vehicle, duration: float, noise: float) -> Signals:
    """Launches every 12 s: the clutch waits open, slips, locks and rests with the actuator home.

    Speeds and the corrected position are prescribed; the engine gives the nominal torque and its
    own inertia's; the actuator makes up for the expansion of a clutch that starts hot.  Sample
    times are irregular; ``noise`` scales the vehicle file's sensor noise.
    """
    p = {key: value.value for key, value in vehicle.parameters.items()}

    def along(t: Floats, course: tuple[tuple[float, ...], tuple[float, ...]]) -> Floats:
        return np.interp(t % 12.0, *course)

    def engine_speed(t: Floats) -> Floats:
        return along(t, _SHAFT) + along(t, _SLIP)

    def corrected_position(t: Floats) -> Floats:
        return along(t, (_GRIP, _POSITION)) + 0.05 * along(t, _HOME) * np.abs(t % 2.0 - 1.0)

    def torque(t: Floats) -> Floats:
        c = np.minimum(corrected_position(t) - p["kiss_point"], 0.0)
        return p["torque_cubic"] * c**3 + p["torque_quadratic"] * c**2

    def engine_torque(t: Floats) -> Floats:
        inertia = p["engine_inertia"] * (engine_speed(t + 0.01) - engine_speed(t - 0.01)) / 0.02
        return np.where(along(t, _SLIP) > 0.0, torque(t), 300.0) + inertia

    grid = np.arange(0.0, duration, 0.01)
    warmth = _expansion(p, torque(grid) * along(grid, _SLIP), 0.01)

    def reading(t: Floats) -> Floats:
        return p["position_origin"] + corrected_position(t) + np.interp(t, grid, warmth)

    columns: dict[str, tuple[str, float, Callable[[Floats], Floats]]] = {
        "engine_speed": ("rad/s", 0.01, engine_speed),
        "input_shaft_speed": ("rad/s", 0.01, lambda t: along(t, _SHAFT)),
        "engine_torque": ("Nm", 0.01, engine_torque),
        "slave_position": ("mm", 0.01, reading),
        "motor_position": ("mm", 0.01, lambda t: 12.0 * along(t, _HOME)),
        "coolant_temp": ("°C", 1.0, lambda t: 85.0 + 0.02 * t),
        "ambient_temp": ("°C", 1.0, lambda t: 15.0 + 0.0 * t),
        "vehicle_speed": ("m/s", 0.1, lambda t: 8.0 + 0.1 * t),
    }
    rng = np.random.default_rng(7)
    signals = {}
    for name, (unit, period, at) in columns.items():
        t = np.arange(0.0, duration, period)
        t = t + rng.uniform(0.0, 0.1 * period, len(t))
        value = at(t) + noise * vehicle.signals[name].noise * rng.standard_normal(len(t))
        signals[name] = Signal.of(name, unit, t, value)
    return Signals(signals, end=duration)


def _expansion(p: Mapping[str, float], power: Floats, dt: float) -> Floats:
    """Expansion, mm, of a clutch that starts hot and takes this slip power, W; shape as given."""
    body, housing, disc = _WARM.values()
    expansion = np.empty(len(power))
    for k, heat in enumerate(power):
        over = disc - body
        expansion[k] = p["expansion_body"] * (body - p["reference_temp"])
        expansion[k] += p["expansion_disc"] * min(over, p["disc_body_temp_cap"])
        to_housing = p["conductance_body_housing"] * (body - housing)
        from_engine = p["conductance_engine_body"] * (85.0 - body)
        to_air = p["conductance_housing_ambient"] * (housing - 15.0)
        to_body = p["conductance_disc_body"] * over
        body += dt * (from_engine + to_body - to_housing) / p["heat_capacity_body"]
        housing += dt * (to_housing - to_air) / p["heat_capacity_housing"]
        disc += dt * (heat - to_body) / p["heat_capacity_disc"]
    return expansion


_PLAUSIBLE = Plausible(
    states={
        "temp_body": (-40.0, 200.0),
        "temp_housing": (-40.0, 150.0),
        "temp_disc": (-40.0, 300.0),
        "zero_position": (35.4, 38.9),
        "friction": (0.5, 1.5),
        "engine_speed": (40.0, 250.0),
        "torque_bias": (-200.0, 200.0),
        "wear_rate": (-0.5, 0.5),
        "position_play": (-0.5, 0.5),
    },
    inputs={
        "engine_torque": (-500.0, 3500.0),
        "input_shaft_speed": (0.0, 250.0),
        "slave_position": (37.9, 51.4),
        "coolant_temp": (-30.0, 110.0),
        "ambient_temp": (-40.0, 50.0),
        "vehicle_speed": (0.0, 30.0),
        "engine_acceleration": (-200.0, 200.0),
    },
    temperatures=("temp_body", "temp_housing", "temp_disc"),
    surroundings=("coolant_temp", "ambient_temp"),
    resting={"input_shaft_speed": 100.0, "engine_speed": 100.0},
    warm=_WARM,
    beyond={"transmission_heat_path": (80.0,)},
)
_CATALOGUE = {
    "wear": "+ amount mm, rate mm/MJ",
    "position_offset": "offset mm",
    "friction_level": "change 1",
    "friction_slip": "change 1, speed rad/s",
    "friction_speed": "slope s/(100 rad)",
    "friction_temperature": "slope 1/(100 K)",
    "friction_fade": "+ slope 1/(100 K), onset °C",
    "torque_gain": "change 1",
    "torque_bias": "bias Nm",
    "torque_delay": "+ delay s",
    "position_delay": "+ delay s",
    "engine_inertia": "change 1",
    "kiss_point": "shift mm",
    "torque_curve": "change 1/mm",
    "expansion_body": "change 1",
    "expansion_disc": "change 1",
    "heat_capacity_disc": "change 1",
    "heat_capacity_body": "change 1",
    "heat_split": "fraction 1",
    "transmission_heat_path": "+ conductance W/K",
    "coolant_coupling": "change 1",
    "housing_airflow": "slope s/(20 m)",
    "position_hysteresis": "+ play mm",
    "centrifugal": "slope s^2/(100 rad)^2",
    "viscous_drag": "+ coefficient Nm s/(100 rad)",
}
TRUCK = Setup(
    "truck", drive, 60.0, ("open", "slipping", "locked", "retracted"), _PLAUSIBLE, _CATALOGUE
)
