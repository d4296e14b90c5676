"""Tests of frames and of single signals, batch by batch; they need no equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.diagnosis.faults import Batch, StreamTest, stream_tests
from clutchest.diagnosis.faults.missing import Missing
from clutchest.signals import Floats, Signal, Signals, Traffic
from clutchest.vehicle import Vehicle

RATE = 1.0  # false alarms per 1000 h and monitor, where the vehicle file states none
# The whole bus is silent for longer than SILENT usual gaps between any two frames, at most half of
# the longest healthy gap of a message; the usual gap is known from USUAL_FROM frames on.
SILENT = 2.0
USUAL_FROM = 20


def false_alarms(vehicle: Vehicle) -> float:
    """False alarms per 1000 h and monitor that the vehicle file allows."""
    return vehicle.monitors.get("false_alarms_per_1000h", RATE)


class StreamTests:
    """All such tests of one drive.  Give :meth:`take` new data in order of time."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.tests = stream_tests(vehicle, false_alarms(vehicle))
        self.frames = False  # whether any frame has been received
        self._last, self._bus_time, self._usual = 0.0, 0.0, 1.0

    def take(self, new: Signals, until: float) -> list[StreamTest]:
        """Test the samples and frames of ``new``, which end by ``until`` s on the drive's clock.

        Returns the tests that have begun to fail.  Times in ``new`` count from the drive's start.
        """
        self.frames |= any(len(t) for t in new.traffic.values())
        batch = self._batch(new, until)
        before = [len(test.alarms) for test in self.tests]
        for test in self.tests:
            if not test.of_message or test.subject in new.traffic:
                test.take(batch)
        return [t for t, count in zip(self.tests, before, strict=True) if len(t.alarms) > count]

    def _batch(self, new: Signals, until: float) -> Batch:
        times = [t.time for t in new.traffic.values() if len(t)]
        every = np.unique(np.concatenate(times)) if times else np.zeros(0)
        gaps = np.diff(every, prepend=self._last)
        if len(gaps) >= USUAL_FROM:
            self._usual = float(np.percentile(gaps, 99))
        bounds = [t.bound for t in self.tests if isinstance(t, Missing) and t.tail is not None]
        longest = min([SILENT * self._usual, *(bound / 2.0 for bound in bounds)])
        points = np.concatenate([[self._last], every])
        bus_time = self._bus_time + np.concatenate([[0.0], np.cumsum(np.minimum(gaps, longest))])
        self._last, self._bus_time = float(points[-1]), float(bus_time[-1])
        silent = min(max(until - self._last, 0.0), longest)

        def on(traffic: Traffic) -> Floats:
            return np.interp(traffic.time, points, bus_time)

        return Batch(
            new.signals,
            new.traffic,
            {name: on(t) for name, t in new.traffic.items()},
            self._bus_time + silent,
        )


def compile_stream_tests(vehicle: Vehicle) -> None:
    """Compile these tests, by running them on a second of noise."""
    time = np.arange(100.0) * 0.01
    value: Floats = np.random.default_rng(1).standard_normal(len(time))
    no, none = np.zeros(len(time), bool), np.full(len(time), -1, np.int16)
    streams = StreamTests(vehicle)
    traffic = Traffic(time, no, none, 16, ~no, 0.01, True)
    messages = {test.subject for test in streams.tests if test.of_message}
    signals = {name: Signal.of(name, "", time, value) for name in vehicle.signals}
    streams.take(Signals(signals, traffic=dict.fromkeys(messages, traffic)), 1.0)


def between(signals: Signals, begin: float, end: float) -> Signals:
    """Samples and frames from ``begin`` up to, but not including, ``end`` s; times stay."""

    def rows(time: Floats) -> slice:
        a, b = np.searchsorted(time, (begin, end))
        return slice(int(a), int(b))

    return replace(
        signals,
        signals={name: s.take(rows(s.time)) for name, s in signals.items()},
        traffic={name: t.take(rows(t.time)) for name, t in signals.traffic.items()},
    )
