"""Flywheel and pressure plate are two masses, bolted together over the cover."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number
from clutchest.models.symbols import State

LASTS = 90.0  # s, τ, until they are equally warm: some 110 W/K between them
SHARE = 0.45  # w, of the flywheel in the body's heat capacity
STRONGER = 1.3  # × k_ICE2b from coolant to flywheel, so that the plate loses as much at rest


class Flywheel(Effect):
    """The plate, whose temperature expands the clutch, is hotter than the body's mean T_b by
    ``slip`` · y + ``coolant`` · s (u − z), with u = T_coolant − T_b and s = τ k_ICE2b / (m c_p)_b.

    y' = heat from the disc / (m c_p)_b − y/τ; z, of u what the flywheel does not show yet, has
    z' = −T_b' − z/τ.  The coolant acts on the flywheel: until both are equally warm it brings
    1.3 k_ICE2b (``slip`` · y − ``coolant`` · s z) / w more.  A flywheel with a share w of the heat
    capacity and half of the disc's heat has ``slip`` = 0.5/(1 − w) − 1 and ``coolant`` = −1.  The
    disc expands until it is hotter than the plate by its cap.
    """

    name = "flywheel"
    model = "dry_clutch"
    equation = "body_heat"
    parameters = (
        Number("slip", "1", -1.0, 1.0, healthy=0.2),
        Number("coolant", "1", -4.0, 4.0, healthy=2.0),
    )
    states = (
        State("plate_by_slip", "K", "y", "plate hotter than the body, by slip", 0.0, 0.0, 1.0),
        State("flywheel_behind", "K", "z", "body's warming not yet shown", 0.0, 0.0, 1.0),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def share(q: Any) -> Any:
            return LASTS * q.conductance_engine_body / q.heat_capacity_body

        def expansion(expansion: Any, q: Any) -> Any:
            towards = q.coolant_temp - q.temp_body - q.flywheel_behind
            hotter = g.slip * q.plate_by_slip + g.coolant * share(q) * towards
            to_disc, cap = q.temp_disc - q.temp_body, q.disc_body_temp_cap
            capped = ca.fmin(to_disc - hotter, cap) - ca.fmin(to_disc, cap)
            return expansion + q.expansion_body * hotter + q.expansion_disc * capped

        def body_heat(heat: Any, q: Any) -> Any:
            colder = g.slip * q.plate_by_slip - g.coolant * share(q) * q.flywheel_behind
            return heat + STRONGER * q.conductance_engine_body * colder / SHARE

        def by_slip(_: Any, q: Any) -> Any:
            heat = q.conductance_disc_body * (q.temp_disc - q.temp_body)
            heat += q.heat_fraction_body * q.power
            return heat / q.heat_capacity_body - q.plate_by_slip / LASTS

        return {
            "expansion": expansion,
            "body_heat": body_heat,
            "plate_by_slip_rate": by_slip,
            "flywheel_behind_rate": lambda _, q: -q.temp_body_rate - q.flywheel_behind / LASTS,
        }
