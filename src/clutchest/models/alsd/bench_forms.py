"""The fitted form of the equations on each bench: what is removed or held there."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping

from clutchest.models.alsd import ball_ramp, dc_motor, pack
from clutchest.models.alsd.fitted import to_fit
from clutchest.models.model import Model, Quantities


def rotor_held(q: Quantities) -> None:
    """ω_m1 = 0."""
    q.motor_speed_rate = 0.0
    q.motor_angle_rate = 0.0


def no_gear(q: Quantities) -> None:
    """The motor without its gear: nothing loads it but its own friction."""
    q.input_angle = q.motor_angle / q.gear_ratio
    q.contact = 0.0
    q.ball_ramp_torque = 0.0
    q.ball_ramp_force = 0.0
    q.home_torque = 0.0


def output_held(q: Quantities) -> None:
    """The ball ramp's output is held: d_pp stays where it is."""
    q.plate_speed = 0.0
    q.plate_position_rate = 0.0


Form = Callable[[Container[str]], Model]
FORMS: Mapping[str, Form] = {
    "rotor-held": lambda names: to_fit(names).swap(dc_motor.rotor, rotor_held),
    "motor-alone": lambda names: to_fit(names).swap(ball_ramp.gear, no_gear),
    "no-pack": lambda names: to_fit(names).swap(pack.pack, pack.no_pack),
    "output-fixed": lambda names: to_fit(names).swap(pack.plate, output_held),
    "rig": to_fit,
    "car": to_fit,
}
