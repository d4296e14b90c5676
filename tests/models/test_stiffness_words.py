"""What I7 says of slopes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from clutchest.models.alsd.experiments.path_torque import AnglePath
from clutchest.models.alsd.experiments.stiffness import slopes

RISING = np.linspace(1.0, 2.0, 50)  # rad


def said(ways: list[int]) -> str:
    """Of a torque of 50 mNm/rad that friction raises or lowers by a tenth."""
    angle = np.concatenate([RISING[::way] for way in ways])
    way = np.repeat(ways, len(RISING))
    path = SimpleNamespace(
        own=np.zeros((1, 1)),
        counts=np.ones(len(angle), bool),
        motion=np.column_stack([angle, way]),
        measured=lambda p, own: (angle, 0.05 * angle * (1.0 + 0.1 * way)),
    )
    return slopes(cast(AnglePath, path), {}, "rig")


@pytest.mark.parametrize(
    ("ways", "words"),
    [
        (
            [1, -1],
            "rig: slopes 55.0 mNm/rad loading and 45.0 mNm/rad unloading, "
            "k = 50.0 mNm/rad with ρ = 0.10",
        ),
        ([1], "rig: slope 55.0 mNm/rad loading"),
        ([-1], "rig: slope 45.0 mNm/rad unloading"),
    ],
)
def test_of_one_branch_only_its_slope_is_said(ways, words):
    """It said that k is nan."""
    assert said(ways) == words
