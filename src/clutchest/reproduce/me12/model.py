"""The paper's model beside a drive: run open loop from 0 s on, compared with what was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.open_loop import OpenLoop, open_loop
from clutchest.models.dry_clutch.equations import DRY_CLUTCH, following_speed, with_measured_power
from clutchest.models.regimes import Mode
from clutchest.reproduce.me12.data import Setup
from clutchest.signals import Floats, Signals

RATE = 10.0  # Hz, that of the paper's residuals
P_MODELLED = following_speed(DRY_CLUTCH)
P_MEASURED = with_measured_power(P_MODELLED)
STATIC = {"expansion_body": 0.0, "expansion_disc": 0.0}  # M_c = M_ref(x)
NO_DISC = {"expansion_disc": 0.0}
NO_CAP = {"disc_body_temp_cap": 1e6}  # K


@dataclass(frozen=True, slots=True)
class Compared:
    """A drive beside the model: ``measured`` M_c,meas Nm, and ``slipping``, shape (m,) as
    ``run.time``."""

    run: OpenLoop
    measured: Floats
    slipping: NDArray[np.bool_]

    @classmethod
    def of(
        cls, drive: Signals, setup: Setup, power_measured: bool | None = None, rate: float = RATE
    ) -> Compared:
        """Run the setup's model along ``drive``."""
        measured = setup.power_measured if power_measured is None else power_measured
        run = open_loop(drive, setup.vehicle, P_MEASURED if measured else P_MODELLED, rate)
        slips = (run.mode == Mode.slipping) & (run.flags.min(axis=1) > 0)
        return cls(run, run.quantity("measured_torque")[0], slips)

    @property
    def residual(self) -> Floats:
        """Modelled less measured torque, Nm."""
        return self.run.torque - self.measured

    def reference(self, **parameters: float) -> tuple[Floats, Floats]:
        """(x_cor mm, M_ref(x_cor) Nm): (11) and (5), with other parameters if given."""
        x, torque = self.run.quantity("corrected_position", "reference_torque", **parameters)
        return x, torque


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
