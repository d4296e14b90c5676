"""What the estimator is judged by, clutch by clutch: a new model is one entry here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from clutchest.models.regimes import MODE_NAMES, Mode
from drawn import ENGINE_DRIVER, Driver

OPEN, SLIPPING = MODE_NAMES[Mode.open], MODE_NAMES[Mode.slipping]
RETRACTED = MODE_NAMES[Mode.retracted]


@dataclass(frozen=True)
class Clutch:
    """How one model is judged.

    Drives of its own follow the generator's ``plan`` scenario, kept to it by ``driver``, and are
    scored after ``warm_up`` engagements of at least ``lasting`` s.  ``judged``: each state in the
    modes that excite it, and how far above the bound it may lie.  ``wrong``: by how much a start
    may be wrong.  ``scenarios`` are the generator's for coverage.
    """

    plan: str
    driver: Driver | None
    warm_up: int
    lasting: float
    judged: Mapping[str, tuple[tuple[str, ...], float]]
    wrong: Mapping[str, float]
    scenarios: tuple[str, ...]


CLUTCHES = {
    "dry_clutch": Clutch(
        plan="launches",
        driver=ENGINE_DRIVER,
        warm_up=3,
        lasting=0.8,
        judged={
            **dict.fromkeys(
                ("temp_body", "temp_housing", "temp_disc", "zero_position"),
                ((SLIPPING, RETRACTED), 1.10),
            ),
            "friction": ((SLIPPING,), 1.15),
        },
        wrong={"temp_body": 40.0, "zero_position": 0.3, "friction": 0.15},  # K, mm, 1
        scenarios=("city", "launches", "heating"),
    ),
    "alsd": Clutch(
        plan="rig-steps",
        driver=None,
        warm_up=2,
        lasting=0.3,
        judged={
            **dict.fromkeys(
                (
                    "current",
                    "motor_speed",
                    "motor_angle",
                    "pack_force",
                    "free_play",
                    "temp_pack",
                    "temp_armature",
                ),
                ((OPEN, SLIPPING), 1.10),
            ),
            "friction": ((SLIPPING,), 1.15),
        },
        wrong={"free_play": 9.5e-5, "friction": 0.2},  # m, 1
        scenarios=("rig-steps", "rig-slow", "rig-ramps"),
    ),
}
