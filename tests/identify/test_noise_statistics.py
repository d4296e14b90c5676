"""Intervals of `identify noise` against drives whose noise and delays are known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import binomtest

import clutchest
from clutchest.identify import procedure
from clutchest.identify.fit import Fitted
from clutchest.identify.sensor_noise import bus_step

# Known and not yet understood: errors scatter 1.4 to 1.6 times as widely as they should.
TOO_SHORT = {f"signals.input_shaft_speed.{leaf}" for leaf in ("noise", "noise_ar", "delay")}


@dataclass(frozen=True)
class Case:
    """One number: its key, what it truly is, and what was found."""

    key: str
    true: float
    found: Fitted


def cases(seed: int) -> Iterator[Case]:
    """A truck whose sensors are drawn by ``seed``, driven in town or through launches."""
    nominal = clutchest.load_vehicle("truck")
    rng = np.random.default_rng(seed)
    sensors = {
        name: replace(
            mapped,
            noise=mapped.noise * rng.choice([0.5, 1.0, 2.0]),
            noise_ar=rng.choice([0.0, 0.5, 0.9]),
            delay=0.0 if name == "engine_speed" else rng.choice([0.0, 0.02, 0.05]),
        )
        for name, mapped in nominal.signals.items()
    }
    scenario, duration = ("city", 900.0) if seed % 2 else ("launches", 700.0)
    signals = clutchest.simulate(
        replace(nominal, signals=sensors), scenario, seed, nominal=False, duration=duration
    )
    fit = procedure("noise")(signals, nominal, lambda text, share: None)
    for name, mapped in sensors.items():
        rounding = bus_step([signals[name].value]) / np.sqrt(12)
        true = {"noise": np.hypot(mapped.noise, rounding), "noise_ar": mapped.noise_ar,
                "delay": mapped.delay}  # fmt: skip
        for leaf, value in true.items():
            key = f"signals.{name}.{leaf}"
            yield Case(key, float(value), fit.parameters[key])


@pytest.mark.statistics
def test_intervals_hold_what_is_true():
    """40 trucks with other noise, colour and delays: coverage and bias of every number."""
    inside: dict[str, list[bool]] = {}
    errors: dict[str, list[float]] = {}
    for seed in range(40):
        for case in cases(seed):
            f = case.found
            if f.determined:
                inside.setdefault(case.key, []).append(f.low <= case.true <= f.high)
                errors.setdefault(case.key, []).append((f.value - case.true) / f.std)
    short = set()
    for key, hits in inside.items():
        held = binomtest(sum(hits), len(hits)).proportion_ci(0.95).high >= 0.95
        if not held or abs(np.mean(errors[key])) > 0.5 + 2 / np.sqrt(len(hits)):
            short.add(key)
    assert short <= TOO_SHORT
    if short:
        pytest.xfail(f"intervals too short, as docs/identify.md says: {sorted(short)}")
