"""Pack and armature temperature: what the paper calls for and does not have."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities


def clutch_torque(q: Quantities) -> None:
    """Friction and drag together, and the heat they make."""
    q.drag_level = 0.0
    q.drag_torque = q.drag_level * ca.sign(q.slip_speed)
    q.clutch_torque = q.friction_torque + q.drag_torque
    q.power = q.clutch_torque * q.slip_speed


def temperatures(q: Quantities) -> None:
    """C_p dϑ_p/dt = T_c ω_s − G_p (ϑ_p − ϑ_oil), C_a dϑ_a/dt = R_a i_a² − G_a (ϑ_a − ϑ_oil)."""
    q.pack_heat = q.power - q.pack_oil_conductance * (q.temp_pack - q.oil_temp)
    q.temp_pack_rate = q.pack_heat / q.pack_heat_capacity
    loss = q.resistance * q.current**2
    q.armature_heat = loss - q.armature_conductance * (q.temp_armature - q.oil_temp)
    q.temp_armature_rate = q.armature_heat / q.armature_heat_capacity
