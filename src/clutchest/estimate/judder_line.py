"""What a judder is: one line, its size, and the friction that could cause it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class JudderLine:
    """A line of ``frequency_hz`` (at the mean slip, where it is an ``order``: a multiple of the
    revolutions that slip) and ``amplitude`` in the output's unit, seen in ``duration_s`` of
    sliding with a mean magnitude of the ``output`` and of the ``slip`` in rad/s; ``p_value`` of
    noise alone.

    ``kind``: ``frequency``, ``order``, or ``either`` where the slip is too constant to tell;
    ``friction_slope``: what fall of the friction coefficient per m/s of sliding speed makes up for
    one per cent of critical damping, s/m; None of an order, which geometry excites.
    """

    kind: str
    frequency_hz: float
    order: float | None
    amplitude: float
    output: float
    slip: float
    duration_s: float
    p_value: float
    friction_slope: float | None

    def figures(self, unit: str) -> dict[str, Any]:
        """As ``summary.json`` has them."""
        named = asdict(self)
        named[f"amplitude_{unit}"], named[f"output_{unit}"] = (
            named.pop(name) for name in ("amplitude", "output")
        )
        return named

    def words(self, unit: str) -> str:
        """The line in a sentence."""
        said = f"judder while slipping: {self.amplitude:.0f} {unit} at {self.frequency_hz:.1f} Hz"
        if self.order is not None:
            said += f", {self.order:.1f} times the slip's revolutions"
            said += "" if self.kind == "order" else " (a slip that hardly varies parts neither)"
        if self.friction_slope is None:
            return f"{said}: something that turns with the slip, not the friction's slope"
        return (
            f"{said}; friction that falls by {self.friction_slope:.2g} s/m of sliding speed makes "
            "up for one per cent of damping there"
        )
