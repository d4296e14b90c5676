"""The differential's runs that benchmarks judge."""

from __future__ import annotations

SCENARIOS = ("rig-steps", "rig-slow", "rig-ramps", "car", "slip-oil-sweep", "coast")
DURATION = 60.0  # s


def vehicle_of(scenario: str) -> str:
    """The shipped vehicle that a scenario is driven with."""
    return "alsd_car" if scenario == "car" else "alsd_rig"
