"""Play between two parts."""

from __future__ import annotations

from clutchest.casadi_later import ca


def dead_zone(angle: ca.SX, half_width: ca.SX) -> ca.SX:
    """dz(·, α_b): what is left of an angle once the play is taken up, on either side."""
    return ca.fmax(angle - half_width, 0.0) - ca.fmax(-angle - half_width, 0.0)
