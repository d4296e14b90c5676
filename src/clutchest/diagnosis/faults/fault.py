"""What a fault test is: one fault that it watches for, batch after batch.

A new fault is a new file in this folder with one class.  Tests of frames and of single signals are
:class:`StreamTest`; what only the equations show is a :class:`ModelFault`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from clutchest.models import machine_of
from clutchest.models.effects import Effect, Number
from clutchest.signals import Floats, Signal, Traffic
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Batch:
    """What is new since the batch before: samples of signals and frames of messages, up to the time
    ``until`` s on the drive's clock.

    ``alive``: for every message, its frames' times (n) on a clock that stands still while the whole
    bus is silent; ``alive_until`` the same of ``until``.
    """

    signals: Mapping[str, Signal]
    traffic: Mapping[str, Traffic]
    until: float
    alive: Mapping[str, Floats] = field(default_factory=dict)
    alive_until: float = 0.0


@dataclass(slots=True)
class Alarm:
    """A test failed: at ``detected`` s, of something that had begun at ``begun`` s; ``ended`` s,
    None while it lasts.  ``chance``: that a healthy vehicle shows as much within the same time."""

    begun: float
    detected: float
    ended: float | None = None
    chance: float = 0.0
    what: str = ""


class StreamTest(ABC):
    """One test that takes what is new and carries its state on.

    ``name`` as interface names the fault; ``per_1000h`` false alarms; ``alarms`` so far;
    ``enabled`` s during which the test could have seen the fault.  ``of_message``: the subject is a
    message, not a signal; ``harmless``: signals stay true for all that; ``behind``: kinds of a
    message's fault that show in this test too.
    """

    kind: ClassVar[str]
    fmi: ClassVar[int]
    of_message: ClassVar[bool] = False
    harmless: ClassVar[bool] = False
    behind: ClassVar[tuple[str, ...]] = ("missing", "frozen")

    def __init__(self, subject: str, per_1000h: float) -> None:
        self.subject, self.per_1000h = subject, per_1000h
        self.alarms: list[Alarm] = []
        self.enabled = 0.0

    @classmethod
    @abstractmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """One test for everything in this vehicle that may have the fault."""

    @abstractmethod
    def take(self, batch: Batch) -> None:
        """Judge what is new."""

    @property
    @abstractmethod
    def threshold(self) -> float | None:
        """What the test's statistic must exceed to fail, None before there was anything to test."""

    @property
    @abstractmethod
    def why(self) -> str:
        """What is watched, and by how much it may depart; or why nothing could be tested."""

    @property
    def name(self) -> str:
        """The fault's name."""
        return f"{self.kind}:{self.subject}"

    @property
    def failing(self) -> bool:
        """Whether it fails now."""
        return bool(self.alarms) and self.alarms[-1].ended is None

    def fail(self, alarm: Alarm) -> None:
        """The fault is there."""
        self.alarms.append(alarm)

    def heal(self, time: float) -> None:
        """It is there no more."""
        if self.failing:
            self.alarms[-1].ended = time

    def change(self, changes: Floats, what: Callable[[float, float], str]) -> None:
        """Fail and heal as :func:`~clutchest.diagnosis.sequential.climb` tells by ``changes``
        (n, 2); ``what`` is wrong from … to, in words."""
        for begun, now in changes.tolist():
            if np.isfinite(begun):
                self.fail(Alarm(begun, now, what=what(begun, now)))
            else:
                self.heal(now)


class ModelFault:
    """A fault that the equations show: one gain of an effect.

    ``name`` as interface names it, of which ``model``; ``effect`` and ``key`` of its gain; ``size``
    the smallest that matters, in the gain's unit; ``fmi`` J1939's failure mode where it is too much
    and where it is too little.
    """

    name: ClassVar[str]
    model: ClassVar[str]
    effect: ClassVar[str]
    key: ClassVar[str]
    size: ClassVar[float]
    fmi: ClassVar[tuple[int, int]]

    def make(self) -> Effect:
        """The effect, to be put into the equations."""
        return machine_of(self.model).effects[self.effect]

    @property
    def number(self) -> Number:
        """The gain: its unit and its largest plausible sizes."""
        return next(n for n in self.make().gains if n.key == self.key)

    def onset(self, hours: float) -> Mapping[str, float]:
        """Other faults, and how much of each per unit, that this one amounts to less of where it
        begins ``hours`` after the drive."""
        return {}
