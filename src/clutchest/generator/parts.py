"""The parts of ``structure.Structure`` at work: heat in more masses, a soft driveline, an engine
that lags behind its report.

Its text joins that of the truck's other files in one generated module: see ``generator.plant``.
"""

from __future__ import annotations

from clutchest.generator.situation import (
    BODY,
    DELIVERED,
    DISC,
    FACES,
    FLYWHEEL,
    HOUSING,
    REAR,
    SHAFT,
    SPEED,
    STRETCH,
    TORQUE,
    Record,
)
from clutchest.generator.structure import (
    CURVE_POINTS,
    DEEPEST,
)
from clutchest.generator.surroundings import (
    GEARBOX_TEMP,
)
from clutchest.native import compiled
from clutchest.signals import Floats

# --- the generated module goes on from here ---

RELAXING = 0.05  # s: a driveline out of gear untwists


@compiled
def curve_error(depth: float, p: Record) -> float:
    """The torque curve's relative error ``depth`` mm below the kiss point."""
    place = min(depth / DEEPEST, 1.0) * (CURVE_POINTS - 1)
    row = min(int(place), CURVE_POINTS - 2)
    return p.curve[row] + (place - row) * (p.curve[row + 1] - p.curve[row])


@compiled
def delivered(y: Floats, p: Record) -> float:
    """What the engine delivers, Nm; its report is y[TORQUE]."""
    return y[DELIVERED] if p.delivery_lag > 0.0 else y[TORQUE]


@compiled
def is_soft(s: Record, p: Record) -> bool:
    """Whether a soft driveline lies between the gearbox and the truck."""
    return p.driveline_stiffness > 0.0 and s.ratio > 0.0


@compiled
def pull(y: Floats, s: Record, p: Record) -> float:
    """The force of a soft driveline on the truck, N."""
    speed = y[SHAFT] / s.ratio - y[SPEED]
    return p.driveline_stiffness * y[STRETCH] + p.driveline_damping * speed


@compiled
def settle(y: Floats, coolant: float, ambient: float, p: Record) -> None:
    """What the parts begin with: as warm as is steady beside the other masses, no stretch."""
    inner, outer = p.flywheel_conductance, p.conductance_engine_body
    share = outer / inner if inner > 0.0 else 0.0
    y[FLYWHEEL] = y[BODY] + share * (coolant - y[BODY])
    inner, outer = p.housing_conductance, p.housing_rear * p.conductance_housing_ambient
    share = outer / (inner + outer) if inner > 0.0 else 0.0
    y[REAR] = y[HOUSING] + share * (ambient - y[HOUSING])
    y[DELIVERED] = y[TORQUE]


@compiled
def lag_and_stretch(y: Floats, s: Record, p: Record, out: Floats) -> None:
    """Rates of the engine's torque behind its report and of the driveline's stretch in m."""
    lag = p.delivery_lag
    out[DELIVERED] = (y[TORQUE] - y[DELIVERED]) / lag if lag > 0.0 else 0.0
    if is_soft(s, p):
        out[STRETCH] = y[SHAFT] / s.ratio - y[SPEED]
    else:
        out[STRETCH] = -y[STRETCH] / RELAXING


@compiled
def heat_in_parts(y: Floats, power: float, s: Record, p: Record, out: Floats) -> None:
    """Rates of all temperatures, with the slip ``power`` W; y[DISC] is the disc's mean, y[FACES]
    by how much its faces are hotter than its core."""
    faces, wheel, rear = p.disc_faces, p.flywheel, p.housing_rear
    touching = y[DISC] + (1.0 - faces) * y[FACES] if faces > 0.0 else y[DISC]
    body_share = 0.5 if wheel > 0.0 else 1.0
    to_body = body_share * p.conductance_disc_body * (touching - y[BODY])
    to_wheel = (1.0 - body_share) * p.conductance_disc_body * (touching - y[FLYWHEEL])
    to_disc = (1.0 - p.heat_fraction_body) * power - to_body - to_wheel
    out[DISC] = (to_disc + s.foreign_disc_heat) / p.heat_capacity_disc
    out[FACES] = 0.0
    if faces > 0.0:
        inward = p.disc_conductance * y[FACES] / (faces * (1.0 - faces))
        out[FACES] = (to_disc / faces - inward) / p.heat_capacity_disc

    to_body += p.heat_fraction_body * power * body_share + s.foreign_body_heat
    to_body -= p.gearbox_conductance * (y[BODY] - GEARBOX_TEMP)
    to_front = p.conductance_body_housing * (y[BODY] - y[HOUSING])
    coolant, between = p.conductance_engine_body, p.flywheel_conductance
    out[FLYWHEEL] = 0.0
    if wheel > 0.0:
        coolant = coolant * between / (between - coolant)  # at rest the body feels the same
        to_wheel += p.heat_fraction_body * power * (1.0 - body_share)
        to_wheel += coolant * (s.coolant - y[FLYWHEEL]) - between * (y[FLYWHEEL] - y[BODY])
        out[FLYWHEEL] = to_wheel / (wheel * p.heat_capacity_body)
        to_body += between * (y[FLYWHEEL] - y[BODY])
    else:
        to_body += coolant * (s.coolant - y[BODY])
    out[BODY] = (to_body - to_front) / ((1.0 - wheel) * p.heat_capacity_body)

    outward = p.conductance_housing_ambient * (1.0 + p.airflow_slope * y[SPEED] / 20.0)
    to_front += s.foreign_housing_heat - (1.0 - rear) * outward * (y[HOUSING] - s.ambient)
    out[REAR] = 0.0
    if rear > 0.0:
        backward = p.housing_conductance * (y[HOUSING] - y[REAR])
        to_front -= backward
        to_rear = backward - rear * outward * (y[REAR] - s.ambient)
        out[REAR] = to_rear / (rear * p.heat_capacity_housing)
    out[HOUSING] = to_front / ((1.0 - rear) * p.heat_capacity_housing)
