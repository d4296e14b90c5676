"""What the paper's model lacks, each a term of one number, absent at 0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from clutchest.models.effects import Effect, Gains, Number


class PackBedding(Effect):
    """F_c = c_cl.e c²/(c + ``depth``) at the compression c: surfaces that bed in yield first.

    Source: ID08 used "a constant rough value" of the clutch stiffness.
    """

    name = "pack_bedding"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("depth", "m", 0.0, 1e-4),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"compression": lambda c, q: c * c / (c + g.depth + 1e-12)}


class BallRampDither(Effect):
    """T_C.br × (1 − ``share`` · |ω_m1|/(|ω_m1| + 20 rad/s)): vibrations of a turning motor ease it.

    Source: ID08 suspects vibrations that act as dither.
    """

    name = "ball_ramp_dither"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("share", "1", 0.0, 0.95),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def eased(level: ca.SX, q: Any) -> ca.SX:
            speed = ca.fabs(q.motor_speed)
            return level * (1 - g.share * speed / (speed + 20.0))

        return {"ball_ramp_coulomb_torque": eased}


class BallRampLoad(Effect):
    """T_C.br × (1 − ``share`` · F_br/30 kN): friction that grows more slowly than the force.

    Source: ID08 suspects that its ball-ramp friction is overestimated at high current.
    """

    name = "ball_ramp_load"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("share", "1", 0.0, 0.6),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "ball_ramp_coulomb_torque": lambda level, q: (
                level * (1 - g.share * q.ball_ramp_force / 3e4)
            )
        }


class MotorFriction(Effect):
    """T_C, T_S and σ_2 × (1 + ``change``).

    Source: ID08 names the small motor torque beside the friction of motor and gear at 2.5 A.
    """

    name = "motor_friction"
    model = "alsd"
    equation = "motor"
    parameters = (Number("change", "1", -0.9, 2.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        more = lambda value, q: value * (1 + g.change)  # noqa: E731
        return dict.fromkeys(("motor_coulomb_torque", "motor_static_torque", "motor_viscous"), more)


class FilmRelease(Effect):
    """d_e × (1 − ``share``) while the motor runs home: less film between opening plates.

    Source: ID08 allows for a damping coefficient that is not the same everywhere.
    """

    name = "film_release"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("share", "1", 0.0, 0.95),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"film_damping": lambda d, q: d * (1 - g.share * (q.motor_speed < 0))}


PACK_BEDDING, BALL_RAMP_DITHER, BALL_RAMP_LOAD = PackBedding(), BallRampDither(), BallRampLoad()
MOTOR_FRICTION, FILM_RELEASE = MotorFriction(), FilmRelease()
EXTENSIONS = (PACK_BEDDING, BALL_RAMP_DITHER, BALL_RAMP_LOAD, MOTOR_FRICTION, FILM_RELEASE)
