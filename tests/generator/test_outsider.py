"""Causes from outside act where they say, and their absence changes not one bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import clutchest
from clutchest.can import files
from clutchest.errors import ClutchestError
from clutchest.generator import Sampled
from clutchest.shipped import locate
from clutchest.simulated import simulate_frames

from .conftest import CHANNELS, TRUCK, simulated

SECONDS = 60.0


@dataclass(frozen=True)
class Always:
    """The same action, all the time; sensors as they are, or late by so many s."""

    acts: Mapping[str, float] | None = None
    late: float = 0.0
    saw: list[dict[str, float]] = field(default_factory=list)

    def law(self) -> Any:
        def act(seen: dict[str, float]) -> Mapping[str, float]:
            self.saw.append(dict(seen))
            return self.acts or {}

        return None if self.acts is None else act

    def readings(self, true: Mapping[str, Any]) -> Mapping[str, Any]:
        torque = true["engine_torque"]
        return {**true, "engine_torque": lambda t: torque(np.maximum(t - self.late, 0.0))}


def driven(outsider: Always | None, scenario: str = "launches") -> Sampled:
    return simulated(
        TRUCK, {}, scenario, 1, CHANNELS, nominal=True, duration=SECONDS, outsider=outsider
    )


@pytest.fixture(scope="module")
def plain() -> Sampled:
    return driven(None)


def test_the_shipped_log_is_still_made_bit_by_bit():
    """Its command stands in the manual; it was made before anything could act from outside."""
    frames, _ = simulate_frames(clutchest.load_vehicle("truck"), "launches", 1, duration=240.0)
    shipped = files.read_frames(locate("demo", "logs"))
    assert len(frames.t_ns) == len(shipped.t_ns) > 50_000
    assert np.array_equal(frames.data, shipped.data)


@pytest.mark.parametrize("idle", [Always(None), Always({}), Always({"torque": 0.0})])
def test_who_does_nothing_changes_nothing(plain, idle):
    same = driven(idle)
    for name, column in plain.truth.columns.items():
        assert np.array_equal(same.truth.columns[name], column), name
    for name, (time, value) in plain.signals.items():
        assert np.array_equal(same.signals[name], (time, value)), name


def test_without_a_law_the_drive_is_one_call(monkeypatch):
    from clutchest.generator import plant

    calls = []
    run = plant.run
    monkeypatch.setattr(plant, "run", lambda *a: calls.append(a[:2]) or run(*a))
    driven(None)
    driven(Always(None, late=0.1))
    steps = round(SECONDS / plant.STEP) + 1
    assert calls == [(0, steps)] * 2
    driven(Always({}))
    assert calls[-1] == (steps - 1, steps) and len(calls) > 1000


@pytest.mark.parametrize(
    ("name", "heated"),
    [
        ("body_heat", "temp_body"),
        ("housing_heat", "temp_housing"),
        ("disc_heat", "temp_disc"),
    ],
)
def test_heat_goes_where_it_is_said(plain, name, heated):
    """In the first seconds the heat is still where it was put: power · time / capacity."""
    warm = driven(Always({name: 100.0}))
    rise = {
        c: warm.truth.columns[c][100] - plain.truth.columns[c][100]
        for c in ("temp_body", "temp_housing", "temp_disc")
    }
    capacity = TRUCK["heat_capacity_" + heated.removeprefix("temp_")]
    assert rise.pop(heated) == pytest.approx(100.0 / capacity, rel=0.05)  # the disc passes some on
    assert all(abs(other) < 0.05 * 100.0 / capacity for other in rise.values())


def test_torque_acts_while_the_surfaces_touch(bench):
    b = bench()
    plain = b.capacity()
    b.s["foreign_torque_share"] = 0.1
    assert b.capacity() == pytest.approx(1.1 * plain)
    b.s["foreign_torque"] = 25.0
    assert b.capacity() == pytest.approx(1.1 * plain + 25.0)
    b.s["foreign_torque"] = -1e4
    assert b.capacity() == 0.0, "friction does not drive"
    b.s["foreign_torque"], b.s["plate"] = 25.0, 12.0
    assert b.capacity() == 0.0


def test_a_load_slows_the_engine_and_no_report_tells(bench):
    b = bench(plate=12.0)
    free = b.rates()[b.plant.ENGINE]
    b.s["foreign_engine_load"] = 32.0
    assert b.rates()[b.plant.ENGINE] - free == pytest.approx(-32.0 / 3.2)
    assert b.rates()[b.plant.TORQUE] == pytest.approx((500.0 - 400.0) / 0.08)
    b.s["held"], b.s["ratio"] = 0, 40.0
    stuck = b.plant.sticking(b.y, b.s, b.p)
    b.s["foreign_engine_load"] = 0.0
    inverse = 40.0**2 / 20e3
    assert b.plant.sticking(b.y, b.s, b.p) - stuck == pytest.approx(
        32.0 / 3.2 / (1 / 3.2 + inverse)
    )


def test_the_zero_position_takes_the_curve_along(plain, bench):
    moved = driven(Always({"zero_position": 0.2}))
    np.testing.assert_allclose(
        moved.truth.columns["zero_position"][1:], plain.truth.columns["zero_position"][1:] + 0.2
    )
    b = bench(plate=4.6)
    torque = b.capacity()
    b.s["foreign_zero_position"] = 0.2
    b.s["plate"] = 4.8
    assert b.capacity() == pytest.approx(torque)


def test_a_late_reading_leaves_the_truck_alone(plain):
    late = driven(Always(None, late=0.25))
    for name, column in plain.truth.columns.items():
        assert np.array_equal(late.truth.columns[name], column), name
    time, value = plain.signals["engine_torque"]
    shown = late.signals["engine_torque"][1][time > 0.3]
    np.testing.assert_allclose(
        shown, np.interp(time - 0.25, time, value)[time > 0.3], atol=20.0
    )  # between its own samples the torque bends a little
    assert np.abs(shown - value[time > 0.3]).max() > 100.0


def test_what_a_law_sees_is_the_truth():
    watching = Always({})
    drive = driven(watching)
    truth = drive.truth
    assert [seen["time"] for seen in watching.saw] == pytest.approx(list(truth.time))
    for name in (
        "temp_body",
        "temp_housing",
        "temp_disc",
        "engine_speed",
        "input_shaft_speed",
        "slip_speed",
        "vehicle_speed",
        "engine_torque",
        "slave_position",
    ):
        seen = np.array([row[name] for row in watching.saw[1:]])
        assert np.abs(seen - truth.columns[name][1:]).max() < 1e-9, name
    energy = np.array([row["energy"] for row in watching.saw])
    assert np.abs(energy - truth.columns["slip_energy"]).max() < 1e-6
    position = truth.columns["slave_position"]
    rate = np.array([row["position_rate"] for row in watching.saw])
    np.testing.assert_allclose(rate[1:], np.diff(position) / 0.01, atol=1e-9)
    assert np.abs(rate).max() > 10.0


def test_what_no_truck_has_is_told():
    with pytest.raises(ClutchestError, match=r"'engine_laod'.*did you mean 'engine_load'"):
        driven(Always({"engine_laod": 1.0}))
