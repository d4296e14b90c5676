"""A user's own effects in the generator's differential: a voltage, a load of the motor, shares of
friction and damping, a drag, heat, free play, or a reading."""

from __future__ import annotations

from collections.abc import Mapping

from clutchest.models.alsd.estimator import ALSD
from clutchest.models.model import Model
from clutchest.models.own_effects import OwnEffects, Seen

SHARES = {  # the generator's share → the quantity of which it is one
    "friction": "friction_now",
    "damping": "axial_damping",
    "ramp": "ball_ramp_friction",
}


class DifferentialEffects(OwnEffects):
    """See :class:`OwnEffects`."""

    machine = "differential"
    wears = "free_play_rate"
    inputs = ("armature_voltage", "slip_speed", "oil_temp")
    sensors = {
        "armature_current": "armature_current_reading",
        "motor_angle": "motor_angle_reading",
        "armature_temp": "armature_temp_reading",
        "clutch_torque": "clutch_torque_reading",
        "shaft_torque": "shaft_torque_reading",
    }
    told = (
        *SHARES.values(),
        "motor_voltage",
        "resistance",
        "motor_torque",
        "motor_friction_torque",
        "drag_torque",
        "pack_heat",
        "armature_heat",
        "initial_free_play",
        "free_play_rate",
    )

    def model(self) -> Model:
        """See :meth:`OwnEffects.model`."""
        return ALSD

    def acts(
        self, seen: Seen, change: Mapping[str, float], value: Mapping[str, float], worn: float
    ) -> dict[str, float]:
        """See :meth:`OwnEffects.acts`."""
        shares = {
            name: change[quantity] / value[quantity] if value[quantity] else 0.0
            for name, quantity in SHARES.items()
        }
        drop = change["resistance"] * seen["current"]
        return {
            "voltage": drop - change["motor_voltage"],
            "load": change["motor_friction_torque"] - change["motor_torque"],
            "film": change["drag_torque"],
            "pack_heat": change["pack_heat"],
            "armature_heat": change["armature_heat"] + drop * seen["current"],
            "play": worn + change["initial_free_play"],
            **shares,
        }
