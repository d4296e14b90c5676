"""Whether a drive's signals can be right whatever the parameters are, of a replay and live."""

from __future__ import annotations

from collections.abc import Mapping

from clutchest.estimate.against_slip import against_slip
from clutchest.estimate.against_work import against_work
from clutchest.estimate.contradiction import Contradiction
from clutchest.estimate.other_ratio import at_another_ratio
from clutchest.signals import Signal, Signals
from clutchest.vehicle import Vehicle

FIRST_S, LAST_S = 20.0, 640.0  # s of a live drive; judged again each time that it has doubled


def impossible(drive: Signals, vehicle: Vehicle) -> Contradiction | None:
    """That signals of one drive contradict each other, by what needs next to no parameter."""
    for check in (at_another_ratio, against_slip, against_work):
        if (found := check(drive, vehicle)) is not None:
            return found
    return None


class BeginOfDrive:
    """The begin of a drive that is going on: what is read wrongly is so from the first sample on.

    Call :meth:`take` with the new samples of its signals.  Held are those up to ``LAST_S``.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self._due_s = vehicle, FIRST_S
        machine = vehicle.machine
        names = {name for c in machine.columns if c.geared_by for name in (c.name, c.geared_by)}
        for way in (machine.driving, machine.storing):
            names |= set(way.signals if way else ())
        self._names = names | set(machine.regimes.signals)
        self._parts: dict[str, list[Signal]] = {}

    def take(
        self, new: Mapping[str, Signal], now: float, last: bool = False
    ) -> Contradiction | None:
        """What is found at ``now`` s, up to which all samples have come; ``last`` at the end."""
        if self._due_s > LAST_S:
            return None
        for name in self._names & set(new):
            self._parts.setdefault(name, []).append(new[name])
        if now < self._due_s and not last:
            return None
        while self._due_s <= now:
            self._due_s *= 2.0
        self._parts = {name: [Signal.joined(parts)] for name, parts in self._parts.items()}
        drive = Signals({name: whole for name, (whole,) in self._parts.items()}, end=now)
        if self._due_s > LAST_S:
            self._parts = {}
        return impossible(drive, self.vehicle)
