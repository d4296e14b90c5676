"""Dynamic laws: Dahl's, and LuGre's with the Stribeck effect."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities

FLOOR = 1e-3  # Nm: an open clutch must not divide by its friction potential


def dahl(q: Quantities) -> None:
    """Dahl: dz/dt = ω_s (1 − σ_0 z/T_C sgn ω_s), T_c = σ_0 z; bristles beyond T_C are reset."""
    _bristle(q, ca.fmax(q.friction_potential, FLOOR))


def lugre(q: Quantities) -> None:
    """LuGre: as (4)–(6), the friction potential as Coulomb level."""
    more = q.clutch_static_ratio - 1
    ratio = q.slip_speed / q.clutch_stribeck_speed
    _bristle(q, ca.fmax(q.friction_potential * (1 + more * ca.exp(-(ratio**2))), FLOOR))


def _bristle(q: Quantities, level: ca.SX) -> None:
    """dz/dt = ω_s − σ_0 |ω_s| z/g, T_c = σ_0 z + σ_1 dz/dt."""
    stiffness = q.bristle_stiffness
    q.wind_up_rate = q.slip_speed - stiffness * ca.fabs(q.slip_speed) * q.deflection / level
    q.friction_torque = stiffness * q.deflection + q.torsional_damping * q.wind_up_rate
    limit = level / stiffness + q.bristle_play
    q.wind_up_after_step = ca.fmin(ca.fmax(q.wind_up, -limit), limit)
