"""What an extension gains on the drive held out, of what the true model would.

Both are expected values: −ln(probability) of the drive without noise, beyond that of the same drive
without its cause, numbers of the truck fitted to it at the price of their priors.  Of a drive with
noise, what readings happen to be off by would weigh as much as most of what is hidden.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from blind.drives import OTHER_ROAD, Drive
from blind.likelihood import Likelihood
from blind.near_misses import FOREIGN
from blind.outsiders import Outsider
from clutchest.generator import DriveRequest
from clutchest.signals import Signals
from clutchest.simulated import Effects
from clutchest.vehicle import load_vehicle


@dataclass(frozen=True)
class HeldOut(Drive):
    """The other road of a drive's truck."""

    def signals(
        self,
        effects: Effects | None = None,
        outsider: Outsider | None = None,
        *,
        held_out: bool = True,
        noiseless: bool = False,
        scenario: str | None = None,
    ) -> Signals:
        return super().signals(effects, outsider, held_out=held_out, noiseless=noiseless)

    def request(
        self,
        effects: Effects | None = None,
        outsider: Outsider | None = None,
        scenario: str | None = None,
    ) -> DriveRequest:
        return replace(super().request(effects, outsider), seed=self.seed + OTHER_ROAD)


def on_held_out(drive: Drive, answer: Mapping[str, Any], extended: Path) -> dict[str, float]:
    """``gained`` in −ln(probability) by the ``extended`` vehicle file, ``possible`` by the model
    that knows what is hidden, and ``held_out_nll`` of the drive as it is expected without a cause.
    """
    model, given = (
        Likelihood(HeldOut(drive.seed, drive.noise, drive.mismatches)),
        answer["outsider"],
    )
    outsider = FOREIGN[given["name"]](given["size"], given["phase"]) if given else None
    vehicle = load_vehicle(extended) if extended.exists() else drive.vehicle
    other = vehicle if vehicle.effect_numbers != drive.vehicle.effect_numbers else None
    gained, possible = model.gains(model.twin(answer["effects"], outsider), other)
    return {"gained": gained, "possible": possible, "held_out_nll": len(model.clean.r) / 2.0}
