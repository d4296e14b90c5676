"""Armature temperature between its readings: their noise of half a kelvin is 0.1 % of K_t."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchest.models.experiments import BenchRecord, Parameters
from clutchest.native import compiled
from clutchest.signals import Floats

START = 5.0  # K, to which the temperature at the start is known beforehand


@compiled
def _heated(start, rise, decay, oil, loss, temp):  # type: ignore[no-untyped-def]
    """Into ``temp`` (n): C_a dϑ_a/dt = R_a i_a² − G_a (ϑ_a − ϑ_oil), ``loss`` (n) in A²; ``rise``
    K/A² at 0 °C and K/(A² K), ``decay`` of a step."""
    value = start
    for k in range(len(temp)):
        temp[k] = value
        value += (rise[0] + rise[1] * value) * loss[k] - decay * (value - oil[k])


@dataclass(frozen=True, slots=True)
class ArmatureHeat:
    """Squared current ``loss`` (n), A², and oil temperature on even times ``time`` (n) from the
    first reading of the temperature on; its ``readings`` (k,), their noise and rows."""

    time: Floats
    loss: Floats
    oil: Floats
    readings: Floats
    rows: np.ndarray
    noise: float

    @classmethod
    def of(cls, record: BenchRecord, time: Floats, current: Floats) -> ArmatureHeat:
        """From currents (n), A, at ``time`` (n)."""
        read = record.signals["armature_temp"]
        oil = record.signals.get("oil_temp")
        within = (read.time >= time[0]) & (read.time <= time[-1])
        rows = np.searchsorted(time, read.time[within]).clip(0, len(time) - 1)
        mean = float(np.mean(oil.value)) if oil is not None and len(oil) else read.value[0]
        return cls(
            time,
            np.nan_to_num(current) ** 2,
            np.full(len(time), mean),
            read.value[within],
            rows,
            record.std_of_mean("armature_temp", 1),
        )

    @property
    def own(self) -> Floats:
        """The temperature at the start, °C."""
        return np.array([[float(np.mean(self.readings[:5])), START]])

    def temperature(self, p: Parameters, own: Floats) -> Floats:
        """ϑ_a (n), °C."""
        step = float(self.time[1] - self.time[0]) / p["armature_heat_capacity"]
        slope = p["armature_resistance"] * p["resistance_temp_coefficient"]
        cold = p["armature_resistance"] - slope * p["armature_reference_temp"]
        temp = np.empty(len(self.time))
        rise = np.array([cold, slope]) * step
        _heated(own[0], rise, p["armature_conductance"] * step, self.oil, self.loss, temp)
        return temp

    def errors(self, temp: Floats) -> Floats:
        """Of the readings, each over its noise."""
        return np.asarray((self.readings - temp[self.rows]) / self.noise)
