"""Held-out drives: others than the log, with its signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from clutchest.errors import ClutchestError
from clutchest.models.machine import Machine
from clutchest.signals import Signals


def with_signals_of(
    signals: Signals, other: Sequence[Signals], machine: Machine
) -> tuple[Signals, ...]:
    """The held-out drives with the signals of the log, no others.  Raises ClutchestError where one
    is a drive of the log, or lacks such a signal that its equations would be others."""
    used = signals.available_throughout
    for drive in other:
        name = names_of([drive]) or "a held-out drive"
        if any(drive.has_samples_of(own) for own in signals.drives):
            raise ClutchestError(f"{name}: has the readings of the log, expected another drive")
        common = used & drive.available
        if machine.to_fit(common) != machine.to_fit(used):
            raise ClutchestError(
                f"{name}: no valid sample of {', '.join(sorted(used - common))}, "
                "expected the signals of the log in what is held out"
            )
    return tuple(
        replace(drive, signals={name: drive[name] for name in used if name in drive})
        for drive in other
    )


def names_of(drives: Sequence[Signals]) -> str:
    """The names of the drives' files."""
    return ", ".join(Path(name).name for drive in drives for name in drive.sources)
