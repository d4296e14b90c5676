"""What a drive's timeline is made of: the signals that the equations require, the time at which
each sample was true, and whether a drive has enough of them."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from clutchest import memory_mapped
from clutchest.errors import ClutchestError
from clutchest.estimate.outliers import without_spikes
from clutchest.estimate.sample_timing import SampleTiming
from clutchest.models.model import Model
from clutchest.models.thresholds import Thresholds
from clutchest.shown import counted
from clutchest.signals import HEAD, LOST, Floats, Signal, Signals
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import process_noise

MOVING = 3.0  # times its noise, by which an input that holds its last value may change
COARSEST = 0.5  # s between samples of the anchor, unless the vehicle file states a longer gap


class Unusable(ClutchestError):
    """A drive without a signal that the model requires."""


@dataclass(frozen=True)
class DriveSetup:
    """Vehicle, equations, outputs at ``rate`` Hz, and ``delays`` s by signal on top of the vehicle
    file's."""

    vehicle: Vehicle
    model: Model
    rate: float
    delays: Mapping[str, float]

    @cached_property
    def thresholds(self) -> Thresholds:
        """Those by which regimes are judged."""
        return Thresholds.of(self.vehicle.modes)

    @cached_property
    def tables(self) -> tuple[Floats, Floats, Floats]:
        """Flags, process noise and longest step of every regime, as :class:`Timeline` has them."""
        flags = np.array(list(product((0.0, 1.0), repeat=len(self.model.regime))))
        certain = np.zeros((len(flags), len(self.model.doubted)))
        return (
            np.hstack([flags, certain]),
            _noise_table(self.vehicle, self.model, flags),
            self.model.by_pace(self.model.longest, flags),
        )

    @cached_property
    def _slow(self) -> frozenset[str]:
        """Inputs that may be missing for long."""
        return frozenset(i.name for i in self.model.inputs if i.gap > self.thresholds.gap)

    @cached_property
    def _fast(self) -> tuple[tuple[str, str], ...]:
        """The other inputs, each with the signal that it is made of."""
        return tuple(
            (i.name, self.model.slopes.get(i.name, i.name))
            for i in self.model.inputs
            if i.name not in self._slow
        )

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the machine's modes."""
        return self.vehicle.machine.regimes.modes

    def late(self, name: str) -> float:
        """By how much a signal's stamps lie after the time at which its values were true, s."""
        mapped = self.vehicle.signals.get(name)
        return (mapped.delay if mapped else 0.0) + self.delays.get(name, 0.0)

    def noise(self, name: str) -> float:
        """Standard deviation of a signal, SI."""
        mapped = self.vehicle.signals.get(name)
        return mapped.noise if mapped else 0.0

    def noise_ar(self, name: str) -> float:
        """AR(1) coefficient of a signal's noise, per sample."""
        mapped = self.vehicle.signals.get(name)
        return mapped.noise_ar if mapped else 0.0

    def cleaned(self, name: str, signal: Signal, timing: SampleTiming) -> tuple[Signal, int]:
        """The valid samples (``signal`` has no others), each at the time at which it was true,
        without outliers; and the number of outliers.

        An input that holds its last value keeps them: a live estimate does not wait for the next
        sample, by which one is detected.
        """
        outliers = 0
        if not self.held(name):
            signal, outliers = without_spikes(signal, self.noise(name), timing)
        late = self.late(name)
        return (replace(signal, time=signal.time - late) if late else signal), outliers

    def held(self, name: str) -> bool:
        """Whether a signal is an input that changes slowly and holds its last value."""
        return name in self._slow and name not in self.needed((name,))

    def fast(self, names: Container[str]) -> list[str]:
        """The inputs among ``names`` that must not be missing for long."""
        return [name for name, source in self._fast if source in names]

    def needed(self, names: Container[str]) -> list[str]:
        """The signals among ``names`` by which regimes are judged, or that must not be missing for
        long."""
        wanted = dict.fromkeys(
            (self.model.anchor, *self.fast(names), *self.vehicle.machine.regimes.signals)
        )
        return [name for name in wanted if name in names]


def held_on(signal: Signal, time: float) -> Signal:
    """The signal, with its last value repeated at ``time`` s if by then it has been missing for so
    long that it counts as lost: a signal without further samples is lost from its last one on."""
    if time - signal.time[-1] <= LOST:
        return signal
    return replace(
        signal,
        time=np.append(signal.time, time),
        value=np.append(signal.value, signal.value[-1]),
        why=np.append(signal.why, signal.why[-1]),
    )


def usable(
    signals: Signals, setup: DriveSetup
) -> tuple[dict[str, Signal], dict[str, SampleTiming]]:
    """The cleaned signals, those that are needed held on to the log's end, and their timing.

    Raises as :func:`timings_of` does.
    """
    timings, present = timings_of(signals, setup), {}
    for name, timing in timings.items():
        present[name], _ = setup.cleaned(name, signals[name].only_valid(), timing)
    for name in setup.needed(present):
        present[name] = held_on(present[name], signals.end - setup.late(name))
    return present, timings


