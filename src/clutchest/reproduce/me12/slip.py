"""Figs. 3 and 4: no correlation of torque with slip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import NONE, Setup
from clutchest.reproduce.me12.model import STATIC, Compared
from clutchest.signals import Floats

LEAST = 40.0  # Nm: the clutch transmits
STEADY = 2.0  # rad/s², of the engine: between two steps
LARGEST = 0.05  # of the mean torque, over all of the slip: less is no dependence
SEEN = (63.0, 136.0)  # rad/s, 600 and 1300 rpm


@dataclass(frozen=True, slots=True)
class Steps:
    """Slip rad/s and clutch torque Nm while the engine speed is constant, one entry per step
    (s,): ``torque`` as measured, ``level`` at the step's curve and temperatures."""

    compared: Compared
    slip: Floats
    torque: Floats
    level: Floats

    @classmethod
    def of(cls, setup: Setup) -> Steps:
        """Drive them and run the model along."""
        compared = Compared.of(setup.drive("slip-steps", 1), setup)
        run = compared.run
        still = np.abs(run.quantity("engine_acceleration")[0]) < STEADY
        slip = run.quantity("slip_speed")[0]
        steady = compared.slipping & still & (compared.measured > LEAST) & (slip > SEEN[0] - 5.0)
        rows = np.flatnonzero(steady)
        steps = np.split(rows, np.flatnonzero(np.diff(run.time[rows]) > 0.15) + 1)
        steps = [step for step in steps if len(step) >= 3]
        means = [
            [values[step].mean() for step in steps]
            for values in (slip, compared.measured, run.torque)
        ]
        return cls(compared, *(np.array(m) for m in means))

    def slope(self) -> tuple[float, float]:
        """Relative change of the torque, at one curve and temperature, over the whole range of
        slip; and its standard deviation."""
        ratio, slip = self.torque / self.level, self.slip - self.slip.mean()
        each = (slip @ ratio) / (slip @ slip)
        left = ratio - ratio.mean() - each * slip
        error = np.sqrt(left @ left / (len(slip) - 2) / (slip @ slip))
        span = (SEEN[1] - SEEN[0]) / ratio.mean()
        return float(each * span), float(error * span)


def independent(setup: Setup) -> Verdict:
    """D3: significantly less than ``LARGEST`` from 600 to 1300 rpm."""
    steps = Steps.of(replace(setup, imperfections=NONE))
    change, std = steps.slope()
    return Verdict(
        f"{100 * change:+.1f} ± {100 * std:.1f} % from 600 to 1300 rpm, {len(steps.slip)} steps, "
        f"{steps.torque.min():.0f}–{steps.torque.max():.0f} Nm",
        abs(change) + 2 * std < LARGEST and 50 <= steps.torque.mean() <= 250,
        {"change": change, "std": std, "steps": len(steps.slip)},
        steps,
    )


CLAIMS = (
    Claim(
        "D3",
        "torque at constant position against slip, corrected for heat",
        "Figs. 3, 4",
        "no correlation from 600 to 1300 rpm on an axis of 50–250 Nm (accepted: clearly below 5 %)",
        independent,
        {
            "friction that falls with slip": lambda s: replace(
                s, effects={"friction_speed": {"slope": -0.12}}
            ),
            "static curve": lambda s: s.modelled(**STATIC),
        },
    ),
)
