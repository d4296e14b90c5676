"""A judder at one frequency is a line in the noise: no log that has one is called faultless."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pytest

import clutchest
from clutchest.record.discovery_report import report

TRUCK = clutchest.load_vehicle("truck")


@dataclass(frozen=True)
class Judder:
    """Friction torque × (1 + ``share`` · sin 2π 9 t) below 20 rad/s of slip."""

    share: float
    pace = 0.002

    def law(self) -> Callable[[Mapping[str, float]], Mapping[str, float]]:
        def act(seen: Mapping[str, float]) -> dict[str, float]:
            wave = float(np.sin(2.0 * np.pi * 9.0 * seen["time"]))
            return {"torque_share": self.share * wave * (abs(seen["slip_speed"]) < 20.0)}

        return act

    def readings(self, true):
        return true


@pytest.mark.slow
@pytest.mark.parametrize(("share", "verdict"), [(0.0, "none"), (0.12, "unknown")])
def test_a_judder_is_a_line_in_the_noise(share, verdict):
    signals = clutchest.simulate(TRUCK, "heating", 8, duration=400.0, outsider=Judder(share))
    found = clutchest.discover(signals, TRUCK)
    assert found.verdict == verdict
    assert found.fit.rejects == (share > 0.0)
    first = next(part for part in report(found).split("\n\n") if part.startswith("Does the model"))
    assert first.startswith("Does the model fit? The residuals are")
    if not share:
        assert found.where is None and "consistent with noise" in first
        return
    assert "noise in engine_speed while slipping has a line at 9 Hz" in found.sentence
    assert found.where is not None and found.where.equation == "sensor:engine_speed"
    tests = found.summary()["fit"]["tests"]
    assert tests[0]["kind"] == "spectrum" and tests[0]["p_value"] < 1e-6