def timings_of(signals: Signals, setup: DriveSetup) -> dict[str, SampleTiming]:
    """The sample timing of each signal with a valid sample.

    Raises Unusable where the model requires one of the others, ClutchestError where its anchor has
    too few samples.
    """
    model, timings = setup.model, {}
    for name, signal in signals.items():
        if len(first := _head(signal)):
            timings[name] = SampleTiming.of(first)
    needed = {i.name for i in model.inputs if i.default is None} - set(model.slopes)
    missing = sorted((needed | {model.anchor}) - set(timings))
    if missing:
        hints = "".join(f"; {warning}" for warning in signals.warnings[:4])
        raise Unusable(
            f"no valid sample of {', '.join(missing)}, required by the model of "
            f"'{setup.vehicle.name}'{hints}"
        )
    anchor, period = signals[model.anchor], timings[model.anchor].period
    coarsest = max(COARSEST, setup.thresholds.gap)  # a slow machine states that it may be missing
    if period > coarsest and np.count_nonzero(anchor.valid) > 1:
        raise ClutchestError(
            f"{model.anchor} has a sample every {period:g} s, expected at least one every "
            f"{coarsest:g} s ([modes] gap); are the times in seconds?"
        )
    return timings


def _head(signal: Signal) -> Signal:
    """The valid samples by which the timing of a signal is determined."""
    valid = signal.valid
    if not valid.any():
        return signal.take(slice(0))
    first = int(np.argmax(valid))
    last = int(np.searchsorted(signal.time, signal.time[first] + HEAD, side="right"))
    return signal.take(slice(first, last)).only_valid()


def warnings_of(signals: Signals, setup: DriveSetup) -> tuple[str, ...]:
    """Outliers and gaps of a drive, in words.  Raises as :func:`timings_of` does."""
    timings = timings_of(signals, setup)
    gap = setup.thresholds.gap
    steady = [name for name in setup.fast(timings) if name not in setup.model.slopes]
    needed, warnings, gap_warnings = setup.needed(timings), [], {}
    for name, timing in timings.items():
        outliers = count = 0
        gaps, last = [], np.nan
        for time, removed in _cleaned_times(name, signals[name], setup, timing):
            steps = np.diff(time, prepend=last)
            gaps += steps[steps > gap].tolist()
            last = float(time[-1]) if len(time) else last
            outliers, count = outliers + removed, count + len(time) + removed
        end = signals.end - setup.late(name)
        if name in needed and end - last > max(LOST, gap):  # as held_on has it
            gaps.append(end - last)
        if outliers:
            warnings.append(
                f"{name}: {counted(outliers, 'outlier')} far from both neighbours removed, "
                f"{100 * outliers / count:.2g} %"
            )
        if gaps:
            gap_warnings[name] = (
                f"{name}: {counted(len(gaps), 'gap')}, the longest {max(gaps):.1f} s; "
                "energy dissipated in a gap is not counted"
            )
    gaps_of_steady = (gap_warnings[name] for name in steady if name in gap_warnings)
    return (*warnings, *gaps_of_steady, *_held_and_moving(signals, setup, timings))


def _held_and_moving(
    signals: Signals, setup: DriveSetup, timings: Mapping[str, SampleTiming]
) -> Iterator[str]:
    """Of inputs that hold their last value although it changes by far more than their noise."""
    for name in filter(setup.held, timings):
        step, noise = np.diff(signals[name].only_valid().value), setup.noise(name)
        change = float(np.sqrt(np.mean(step**2) / 2.0)) if len(step) else 0.0
        if change > MOVING * noise > 0.0:
            gap = next(i.gap for i in setup.model.inputs if i.name == name)
            yield (
                f"{name}: changes by {change / noise:.1f} times its noise from sample to sample, "
                f"but is held in between, as its gap of {gap:g} s is longer than [modes] gap "
                f"({setup.thresholds.gap:g} s): it acts {timings[name].period / 2.0:.2g} s late; "
                "a longer [modes] gap has it interpolated"
            )


def _cleaned_times(
    name: str, signal: Signal, setup: DriveSetup, timing: SampleTiming
) -> Iterator[tuple[Floats, int]]:
    """Times at which the samples that :meth:`DriveSetup.cleaned` keeps were true, a portion at a
    time, and how many it removes."""
    tail = signal.take(slice(0))  # the last three samples, of which the last is not judged yet
    for rows in memory_mapped.portions(len(signal)):
        piece = tail.then(signal.take(rows).only_valid())
        cleaned, outliers = setup.cleaned(name, piece, timing)
        first, tail = max(len(tail) - 1, 0), piece.take(slice(-3, None))
        stop = len(cleaned) if rows.stop == len(signal) else len(cleaned) - 1
        yield cleaned.time[first:stop], outliers
        memory_mapped.release_memory()


def _noise_table(vehicle: Vehicle, model: Model, flags: Floats) -> Floats:
    """Process noise, variance per s, of every state in every regime; shape (rows of flags, 2n)."""
    Q = np.tile(process_noise(vehicle, model), (len(flags), 1))
    renewed = ((name, {flag: noise}) for name, (flag, noise) in model.renewed.items())
    for name, noises in (*renewed, *model.tracked.items()):
        for flag, noise in noises.items():
            Q[flags[:, model.regime.index(flag)] == 0, model.state(name)] = noise**2
    return Q
