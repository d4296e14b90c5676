"""The reset-integrator model with a variable friction potential, Fig. 8: the paper's choice."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities


def reset_integrator(q: Quantities) -> None:
    """A spring that winds up with slip until it carries the friction potential, and then slides.

    z_0 = T_C/σ_0.c; dz/dt = 0 if (ω_s > 0 and z ≥ z_0) or (ω_s < 0 and z ≤ −z_0), else ω_s;
    T_c = σ_0.c z + σ_1.c dz/dt.  Sliding and the bristle-deflection reset (z = z_0 sgn z when z_0
    falls below |z|) are one and the same after each step: z stays within ±z_0.
    """
    limit = q.friction_potential / q.bristle_stiffness + q.bristle_play
    saturated = ca.if_else(
        ca.sign(q.slip_speed) * q.wind_up >= limit, 1.0, 0.0
    )  # beyond z_0 it is reset after the step
    q.wind_up_rate = q.slip_speed
    q.friction_torque = (
        q.bristle_stiffness * q.deflection + q.torsional_damping * (1 - saturated) * q.slip_speed
    )
    q.wind_up_after_step = ca.fmin(ca.fmax(q.wind_up, -limit), limit)
