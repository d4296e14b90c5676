"""How well a machine's output follows what is asked of it, actuation by actuation.

Times count from the request, where one is mapped, else from when the actuator begins to act.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchest.estimate.run import Engagement, Track, TrackingFigures
from clutchest.models.declarations import OutputTracking
from clutchest.models.regimes import runs
from clutchest.signals import Floats, Signal, Signals

APART = 0.05  # s; interruptions of the drive that are shorter end no actuation
SHORTEST = 0.1  # s of an actuation
RELEASED = 0.9  # of the level that was held: below, the actuation is being released
HELD = 0.3  # of the time up to the release, at its end: the response has settled in it
STEADY = 0.05  # relative spread of a drive that is held
BAND = 0.05  # of the settled output: settled within it
FEWEST = 5  # samples of a settled stretch
PATIENCE = 10.0  # s, within which a release takes the output away


def responses(
    signals: Signals, track: Track, tracking: OutputTracking | None, noise: Mapping[str, float]
) -> tuple[TrackingFigures, ...]:
    """The actuations of one drive in order of time; none where the ``tracking`` is not declared or
    what drives is not mapped.

    ``noise``: standard deviation of signals by name.
    """
    if tracking is None or tracking.drive not in signals.available:
        return ()
    output, sensor = _output(signals, track, tracking)
    if output is None or len(output) < FEWEST:
        return ()
    request = None
    if tracking.request in signals.available:
        request = signals[tracking.request].only_valid()
    drive = signals[tracking.drive].only_valid()
    return tuple(
        actuation.figures(noise.get(sensor, 0.0), bool(sensor))
        for actuation in actuations(drive, output, request, tracking)
    )


def unmeasured_band(
    tracking: OutputTracking | None, drive: Signals, track: Track, uninformed: Sequence[str]
) -> str | None:
    """That an output without a sensor is a band from priors, in words; None where it is measured
    or every state is informed.

    ``uninformed``: states that no available signal informs.
    """
    estimate = track.clutch_torque
    if tracking is None or estimate is None or not uninformed:
        return None
    if any(name in drive.available for name in tracking.measured):
        return None
    passed = estimate.valid & (np.abs(estimate.value) > tracking.onset)
    if not passed.any():
        return None
    band = float(np.median(estimate.std[passed] / np.abs(estimate.value[passed])))
    prior = " and ".join(name.replace("_", " ") for name in uninformed)
    return (
        f"the clutch torque is not measured: it is a band, ±{100 * band:.0f} % (one standard "
        f"deviation) in the median, most of it the prior of the {prior}"
    )


def during(
    events: Sequence[Engagement], found: Sequence[TrackingFigures], unit: str
) -> list[dict[str, Any]]:
    """Per event the figures of the first actuation that overlaps it and no event before, None for
    each where there is none."""
    left, figures = list(found), []
    for event in events:
        end = event.start_s + event.duration_s
        own = next((r for r in left if r.start_s < end and r.end_s > event.start_s), None)
        named = TrackingFigures.no_figures(unit)
        if own is not None:
            left.remove(own)
            named = own.figures(unit)
        figures.append({key: named[key] for key in named if key not in ("start_s", "end_s")})
    return figures


def _output(signals: Signals, track: Track, tracking: OutputTracking) -> tuple[Signal | None, str]:
    """The output, and the name of the signal that measures it, "" where it is estimated."""
    for name in tracking.measured:
        if name in signals.available:
            return signals[name].only_valid(), name
    return estimated_output(track, tracking), ""


def estimated_output(track: Track, tracking: OutputTracking) -> Signal | None:
    """The output as it is estimated, None where none of it is valid."""
    estimate = track.clutch_torque
    if estimate is None or not estimate.valid.any():
        return None
    return Signal.of("", tracking.unit, track.time, estimate.value).only_valid()


def actuations(
    drive: Signal, output: Signal, request: Signal | None, tracking: OutputTracking
) -> list[Actuation]:
    """All actuations, in order of time, by valid samples of what drives, of the output and of what
    asks for it."""
    spans = _spans(drive, tracking.least)
    ends = [*(start for start, _ in spans[1:]), np.inf][: len(spans)]
    return [
        Actuation(drive, output, request, tracking, start, stop, following)
        for (start, stop), following in zip(spans, ends, strict=True)
    ]


def _spans(drive: Signal, least: float) -> list[tuple[float, float]]:
    """(start, end) in s of what lasts long enough, with short interruptions in it."""
    first, stop = runs(np.abs(drive.value) > least)
    spans: list[tuple[float, float]] = []
    for a, b in zip(drive.time[first], drive.time[stop - 1], strict=True):
        if spans and a - spans[-1][1] < APART:
            spans[-1] = (spans[-1][0], float(b))
        else:
            spans.append((float(a), float(b)))
    return [(a, b) for a, b in spans if b - a >= SHORTEST]


@dataclass(frozen=True, slots=True)
class Actuation:
    """One actuation from ``start`` to ``stop`` s, and when the ``following`` one begins."""

    drive: Signal
    output: Signal
    request: Signal | None
    tracking: OutputTracking
    start: float
    stop: float
    following: float

    def figures(self, noise: float, measured: bool) -> TrackingFigures:
        """Its figures; ``noise``: standard deviation of the sensor of the output."""
        release, held = self._release()
        begin = self._requested()
        time, value = _between(self.output, begin, release)
        sign = 1.0 if not len(value) or value[np.argmax(np.abs(value))] >= 0.0 else -1.0
        value = sign * value
        onset = self._onset(time, value)
        peak = float(value.max()) if len(value) else 0.0
        settled = rise = overshoot = settling = error = ripple = None
        last = time > release - HELD * (release - begin)
        if held and onset is not None and np.count_nonzero(last) >= FEWEST:
            settled = float(value[last].mean())
            if settled > self.tracking.onset:
                rise = _rise(time, value, settled)
                overshoot = peak / settled - 1.0
                settling = _settling(time, value, settled, begin)
                error = self._error(settled, sign, float(time[last][0]), release)
                ripple = _ripple(time[last], value[last], noise)
        return TrackingFigures(
            start_s=begin,
            release_s=release,
            end_s=self.stop,
            delay_s=None if onset is None else onset - begin,
            peak=sign * peak,
            settled=None if settled is None else sign * settled,
            rise_s=rise,
            overshoot=overshoot,
            settling_s=settling,
            error=error,
            ripple=ripple,
            fall_s=self._fall(release, sign) if onset is not None else None,
            resolution_s=float(np.median(np.diff(time))) if len(time) > 1 else 0.0,
            measured=measured,
        )

    def _release(self) -> tuple[float, bool]:
        """When the release begins, and whether the drive was held at one level up to then."""
        time, value = _between(self.drive, self.start, self.stop)
        value = np.abs(value)
        level = float(np.median(value[len(value) // 2 :]))
        above = np.flatnonzero(value >= RELEASED * level)
        release = float(time[above[-1]])
        late = value[(time > release - HELD * (release - self.start)) & (time <= release)]
        return release, len(late) >= FEWEST and float(late.std()) < STEADY * level

    def _requested(self) -> float:
        """When the request begins that led to this actuation: not before the one before ended."""
        if self.request is None:
            return self.start
        time, value = self.request.time, np.abs(self.request.value) > self.tracking.onset
        k = int(np.searchsorted(time, self.start, side="right")) - 1
        while k > 0 and value[k] and value[k - 1]:
            k -= 1
        return min(float(time[k]), self.start) if k >= 0 and value[k] else self.start

    def _onset(self, time: Floats, value: Floats) -> float | None:
        risen = np.flatnonzero(value > self.tracking.onset)
        return float(time[risen[0]]) if len(risen) else None

    def _error(self, settled: float, sign: float, since: float, until: float) -> float | None:
        if self.request is None:
            return None
        _, asked = _between(self.request, since, until)
        return settled - float(np.mean(sign * asked)) if len(asked) else None

    def _fall(self, release: float, sign: float) -> float | None:
        """From the release until the output is below its onset, None where the next comes first or
        it takes too long."""
        time, value = _between(self.output, release, min(self.following, release + PATIENCE))
        gone = np.flatnonzero(sign * value < self.tracking.onset)
        return float(time[gone[0]]) - release if len(gone) else None


def _between(signal: Signal, since: float, until: float) -> tuple[Floats, Floats]:
    """Times and values from ``since`` to ``until`` s."""
    a = int(np.searchsorted(signal.time, since))
    b = int(np.searchsorted(signal.time, until, side="right"))
    return signal.time[a:b], signal.value[a:b]


def _rise(time: Floats, value: Floats, settled: float) -> float:
    """From 10 to 90 % of the settled value, s, straight between samples."""
    low, high = (_crossing(time, value, share * settled) for share in (0.1, 0.9))
    return high - low


def _crossing(time: Floats, value: Floats, level: float) -> float:
    k = int(np.argmax(value >= level))
    if k == 0:
        return float(time[0])
    share = (level - value[k - 1]) / (value[k] - value[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def _settling(time: Floats, value: Floats, settled: float, begin: float) -> float | None:
    """Until the value stays within the band, s; None where it does not before its end."""
    out = np.flatnonzero(np.abs(value - settled) > BAND * settled)
    if not len(out):
        return float(time[0]) - begin
    return None if out[-1] + 1 >= len(time) else float(time[out[-1] + 1]) - begin


def _ripple(time: Floats, value: Floats, noise: float) -> float:
    """Root mean square about a straight line, less what noise alone gives."""
    line = np.polyval(np.polyfit(time - time[0], value, 1), time - time[0])
    variance = float(np.sum((value - line) ** 2)) / (len(value) - 2)
    return float(np.sqrt(max(variance - noise**2, 0.0)))
