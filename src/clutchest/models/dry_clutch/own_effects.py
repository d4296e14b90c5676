"""A user's own effects in the generator's truck: a torque, a heat flow, a shift of the zero
position, a load of the engine, or a reading."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.model import Model
from clutchest.models.own_effects import OwnEffects, Seen

SMALL = 5.0  # Nm: below, a share of the torque is no number
SLIPS = 0.1  # rad/s; below, the engine turns with the gearbox
HEAT = {  # the generator's heat flow → rate, heat capacity
    "body_heat": ("temp_body_rate", "heat_capacity_body"),
    "housing_heat": ("temp_housing_rate", "heat_capacity_housing"),
    "disc_heat": ("temp_disc_rate", "heat_capacity_disc"),
}


class TruckEffects(OwnEffects):
    """See :class:`OwnEffects`."""

    machine = "truck"
    wears = "zero_position_rate"
    inputs = (
        "engine_torque",
        "input_shaft_speed",
        "slave_position",
        "coolant_temp",
        "ambient_temp",
    )
    told = (
        "expansion",
        "sliding_torque",
        "drag_torque",
        "power",
        "true_engine_torque",
        "engine_speed_rate",
        "zero_position_rate",
        "initial_zero_position",
        *HEAT,
        *(rate for rate, _ in HEAT.values()),
    )

    def model(self) -> Model:
        """See :meth:`OwnEffects.model`."""
        return DRY_CLUTCH

    def nominal(self) -> Mapping[str, float]:
        """See :meth:`OwnEffects.nominal`."""
        return {"zero_position": self.parameters["zero_position_ref"], "friction": 1.0}

    def acts(
        self, seen: Seen, change: Mapping[str, float], value: Mapping[str, float], worn: float
    ) -> dict[str, float]:
        """See :meth:`OwnEffects.acts`."""
        torque = value["sliding_torque"]
        load = -change["true_engine_torque"]
        if abs(seen["slip_speed"]) > SLIPS:
            load -= change["engine_speed_rate"] * self.parameters["engine_inertia"]
        heat = {
            name: change[name] + change[rate] * self.parameters[capacity]
            for name, (rate, capacity) in HEAT.items()
        }
        heat["disc_heat"] += change["power"]
        drag, slip = change["drag_torque"], seen["slip_speed"]
        if torque <= 0.0:  # the generator's clutch is open, and carries no torque
            load += drag
            heat["disc_heat"] += drag * slip
        return {
            "torque_share": change["sliding_torque"] / torque if torque > SMALL else 0.0,
            "torque": drag * float(np.sign(slip)) if torque > 0.0 else 0.0,
            "engine_load": load,
            "zero_position": worn + change["expansion"] + change["initial_zero_position"],
            **heat,
        }
