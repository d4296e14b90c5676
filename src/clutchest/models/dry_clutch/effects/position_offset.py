"""The slave sensor reads too much."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class PositionOffset(Effect):
    """Reading = true + ``offset``, as input and as zero position alike."""

    name = "position_offset"
    model = "dry_clutch"
    equation = "sensor:slave_position"
    parameters = (Number("offset", "mm", -1.0, 1.0),)
    wording = {"offset": Wording("position reads {:.3g} mm low", "position reads {:.3g} mm high")}

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "slave_position": lambda reading, q: reading - g.offset,
            "zero_position_reading": lambda x0, q: x0 + g.offset,
        }
