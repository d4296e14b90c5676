"""Discover, extend, discover again, until nothing is found or held-out drives gain nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from clutchest.discovery.discover import discover
from clutchest.discovery.result import Discovery
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

LONGEST = 5  # findings in a chain


def chain(
    signals: Signals,
    vehicle: Vehicle,
    holdout: Sequence[Signals],
    longest: int = LONGEST,
    progress: Progress | None = None,
) -> list[Discovery]:
    """Discoveries one after another, each with the vehicle that the one before extended.

    The last one is what the data say of the most extended vehicle: nothing, or a finding whose
    gain on the ``holdout`` drives is not significant, and which therefore is not added; or, after
    the ``longest`` chain, one more.
    """
    found: list[Discovery] = []
    while len(found) < longest:
        found.append(discover(signals, vehicle, holdout=holdout, progress=progress))
        if not is_bought(found[-1]):
            break
        vehicle = found[-1].extended
    return found


def is_bought(discovery: Discovery) -> bool:
    """Whether a finding improves the prediction of held-out drives significantly (95 %)."""
    gain = discovery.gain
    return discovery.verdict != "none" and gain is not None and gain.ci95[0] > 0.0


def extended_by(found: Sequence[Discovery], vehicle: Vehicle) -> Vehicle:
    """The vehicle after the last finding of a chain that was bought; itself where none was."""
    return next((each.extended for each in reversed(found) if is_bought(each)), vehicle)


def summary(found: Sequence[Discovery]) -> dict[str, Any]:
    """What the first finding says (``verdict``, ``causes``, ``where``, ``gain``) and the ``chain``
    of all, each with ``bought``, ``fit`` (p-value that residuals are noise, before and after),
    ``sentence`` and ``warnings``."""
    steps = [_step(each) for each in found]
    kept = ("verdict", "causes", "where", "gain")
    return {**{key: steps[0][key] for key in kept}, "chain": steps}


def _step(discovery: Discovery) -> dict[str, Any]:
    whole, after = discovery.summary(), discovery.fit_extended
    kept = ("verdict", "sentence", "causes", "rivals", "where", "gain", "warnings")
    return {
        **{key: whole[key] for key in kept},
        "sets": [list(names) for names in discovery.sets],
        "curve": discovery.curve,
        "fit": {"before": discovery.fit.p_value, "after": after and after.p_value},
        "bought": is_bought(discovery),
    }
