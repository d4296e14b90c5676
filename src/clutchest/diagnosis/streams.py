"""Tests of frames and of single signals, batch by batch; they need no equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.can.activity import RESOLUTION_NS
from clutchest.diagnosis.codes import check_codes
from clutchest.diagnosis.faults import Alarm, Batch, StreamTest, stream_tests
from clutchest.diagnosis.faults.missing import Missing
from clutchest.diagnosis.faults.silent import BUS, Silent
from clutchest.estimate.contradiction import Contradiction
from clutchest.signals import Floats, Signal, Signals, Traffic
from clutchest.vehicle import Vehicle

RATE = 1.0  # false alarms per 1000 h and monitor, where the vehicle file states none
RECOVERY_S = 1.0  # s after the end of a fault, until samples and other tests count again
# The bus pauses for longer than SILENT usual gaps between any two frames, at most half of the
# longest healthy gap of a message; the usual gap is known from USUAL_FROM frames on.  As activity
# is thinned, up to ACTIVE s may lie between its times on a bus that never pauses.
SILENT = 2.0
ACTIVE = 2e-9 * RESOLUTION_NS
USUAL_FROM = 20
SILENT_BUS = f"{Silent.kind}:{BUS}"


class StreamTests:
    """All such tests of one drive.  Give :meth:`take` new data in order of time."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.tests = stream_tests(vehicle, vehicle.false_alarms_per_1000h)
        check_codes(vehicle, [test.name for test in self.tests])
        self.frames = False  # whether any frame has been received
        self._bus = next(test for test in self.tests if isinstance(test, Silent))
        self._bus.messages = frozenset(test.subject for test in self.tests if test.of_message)
        self._channels: dict[int, Silent] = {}  # with mapped messages
        self._active: set[int] = set()
        self._last, self._bus_time, self._usual = 0.0, 0.0, 1.0

    def take(self, new: Signals, until: float) -> list[StreamTest]:
        """Test the samples and frames of ``new``, which end by ``until`` s on the drive's clock.

        Returns the tests that have begun to fail.  Times in ``new`` count from the drive's start.
        """
        self.frames |= any(len(t) for t in new.traffic.values())
        self._add_channels(new)
        before = {test.name: len(test.alarms) for test in self.tests}
        batch = self._batch(new, until)
        for test in self.tests:
            if test is not self._bus and (not test.of_message or test.subject in new.traffic):
                test.take(batch)
        return [test for test in self.tests if len(test.alarms) > before[test.name]]

    @property
    def failed(self) -> bool:
        """Whether any test has failed that is of consequence to the estimates."""
        return any(test.alarms and not test.harmless for test in self.tests)

    def explain(self, found: Contradiction) -> bool:
        """Whether a failed test says more of signals and model that contradict each other: any, if
        nothing else explains it, or that of a part which does not do what ``found.signal`` says."""
        parts = (t for t in self.tests if t.alarms and not t.harmless and t.of_part)
        return (not found.is_explained and self.failed) or any(
            found.signal in t.signals for t in parts
        )

    def masked(self, test: StreamTest, alarm: Alarm) -> list[StreamTest]:
        """The tests of the whole message or bus, or of a signal that ``test`` uses, whose faults
        explain its ``alarm``."""
        mapped = [self.vehicle.signals[n] for n in test.signals if n in self.vehicle.signals]
        messages = test.messages or {signal.bus.message for signal in mapped}

        def explains(other: StreamTest) -> bool:
            masks = bool(other.messages & messages) and other.kind in test.masked_by
            masks &= other.kind != test.kind or other is self._bus
            masks |= other.subject in test.signals and other.kind in test.masked_by_signal
            return masks and any(_overlap(alarm, a) for a in other.alarms)

        return [other for other in self.tests if other is not test and explains(other)]

    def _add_channels(self, new: Signals) -> None:
        """A test of each channel with mapped messages, once there are several channels."""
        for name, traffic in new.traffic.items():
            if traffic.channel is None:
                continue
            if traffic.channel not in self._channels:
                test = Silent(str(traffic.channel), self.vehicle.false_alarms_per_1000h)
                self._channels[traffic.channel] = test
            self._channels[traffic.channel].messages |= {name}
        self._active |= set(new.activity)
        if len(self._active) > 1:
            self.tests += [test for test in self._channels.values() if test not in self.tests]

    def _batch(self, new: Signals, until: float) -> Batch:
        active = {str(channel): time for channel, time in new.activity.items()}
        times = [*active.values(), *(t.time for t in new.traffic.values())]
        every = np.unique(np.concatenate(times)) if times else np.zeros(0)
        known = len(self._bus.alarms)
        self._bus.take(Batch({}, {}, active={BUS: every}))
        gaps = np.diff(every, prepend=self._last)
        if len(gaps) >= USUAL_FROM:
            self._usual = float(np.percentile(gaps, 99))
        bounds = [t.bound for t in self.tests if isinstance(t, Missing) and t.tail is not None]
        usual = max(SILENT * self._usual, ACTIVE)
        longest = min([usual, *(bound / 2.0 for bound in bounds)])
        ended = [alarm.ended or 0.0 for alarm in self._bus.alarms[known:]]
        counted = np.where(np.isin(every, ended), gaps, np.minimum(gaps, longest))
        points = np.concatenate([[self._last], every])
        bus_time = self._bus_time + np.concatenate([[0.0], np.cumsum(counted)])
        self._last, self._bus_time = float(points[-1]), float(bus_time[-1])
        silent = min(max(until - self._last, 0.0), longest)

        def on(time: Floats) -> Floats:
            return np.interp(time, points, bus_time)

        return Batch(
            new.signals,
            new.traffic,
            {name: on(t.time) for name, t in new.traffic.items()},
            self._bus_time + silent,
            active,
            {channel: on(time) for channel, time in active.items()},
        )


def _overlap(alarm: Alarm, other: Alarm) -> bool:
    """Whether ``alarm`` was raised while the ``other`` lasted, or soon after."""
    over = other.ended is not None and alarm.begun > other.ended + RECOVERY_S
    return alarm.detected >= other.begun - RECOVERY_S and not over


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
        activity={channel: time[rows(time)] for channel, time in signals.activity.items()},
    )
