"""Thresholds by which regimes are judged, as a vehicle file may set them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Thresholds of a machine's regimes.

    ``lock_slip`` rad/s and ``lock_time`` s: slip below this for this long is locked, averaged over
    ``lock_average`` s where a shuffling driveline shakes the speeds;
    ``retracted_position`` mm: motor position below which the actuator is retracted, after
    ``settle`` s;
    ``open_margin`` mm beyond the nominal kiss point: open at any temperature;
    ``guard`` s around each transition without information from torque; ``gap`` s without a
    sample that the model needs: likewise.
    ``longest_engagement`` s: without a position, a clutch whose shaft rests, turns faster than the
    engine, or slows down beside a faster one, is open unless it locks up, or its shaft begins to
    turn, within this time; 0: it counts as slipping.
    """

    lock_slip: float = 2.0
    lock_time: float = 0.3
    lock_average: float = 0.0
    open_margin: float = 2.5
    retracted_position: float = 0.3
    settle: float = 0.2
    guard: float = 0.1
    gap: float = 0.5
    longest_engagement: float = 0.0

    @property
    def ahead(self) -> float:
        """Signals this much later, s, have no influence on a regime."""
        return self.lock_average / 2 + self.lock_time + self.guard + self.longest_engagement

    @property
    def back(self) -> float:
        """Nor have signals this much earlier, s."""
        return self.lock_average + self.lock_time + self.settle + 2 * self.guard

    @classmethod
    def of(cls, modes: Mapping[str, float]) -> Thresholds:
        """Those that a vehicle file states, else the defaults."""
        return cls(**modes)


# Thresholds that vehicle files may set, with their units.
THRESHOLD_UNITS = {
    "lock_slip": "rad/s",
    "lock_time": "s",
    "lock_average": "s",
    "open_margin": "mm",
    "retracted_position": "mm",
    "settle": "s",
    "guard": "s",
    "gap": "s",
    "longest_engagement": "s",
}
EVERYWHERE = ("gap",)  # thresholds that every machine has
