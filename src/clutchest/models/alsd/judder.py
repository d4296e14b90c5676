"""Judder of the differential: the structure swings on its torsional stiffness, driven by friction
that falls with the sliding speed.

The mode J θ'' + c θ' + k θ = T_c(ω_s) with c = 2 ζ k/(2π f) grows where dT_c/dω_s < −c.  With
T_c = μ N_f r_e F_c and the sliding speed v = r_e ω_s that is dμ/dv < −2 ζ k μ/(2π f r_e T_c)
(see Centea, Rahnejat, Menday, Applied Mathematical Modelling 25, 2001, 177–192, for the mechanism).
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from math import pi

from clutchest.models.declarations import Judder

DAMPING = 0.01  # ζ


def slope(
    p: Mapping[str, float], signals: Container[str], frequency: float, torque: float
) -> float:
    """See :class:`~clutchest.models.declarations.Judder`."""
    compliance = 1.0 / p["torsional_stiffness"]
    if "wheel_speed_left" in signals:  # in series with the half-shafts
        compliance += 0.5 / p["halfshaft_stiffness"]
    damping = 2.0 * DAMPING / (2.0 * pi * frequency * compliance)  # Nm s/rad
    return damping * p["friction_coefficient"] / (torque * p["equivalent_radius"])


JUDDER = Judder(
    sensors=("clutch_torque", "shaft_torque"),
    slip=({"slip_speed": 1.0}, {"wheel_speed_left": 0.5, "wheel_speed_right": -0.5}),
    least=2.0,
    unit="Nm",
    slope=slope,
)
