"""The reset spring, a pre-tensioned Belleville spring, (10)."""

from __future__ import annotations

from math import pi

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities


def force(q: Quantities, s: ca.SX) -> ca.SX:
    """(10), Almen and Laszlo: F_rs at the displacement ``s``, m."""
    thickness, height = q.spring_thickness, q.spring_cone_height
    return _scale(q) * s * ((height - s) * (height - s / 2) / thickness**2 + 1)


def energy(q: Quantities, s: ca.SX) -> ca.SX:
    """What the spring stores at the displacement ``s``, J: the integral of (10)."""
    thickness, height = q.spring_thickness, q.spring_cone_height
    bending = height**2 * s**2 / 2 - height * s**3 / 2 + s**4 / 8
    return _scale(q) * (bending / thickness**2 + s**2 / 2)


def _scale(q: Quantities) -> ca.SX:
    """4E/(1 − μ²) · t³/(α_B D²), N/m."""
    ratio = q.spring_outer_diameter / q.spring_inner_diameter  # δ
    shape = ((ratio - 1) / ratio) ** 2 / ((ratio + 1) / (ratio - 1) - 2 / ca.log(ratio)) / pi  # α_B
    stiffness = 4 * q.spring_young / (1 - q.spring_poisson**2)
    return stiffness * q.spring_thickness**3 / (shape * q.spring_outer_diameter**2)


def reset_spring(q: Quantities) -> None:
    """F_rs(s_0 + d_pp), and F_rs(s_0) that the limiter carries at rest."""
    q.resting_spring_force = force(q, q.spring_preload)
    q.spring_force = force(q, q.spring_preload + q.plate_position)
