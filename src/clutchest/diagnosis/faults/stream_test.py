"""Tests of frames and of single signals: one class per fault, fed batch by batch.

A new one is a new file in this folder with one class.  Faults that only the equations show are
declared by their machine: :class:`~clutchest.models.fault.ModelFault`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from clutchest.signals import Floats, Signal, Traffic
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Batch:
    """New samples of signals and frames of messages.

    ``bus_time``: for every message, its frames' times (n) on a clock that stands still in short
    pauses of the whole bus; ``bus_until`` is where the batch ends on that clock.  ``active``: for
    the bus and each channel the times, s, at which there were frames, ``active_bus_time`` on that
    clock.
    """

    signals: Mapping[str, Signal]
    traffic: Mapping[str, Traffic]
    bus_time: Mapping[str, Floats] = field(default_factory=dict)
    bus_until: float = 0.0
    active: Mapping[str, Floats] = field(default_factory=dict)
    active_bus_time: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(slots=True)
class Alarm:
    """A test failed at ``detected`` s; the fault began at ``begun`` s and healed at ``ended`` s,
    None while it lasts.  ``chance``: p-value of the alarm in a healthy vehicle within that time."""

    begun: float
    detected: float
    ended: float | None = None
    chance: float = 0.0
    what: str = ""


class StreamTest(ABC):
    """A sequential test of one message or signal: takes new data, keeps its state.

    ``name`` as ``diagnosis.json`` names the fault; ``per_1000h`` false alarms; ``alarms`` so far;
    ``enabled`` s during which the test could have detected the fault.  ``of_message``: the subject
    is a message, not a signal; ``harmless``: the signals' values remain valid.  ``masked_by``,
    ``masked_by_signal``: kinds of faults of the whole message, or of one of the ``signals`` that
    the test uses, that make this test fail too.  ``messages``: those whose fault it is.
    """

    kind: ClassVar[str]
    fmi: ClassVar[int]
    of_message: ClassVar[bool] = False
    harmless: bool = False
    masked_by: ClassVar[tuple[str, ...]] = ("missing", "frozen")
    masked_by_signal: ClassVar[tuple[str, ...]] = ()

    def __init__(self, subject: str, per_1000h: float) -> None:
        self.subject, self.per_1000h = subject, per_1000h
        self.signals: tuple[str, ...] = () if self.of_message else (subject,)
        self.messages: frozenset[str] = frozenset([subject]) if self.of_message else frozenset()
        self.alarms: list[Alarm] = []
        self.enabled = 0.0

    @classmethod
    @abstractmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """One test for each message or signal of this vehicle that may have the fault."""

    @abstractmethod
    def take(self, batch: Batch) -> None:
        """Test new data."""

    @property
    @abstractmethod
    def threshold(self) -> float | None:
        """What the test's statistic must exceed to fail; None before there were data to test."""

    @property
    @abstractmethod
    def why(self) -> str:
        """What is tested against which limit; or why the test could not run."""

    @property
    def name(self) -> str:
        """The fault's name."""
        return f"{self.kind}:{self.subject}"

    @property
    def of_part(self) -> bool:
        """Whether the subject is a part, of which the ``signals`` tell: no signal, no message."""
        return bool(self.signals) and self.subject not in self.signals

    @property
    def failing(self) -> bool:
        """Whether it fails now."""
        return bool(self.alarms) and self.alarms[-1].ended is None

    def fail(self, alarm: Alarm) -> None:
        """The fault is detected."""
        self.alarms.append(alarm)

    def heal(self, time: float) -> None:
        """The fault is no longer present."""
        if self.failing:
            self.alarms[-1].ended = time

    def change(self, changes: Floats, what: Callable[[float, float], str]) -> None:
        """Fail and heal by the ``changes`` (n, 2) of
        :func:`~clutchest.diagnosis.sequential.cusum_step`; ``what(begun, detected)`` describes the
        fault."""
        for begun, now in changes.tolist():
            if np.isfinite(begun):
                self.fail(Alarm(begun, now, what=what(begun, now)))
            else:
                self.heal(now)
