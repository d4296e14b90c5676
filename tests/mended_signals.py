"""Drives whose signals read something else."""

from __future__ import annotations

from dataclasses import replace


def mended(signals, **changes):
    """The drive with some of its signals changed, each by a function of its values."""
    new = {
        name: replace(signals[name], value=change(signals[name].value))
        for name, change in changes.items()
    }
    return replace(signals, signals={**signals.signals, **new})
