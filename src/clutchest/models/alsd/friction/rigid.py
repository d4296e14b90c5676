"""Laws without a bristle: static friction, and Karnopp's."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities

BAND = 0.01  # rad/s: Karnopp's band of slip that counts as none


def static(q: Quantities) -> None:
    """Coulomb: T_c = T_C sgn ω_s.  At zero slip it chatters: that is why there are the others."""
    q.friction_torque = q.friction_potential * ca.sign(q.slip_speed)
    q.wind_up_rate = 0.0


def karnopp(q: Quantities) -> None:
    """Karnopp: within a band around zero slip what drives the surfaces is carried, up to T_C.

    There the surfaces stand still, whatever small slip a step has left them with.
    """
    potential = q.friction_potential
    held = ca.fmin(ca.fmax(q.driving_torque, -potential), potential)
    sliding = potential * ca.sign(q.slip_speed)
    q.slow = ca.fabs(q.slip_speed) < BAND
    q.stuck = ca.logic_and(q.slow, ca.fabs(q.driving_torque) <= potential)
    q.friction_torque = ca.if_else(q.slow, held, sliding)
    q.wind_up_rate = 0.0
