"""The clutch pack along its axis, Fig. 6b: free play, equivalent stiffness, squeeze film."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities

BARE = 0.01  # of d_e: what is left of the axial damping without a pack


def pack(q: Quantities) -> None:
    """F_c = c_cl.e (d_pp − x_fp) beyond the free play."""
    q.compression = ca.fmax(q.plate_position - q.free_play, 0.0)
    q.gap = ca.fmax(q.free_play - q.plate_position, 0.0)
    q.pack_force = q.pack_stiffness * q.compression
    q.film_damping = q.axial_damping


def no_pack(q: Quantities) -> None:
    """The pack removed, and its squeeze film with it: experiment I6."""
    q.compression = 0.0
    q.pack_force = 0.0
    q.film_damping = BARE * q.axial_damping


def plate(q: Quantities) -> None:
    """d_e d(d_pp)/dt = F_app − F_c with F_app = F_br − F_rs + F_lim; the plate has no mass."""
    q.applied_force = q.ball_ramp_force - q.spring_force + q.limiter_force
    q.plate_speed = (q.applied_force - q.pack_force) / q.film_damping
    q.plate_position_rate = q.plate_speed


def potential(q: Quantities) -> None:
    """T_C = μ N_f r_e F_c, the friction potential; effects of slip and temperature change μ."""
    q.friction_now = q.friction_coefficient * q.friction
    surfaces = q.friction_surfaces * q.equivalent_radius
    q.friction_potential = q.friction_now * surfaces * q.pack_force
