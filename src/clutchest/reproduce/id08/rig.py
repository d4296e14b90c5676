"""The paper's rig: its experiments run with the full model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from clutchest.compute.forward import Forward, forward
from clutchest.models.alsd import full
from clutchest.models.effects import Effect
from clutchest.reproduce.id08.extensions import EXTENSIONS
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

PERIOD, STEPS = 1e-3, 20  # s between rows, steps in between
OIL = 25.0  # °C
RPM = np.pi / 30.0
WATCHED = (
    "current",
    "armature_voltage",
    "motor_torque",
    "motor_speed",
    "motor_angle",
    "plate_position",
    "pack_force",
    "spring_force",
    "clutch_torque",
)
Columns = Mapping[str, Floats]


@lru_cache(maxsize=2)
def _compiled(bare: bool) -> Forward:
    """The rig with every extension in its equations, absent unless given a size."""
    model = full.bare_on_angle(full.RIG) if bare else full.RIG
    return forward(model.with_effects(EXTENSIONS), WATCHED)


@dataclass(frozen=True)
class Rig:
    """The rig with the vehicle file's parameters, some of them ``changed``; whether the real one,
    which the generator plays, is ``deviating`` from the model as the paper admits."""

    vehicle: Vehicle
    changed: Mapping[str, float] = field(default_factory=dict)
    deviating: bool = True

    def lacking(self, **changed: float) -> Rig:
        """The same rig without some mechanism."""
        return Rig(self.vehicle, {**self.changed, **changed}, self.deviating)

    def undeviating(self) -> Rig:
        """The same with a real rig that does exactly what the model does."""
        return Rig(self.vehicle, self.changed, False)

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters of the model."""
        return {key: p.value for key, p in self.vehicle.parameters.items()} | dict(self.changed)

    def step(
        self,
        amps: float,
        rpm: float,
        on: float,
        off: float,
        end: float,
        extension: Effect | None = None,
        size: float = 0.0,
    ) -> Columns:
        """Request ``amps`` from ``on`` to ``off`` s, all until ``end``, at a slip of ``rpm``."""
        time = times(end)
        request = np.where((time >= on) & (time < off), amps, 0.0)
        return self._run(time, request, rpm, False, extension, size)

    def ramp(self, rate: float, most: float = 20.0) -> Columns:
        """Current up to ``most`` A and back at ``rate`` A/s, the clutch turning slowly."""
        time = times(2.0 * most / rate + 0.2)
        request = np.maximum(np.minimum(rate * time, 2.0 * most - rate * time), 0.0)
        return self._run(time, request, 2.0)

    def bare_ramp(self, reach: float = 33.0, speed: float = 5.0) -> Columns:
        """Pack removed: the motor's angle up to ``reach`` rad and back."""
        time = times(2.0 * reach / speed)
        request = np.maximum(np.minimum(speed * time, 2.0 * reach - speed * time), 0.0)
        return self._run(time, request, 0.0, True)

    def _run(
        self,
        time: Floats,
        request: Floats,
        rpm: float,
        bare: bool = False,
        extension: Effect | None = None,
        size: float = 0.0,
    ) -> Columns:
        model, parameters = _compiled(bare), self.parameters
        slip = rpm * RPM
        start = full.rest(model.model, parameters["free_play"], OIL)
        start["drive_speed"] = slip * parameters["final_drive_ratio"]
        asked = "angle_request" if bare else "current_request"
        inputs = {
            asked: request,
            "slip_request": np.full(len(time), slip),
            "oil_temp": np.full(len(time), OIL),
        }
        effects = {extension.name: {extension.gains[0].key: size}} if extension else None
        columns = model.run(parameters, start, inputs, PERIOD, STEPS, effects)
        return {"time": time, "request": request, **columns}


def times(end: float) -> Floats:
    """Rows from 0 to ``end`` s."""
    return np.arange(round(end / PERIOD) + 1, dtype=np.float64) * PERIOD
