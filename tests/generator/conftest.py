"""A truck's numbers, as plain as the generator takes them, and the plant set up by hand."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from clutchest.generator import Channel, DriveRequest, Sampled, generate
from clutchest.generator.effects import complete, numbers

TRUCK = {
    "heat_capacity_body": 40500.0,
    "heat_capacity_housing": 15000.0,
    "heat_capacity_disc": 2270.0,
    "conductance_engine_body": 22.5,
    "conductance_body_housing": 22.5,
    "conductance_housing_ambient": 8.0,
    "conductance_disc_body": 126.0,
    "heat_fraction_body": 0.0,
    "expansion_body": 0.0096,
    "expansion_disc": 0.0094,
    "reference_temp": 70.0,
    "disc_body_temp_cap": 110.0,
    "zero_position_ref": 38.4,
    "position_origin": 38.4,
    "torque_cubic": -21.0,
    "torque_quadratic": 38.7,
    "kiss_point": 6.51,
    "engine_inertia": 3.2,
    "engine_torque_max": 3500.0,
}
CHANNELS = (
    Channel("engine_speed", "EEC1", 0.01),
    Channel("engine_torque", "EEC1", 0.01),
    Channel("input_shaft_speed", "ETC1", 0.01),
    Channel("slave_position", "CLUTCH", 0.01),
    Channel("motor_position", "CLUTCH", 0.01),
    Channel("vehicle_speed", "CCVS", 0.1),
    Channel("coolant_temp", "ET1", 1.0),
    Channel("ambient_temp", "AMB", 1.0),
)


def simulated(*arguments: Any, **options: Any) -> Sampled:
    """A drive of the request with these fields."""
    return generate(DriveRequest(*arguments, **options))


@pytest.fixture
def truck() -> dict[str, float]:
    return dict(TRUCK)


@pytest.fixture(scope="session")
def drive() -> Callable[..., Sampled]:
    """``drive(scenario, seed, duration)``: a clean nominal drive, made once."""

    @cache
    def made(scenario: str, seed: int = 1, duration: float | None = None) -> Sampled:
        return simulated(TRUCK, {}, scenario, seed, CHANNELS, nominal=True, duration=duration)

    return made


class Bench:
    """The plant held still: state ``y``, situation ``s``, numbers ``p``."""

    def __init__(
        self, plate: float = 4.6, mass: float = 20e3, effects: dict | None = None, **changes: float
    ) -> None:
        from clutchest.generator import plant

        values = {**TRUCK, **changes}
        box = numbers(values, values, complete(effects or {}), values["zero_position_ref"], mass)
        self.plant, self.p = plant, box[0]
        self.s = np.zeros(1, plant.SITUATION)[0]
        self.y = np.zeros(8)
        self.y[[plant.BODY, plant.HOUSING, plant.DISC]] = 90.0, 60.0, 150.0
        self.y[[plant.ENGINE, plant.TORQUE]] = 150.0, 400.0
        given = {
            "friction": 1.0,
            "sign": 1.0,
            "held": 1,
            "coolant": 85.0,
            "ambient": 15.0,
            "request": 500.0,
            "plate": plate,
            "plate_before": plate,
        }
        for name, value in given.items():
            self.s[name] = value

    def capacity(self) -> float:
        return self.plant.capacity(self.y, self.s["plate"], self.s, self.p)

    def transmitted(self) -> float:
        return self.plant.transmitted(self.y, self.s["plate"], self.s, self.p)

    def rates(self) -> np.ndarray:
        out = np.zeros(8)
        self.plant.rates(self.y, self.s["plate"], self.s, self.p, out)
        return out

    def advance(self, steps: int, substeps: int = 1) -> None:
        work = np.empty((5, 8))
        for _ in range(steps):
            self.plant.advance(self.y, substeps, self.s, self.p, work)


@pytest.fixture
def bench() -> type[Bench]:
    return Bench
