"""Friction laws of the clutch, each a piece to be swapped for another.

A law reads ``slip_speed`` ω_s, the ``friction_potential`` T_C, the ``deflection`` z of the bristle
behind the ``bristle_play``, its ``bristle_stiffness``, and the ``driving_torque`` that the other
side would put through closed surfaces.  It assigns ``friction_torque`` and
``wind_up_rate``, ``wind_up_after_step`` where it resets the bristle, and ``stuck`` where it holds
the surfaces so that nothing moves.

The state ``wind_up`` counts the play 2α_b2 and the bristle in series.
"""

from clutchest.models.alsd.friction.bristles import dahl, lugre
from clutchest.models.alsd.friction.reset_integrator import reset_integrator
from clutchest.models.alsd.friction.rigid import karnopp, static

LAWS = {law.__name__: law for law in (reset_integrator, static, karnopp, lugre, dahl)}

__all__ = ["LAWS", "dahl", "karnopp", "lugre", "reset_integrator", "static"]
