"""What a drive's timeline is made by: which signals the equations need, when each was true, and
whether those at hand will do."""

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
from clutchest.models.regimes import SLIDING
from clutchest.models.thresholds import Thresholds
from clutchest.signals import HEAD, LOST, Floats, Signal, Signals
from clutchest.vehicle import Vehicle

COARSEST = 0.5  # s between samples of the model's anchor; a slip lasts little longer


class Unusable(ClutchestError):
    """A drive without a signal that the model cannot do without."""


@dataclass(frozen=True)
class DriveSetup:
    """What a timeline is made by: outputs at ``rate`` Hz, ``delays`` s by signal on top of the
    vehicle file's."""

    vehicle: Vehicle
    model: Model
    rate: float
    delays: Mapping[str, float]

    @cached_property
    def thresholds(self) -> Thresholds:
        """When the clutch counts as what."""
        return Thresholds.of(self.vehicle.modes)

    @cached_property
    def tables(self) -> tuple[Floats, Floats, Floats]:
        """Flags, process noise and longest step of every regime, as :class:`Timeline` has them."""
        flags = np.array(list(product((0.0, 1.0), repeat=len(self.model.regime))))
        certain = np.zeros((len(flags), len(self.model.doubted)))
        return (
            np.hstack([flags, certain]),
            _noise_table(self.vehicle, self.model, flags),
            _longest(self.model, flags),
        )

    @cached_property
    def _slow(self) -> frozenset[str]:
        """Inputs that may be missing for long."""
        return frozenset(i.name for i in self.model.inputs if i.gap > self.thresholds.gap)

    @cached_property
    def _fast(self) -> tuple[tuple[str, str], ...]:
        """Inputs that may not, each with the signal that it is made of."""
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
        """By how much a signal's samples come after what they tell of, s."""
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
        without spikes; and how many spikes there were.

        An input that holds its last value keeps its spikes: nobody waits for the next sample,
        which alone could tell.
        """
        spikes = 0
        if not self.held(name):
            signal, spikes = without_spikes(signal, self.noise(name), timing)
        late = self.late(name)
        return (replace(signal, time=signal.time - late) if late else signal), spikes

    def held(self, name: str) -> bool:
        """Whether a signal is an input that changes slowly and holds its last value."""
        return name in self._slow and name not in self.needed((name,))

    def fast(self, names: Container[str]) -> list[str]:
        """The inputs among ``names`` that must not be missing for long."""
        return [name for name, source in self._fast if source in names]

    def needed(self, names: Container[str]) -> list[str]:
        """The signals among ``names`` that tell which equations hold, or drive them fast."""
        wanted = dict.fromkeys(
            (self.model.anchor, *self.fast(names), *self.vehicle.machine.regimes.signals)
        )
        return [name for name in wanted if name in names]


def held_on(signal: Signal, time: float) -> Signal:
    """The signal, with its last value once more at ``time`` s if by then it has been silent for so
    long that it counts as lost: what never comes back is away from its last sample on."""
    if time - signal.time[-1] <= LOST:
        return signal
    return replace(
        signal,
        time=np.append(signal.time, time),
        value=np.append(signal.value, signal.value[-1]),
        why=np.append(signal.why, signal.why[-1]),
    )


def usable(
    signals: Signals, setting: DriveSetup
) -> tuple[dict[str, Signal], dict[str, SampleTiming]]:
    """The cleaned signals, those that are needed held on to the log's end, and their habits.

    Raises as :func:`timings_of` does.
    """
    timings, present = timings_of(signals, setting), {}
    for name, timing in timings.items():
        present[name], _ = setting.cleaned(name, signals[name].only_valid(), timing)
    for name in setting.needed(present):
        present[name] = held_on(present[name], signals.end - setting.late(name))
    return present, timings


def timings_of(signals: Signals, setting: DriveSetup) -> dict[str, SampleTiming]:
    """How each signal with a valid sample comes.

    Raises Unusable where the model cannot do without one of the others, ClutchestError where its
    anchor comes too seldom.
    """
    model, timings = setting.model, {}
    for name, signal in signals.items():
        if len(first := _head(signal)):
            timings[name] = SampleTiming.of(first)
    needed = {i.name for i in model.inputs if i.default is None} - set(model.slopes)
    missing = sorted((needed | {model.anchor}) - set(timings))
    if missing:
        hints = "".join(f"; {warning}" for warning in signals.warnings[:4])
        raise Unusable(
            f"no valid sample of {', '.join(missing)}: the model of '{setting.vehicle.name}' "
            f"needs it{hints}"
        )
    anchor, period = signals[model.anchor], timings[model.anchor].period
    if period > COARSEST and np.count_nonzero(anchor.valid) > 1:
        raise ClutchestError(
            f"{model.anchor} has a sample every {period:g} s, expected at least one every "
            f"{COARSEST:g} s; are the times in seconds?"
        )
    return timings


def _head(signal: Signal) -> Signal:
    """The valid samples by which it is known how a signal comes."""
    valid = signal.valid
    if not valid.any():
        return signal.take(slice(0))
    first = int(np.argmax(valid))
    last = int(np.searchsorted(signal.time, signal.time[first] + HEAD, side="right"))
    return signal.take(slice(first, last)).only_valid()


def warnings_of(signals: Signals, setting: DriveSetup) -> tuple[str, ...]:
    """Spikes and gaps of a drive, in words.  Raises as :func:`timings_of` does."""
    timings = timings_of(signals, setting)
    gap = setting.thresholds.gap
    steady = [name for name in setting.fast(timings) if name not in setting.model.slopes]
    needed, told, gaps = setting.needed(timings), [], {}
    for name, timing in timings.items():
        spikes = count = 0
        holes, last = [], np.nan
        for time, left_out in _cleaned_times(name, signals[name], setting, timing):
            steps = np.diff(time, prepend=last)
            holes += steps[steps > gap].tolist()
            last = float(time[-1]) if len(time) else last
            spikes, count = spikes + left_out, count + len(time) + left_out
        end = signals.end - setting.late(name)
        if name in needed and end - last > max(LOST, gap):  # as held_on has it
            holes.append(end - last)
        if spikes:
            told.append(
                f"{name}: {spikes} single sample(s) far off both neighbours left "
                f"out, {100 * spikes / count:.2g} %"
            )
        if holes:
            gaps[name] = (
                f"{name}: {len(holes)} gap(s), the longest {max(holes):.1f} s; "
                "heat of a slip in a gap is not seen"
            )
    return (*told, *(gaps[name] for name in steady if name in gaps))


def _cleaned_times(
    name: str, signal: Signal, setting: DriveSetup, timing: SampleTiming
) -> Iterator[tuple[Floats, int]]:
    """When the samples that :meth:`DriveSetup.cleaned` leaves were true, a portion at a time, and
    how many it leaves out."""
    tail = signal.take(slice(0))  # the last two samples, of which the last one is not judged yet
    for rows in memory_mapped.portions(len(signal)):
        piece = tail.then(signal.take(rows).only_valid())
        cleaned, spikes = setting.cleaned(name, piece, timing)
        first, tail = max(len(tail) - 1, 0), piece.take(slice(-2, None))
        stop = len(cleaned) if rows.stop == len(signal) else len(cleaned) - 1
        yield cleaned.time[first:stop], spikes
        memory_mapped.release_memory()


def process_noise(vehicle: Vehicle, model: Model, parked: bool = False) -> Floats:
    """Variance per s, then per J of slip energy, of every state, shape (2n,), by vehicle file or
    model."""
    per_second, per_joule = [], []
    for state in model.states:
        setting = vehicle.estimation.get(state.name, state)  # the model's own unless the file's
        adaptive = setting.role == "adaptive"
        density = state.parked_noise if parked else setting.process_noise
        per_second.append(density**2 if adaptive else 0.0)
        per_joule.append(state.slip_noise**2 if adaptive else 0.0)
    return np.array(per_second + per_joule)


def _noise_table(vehicle: Vehicle, model: Model, flags: Floats) -> Floats:
    """Process noise, variance per s, of every state in every regime; shape (rows of flags, 2n)."""
    Q = np.tile(process_noise(vehicle, model), (len(flags), 1))
    for name, (flag, walk) in model.renewed.items():
        Q[flags[:, model.regime.index(flag)] == 0, model.state(name)] = walk**2
    return Q


def _longest(model: Model, table: Floats) -> Floats:
    """The longest step, s, under every row of flags."""
    slides = table[:, model.regime.index(SLIDING)] > 0 if SLIDING in model.regime else [True]
    return np.where(slides, *model.longest)
