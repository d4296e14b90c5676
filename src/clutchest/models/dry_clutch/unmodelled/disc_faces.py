"""The disc's faces, where slip turns to heat, are hotter than the rest of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number
from clutchest.models.symbols import State

FAST, SLOW = 0.5, 2.0  # s, between which linings of some 3 mm on a steel core equalise


class DiscFaces(Effect):
    """The body touches faces that are hotter than the disc's mean by ``fast`` · y + ``slow`` · z,
    with y' = (1 − k_P) P / (m c_p)_d − y / 0.5 s, and z' the same with 2 s.

    Faces with a share f of the disc's heat capacity and one time constant are hotter by
    (1 − f)/f of such a state: 1.2 to 3 for 25 to 45 %.
    """

    name = "disc_faces"
    model = "dry_clutch"
    equation = "disc_heat"
    parameters = (
        Number("fast", "1", -8.0, 8.0, healthy=2.0),
        Number("slow", "1", -8.0, 8.0, healthy=1.5),
    )
    states = (
        State("faces_fast", "K", "y", "faces hotter than the disc, at once", 0.0, 0.0, 1.0),
        State("faces_slow", "K", "z", "faces hotter than the disc, for long", 0.0, 0.0, 1.0),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def more(q: Any) -> Any:
            return q.conductance_disc_body * (g.fast * q.faces_fast + g.slow * q.faces_slow)

        def heating(q: Any) -> Any:
            return (1 - q.heat_fraction_body) * q.power / q.heat_capacity_disc

        return {
            "body_heat": lambda heat, q: heat + more(q),
            "disc_heat": lambda heat, q: heat - more(q),
            "faces_fast_rate": lambda _, q: heating(q) - q.faces_fast / FAST,
            "faces_slow_rate": lambda _, q: heating(q) - q.faces_slow / SLOW,
        }
