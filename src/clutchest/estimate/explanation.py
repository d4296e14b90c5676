"""What explains that signals and model contradict each other: one sign, one swap, one unit.

Each explanation is tried: the signals are mended by it and filtered anew.  One that fits leaves
every innovation within what the model predicts, and nothing that is impossible; of several the
most probable is named, with those that are as probable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from math import log, pi

import numpy as np

from clutchest import units
from clutchest.errors import ClutchestError
from clutchest.estimate.consistency import Consistency
from clutchest.estimate.contradiction import MISFIT, Contradiction
from clutchest.estimate.delay_equalisation import evenly_late
from clutchest.estimate.impossible import impossible
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.run import Track
from clutchest.estimate.timeline import build
from clutchest.estimate.track import track_of
from clutchest.estimate.whole_log import (
    CONSIDERING,
    PLAIN,
    FilterOptions,
    compile_model,
    delays,
    run,
)
from clutchest.models.model import Model
from clutchest.progress import Progress
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

LONGEST_S = 300.0  # s of a drive that are filtered for each explanation
READINGS = 60_000  # or so many samples of its fastest signal
SHORTEST_S = 10.0  # s of a drive on which explanations are tried first, if it does not fit them
# by how much units of one quantity differ: of any, and of those with this canonical unit
FACTORS = {1000.0: "1000", 100.0: "100"}
OF_UNIT = {
    "rad": {180.0 / pi: "180/π", 2.0 * pi: "2π"},
    "rad/s": {60.0 / (2.0 * pi): "60/(2π)", 180.0 / pi: "180/π", 2.0 * pi: "2π"},
    "m/s": {3.6: "3.6"},
    "bar": {10.0: "10", 1e5: "10⁵"},
    "MPa": {10.0: "10", 1e6: "10⁶"},
    "Pa": {1e5: "10⁵", 1e6: "10⁶"},
}
CLIPPED = 5.0  # standard deviations; a larger innovation counts as these
FITS = (
    1.6  # root mean square of innovations over their standard deviation, of a model that is right
)
SUSPICIOUS = 2.5  # the same, from which explanations are sought
KEPT = 0.5  # of the readings of every sensor that an explanation has to keep
AS_PROBABLE = 2.0  # of log-likelihood, within which explanations cannot be told apart
MOST_NAMED = 3
LARGER = "innovations are far larger than the model predicts"
RATE = 1.0  # Hz


@dataclass(frozen=True, slots=True)
class MendedFit:
    """How well mended signals fit: the largest ``rms`` of a sensor, ``readings`` per sensor,
    ``log_likelihood`` of the signals as they were read."""

    rms: float
    readings: Mapping[str, int]
    log_likelihood: float
    contradicted: bool

    @property
    def right(self) -> bool:
        """Whether signals and model fit."""
        return self.rms <= FITS and not self.contradicted


@dataclass(frozen=True, slots=True)
class Remedy:
    """``signal`` in question, the ``kind`` and ``words`` of what is wrong with it, ``mended``
    signals, and by what each reading of a sensor was multiplied.  Those of a higher ``rank`` are
    only tried where none of a lower one fits."""

    signal: str
    kind: str
    words: str
    mended: Mapping[str, Signal]
    factor: float = 1.0
    rank: int = 0


def explained(
    found: Contradiction | None,
    track: Track,
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress | None = None,
) -> Contradiction | None:
    """The contradiction with its best explanation.

    One that was not ``found`` is, where innovations are larger than a right model's and a single
    sign, swap or unit makes them fit or a sensor is dead; and where all signals are zero.
    """
    model = vehicle.machine.equations(signals.available)
    if nothing := _nothing(signals, vehicle):
        return nothing
    if found is None and rms_of(track, model.predicted) < SUSPICIOUS:
        return None
    fitting, dead = _fitting(signals, vehicle, progress), _dead(signals, vehicle)
    if fitting:
        words = found.words if found else LARGER
        since = found.since_s if found else 0.0
        causes = ", or ".join(each.words for each in fitting)
        cure = f"{causes}: corrected in the log or the vehicle file, all signals would fit"
        first, *others = dict.fromkeys(each.signal for each in fitting)
        return Contradiction(words, first, since, cure, fitting[0].kind, tuple(others))
    if found is None:
        read = {s.name: s.column or s.name for s in model.sensors}
        wrong = {read[name] for name in read if rms_of(track, frozenset({name})) >= SUSPICIOUS}
        dead = [n for n in dead if n in wrong or _may_be_wrong(signals[n], n in read.values())]
        if not dead:
            return None
        found = Contradiction(LARGER, dead[0], 0.0)
    if dead:
        what = (
            f"{dead[0]} does not change at all"
            if len(dead) == 1
            else (f"{', '.join(dead)} do not change at all")
        )
        return replace(found, signal=dead[0], explanation=f"{what}: a dead sensor", kind="dead")
    words = "no single sign, swap or unit explains it: another vehicle or bench, or several faults"
    if found.kind == MISFIT:
        words += ", or a large one, which `clutchest diagnose` tests for"
    return replace(found, explanation=words)


def rms_of(track: Track, names: frozenset[str] | None = None) -> float:
    """The largest of the sensors' innovations over their standard deviation, root mean square; of
    all sensors, or of those with these ``names``."""
    events, largest = track.innovations, 0.0
    for name in events.names if names is None else names & set(events.names):
        _, innovation, std = events.of(name)
        if len(std):
            z = np.minimum(np.abs(innovation / np.maximum(std, 1e-300)), CLIPPED)
            largest = max(largest, float(np.sqrt(np.mean(z**2))))
    return largest


def _fitting(signals: Signals, vehicle: Vehicle, progress: Progress | None) -> list[Remedy]:
    """The most probable of the explanations that fit, and those that are as probable; none where
    the signals fit as they were read, as they may where the state of an earlier drive does not."""
    begin = _begin(signals)
    as_read = _fit(begin, vehicle, 1.0, "")
    # a filter that takes the parameters for true lets friction and wear follow an error of them
    following = _fit(begin, vehicle, 1.0, "", PLAIN)
    if as_read is None or following is None or as_read.right or following.right:
        return []
    shortest = _shortest_misfit(begin, vehicle)
    tried = list(remedies(begin, vehicle))
    for rank in sorted({each.rank for each in tried}):
        group, fitting = [each for each in tried if each.rank == rank], []
        for number, remedy in enumerate(group):
            if progress:
                progress("trying explanations", number / len(group))
            mended = replace(begin, signals={**begin.signals, **remedy.mended})
            fit = _fit(mended.between(end=shortest), vehicle, remedy.factor, remedy.signal)
            if shortest < begin.end and fit is not None and fit.right:
                fit = _fit(mended, vehicle, remedy.factor, remedy.signal)
            if fit is not None and _explains(fit, as_read) and not impossible(mended, vehicle):
                fitting.append((fit.log_likelihood, remedy))
        if fitting:
            return _most_probable(fitting, vehicle.machine.equations(begin.available))
    return []


def _most_probable(fitting: list[tuple[float, Remedy]], model: Model) -> list[Remedy]:
    """The most probable explanations of those that fit, by their log-likelihoods.

    These are of the same readings, except where a swap makes other readings those of a sensor:
    such an explanation is compared with those that make the same ones.
    """
    read = {sensor.column or sensor.name for sensor in model.sensors}
    best: dict[frozenset[str], float] = {}
    named = []
    for likelihood, remedy in sorted(fitting, key=lambda each: each[0], reverse=True):
        others = frozenset(remedy.mended) if remedy.kind == "swap" else frozenset()
        group = others if others & read else frozenset()
        if likelihood >= best.setdefault(group, likelihood) - AS_PROBABLE:
            named.append(remedy)
    return named[:MOST_NAMED]


def _explains(fit: MendedFit, as_read: MendedFit) -> bool:
    """Whether mended signals fit, without hiding readings from any sensor."""
    kept = all(fit.readings[name] >= KEPT * n for name, n in as_read.readings.items())
    better = fit.log_likelihood > as_read.log_likelihood
    return kept and better and fit.right


def _begin(signals: Signals) -> Signals:
    """The drive's first part."""
    end = LONGEST_S
    for signal in signals.signals.values():
        if len(signal) > READINGS:
            end = min(end, float(signal.time[READINGS]))
    return signals.between(end=end)


def _shortest_misfit(signals: Signals, vehicle: Vehicle) -> float:
    """How much of the drive's begin it takes, s, until signals and model do not fit; ∞: all."""
    end = SHORTEST_S
    while end < signals.end:
        fit = _fit(signals.between(end=end), vehicle, 1.0, "")
        if fit is not None and not fit.right:
            return end
        end *= 2.0
    return np.inf


def remedies(signals: Signals, vehicle: Vehicle) -> Iterator[Remedy]:
    """Signs, swaps and units, of every signal that the equations use."""
    model = vehicle.machine.equations(signals.available)
    used = {i.name for i in model.inputs} | {s.column or s.name for s in model.sensors}
    used |= set(vehicle.machine.regimes.signals)
    changing = [n for n in signals.available if np.ptp(signals[n].only_valid().value) > 0.0]
    names = [n for n in vehicle.machine.units if n in used and n in changing]
    read = {s.column or s.name for s in model.sensors}
    unused = sorted(set(changing) - set(names))
    for a, b in chain(combinations(names, 2), product(names, unused)):
        if _is_temperature(signals[a]) != _is_temperature(signals[b]):
            continue
        mended = {a: _values_of(signals[b], signals[a]), b: _values_of(signals[a], signals[b])}
        if all(_possible(each, vehicle) for each in mended.values()):
            rank = 2 if b in unused else 0
            yield Remedy(a, "swap", f"{a} and {b} are swapped", mended, rank=rank)
    for name in names:
        if _is_temperature(signals[name]):
            continue
        yield Remedy(name, "sign", f"the sign of {name} is wrong", _times(signals[name], -1.0))
        factors = FACTORS | OF_UNIT.get(vehicle.machine.units[name], {})
        for factor, words in factors.items():
            for times, what in ((1.0 / factor, "large"), (factor, "small")):
                yield Remedy(
                    name,
                    "unit",
                    f"{name} is {words} times too {what}, as of a wrong unit",
                    _times(signals[name], times),
                    times if name in read else 1.0,
                    rank=1,
                )


def _values_of(other: Signal, signal: Signal) -> Signal:
    """``signal`` with what was read as the ``other``."""
    return replace(other, name=signal.name, unit=signal.unit)


def _possible(signal: Signal, vehicle: Vehicle) -> bool:
    """Whether its readings are such as the machine has, most of them within the bus's range."""
    if np.mean(signal.valid) < KEPT:
        return False
    column, size = vehicle.machine.column(signal.name), np.abs(signal.only_valid().value)
    if column is None or not len(size):
        return True
    if column.possible is not None:
        low, high, _ = column.possible
        return bool(low <= np.median(signal.only_valid().value) <= high)
    if column.magnitude is None:
        return True
    of = vehicle.parameters.get(column.magnitude.of)
    least, most = column.magnitude.largest
    return bool(least <= np.percentile(size, 99.0) / (of.value if of else 1.0) <= most)


def _times(signal: Signal, factor: float) -> dict[str, Signal]:
    return {signal.name: replace(signal, value=signal.value * factor)}


def _fit(
    signals: Signals,
    vehicle: Vehicle,
    factor: float,
    signal: str,
    options: FilterOptions = CONSIDERING,
) -> MendedFit | None:
    """How well these signals fit; None where they cannot be filtered."""
    try:
        compiled = compile_model(vehicle, vehicle.machine.equations(signals.available))
        timeline = build(
            evenly_late(signals, vehicle), vehicle, compiled.model, RATE, delays(vehicle)
        )
        filtered = run(compiled, timeline, fresh(vehicle, compiled, timeline), options)
        track = track_of(vehicle, compiled, timeline, filtered)
    except (ClutchestError, FloatingPointError, np.linalg.LinAlgError):
        return None
    if not np.isfinite(filtered.log_likelihood):
        return None
    judge = Consistency.of(compiled.model, vehicle)
    judge.take(track, last=True)
    events = track.innovations
    counts = np.bincount(events.sensor, minlength=len(events.names))
    readings = {name: int(n) for name, n in zip(events.names, counts, strict=True)}
    of = sum(readings[s.name] for s in compiled.model.sensors if (s.column or s.name) == signal)
    return MendedFit(
        rms_of(track),
        readings,
        filtered.log_likelihood + of * log(abs(factor)),  # density of what was read
        judge.found is not None,
    )


def _dead(signals: Signals, vehicle: Vehicle) -> list[str]:
    """Signals that have one value over the whole drive, where the machine's own never do."""
    model = vehicle.machine.equations(signals.available)
    used = {s.column or s.name for s in model.sensors} | {
        i.name for i in model.inputs if i.default is None
    }
    return [
        name
        for name in vehicle.machine.units
        if name in used
        and name in signals.available
        and _constant(signals[name].only_valid().value)
    ]


def _nothing(signals: Signals, vehicle: Vehicle) -> Contradiction | None:
    """That none of the machine's signals ever differs from zero, where there are several."""
    values = {n: signals[n].only_valid().value for n in vehicle.machine.units if n in signals}
    if len(values) < 2 or not all(_constant(v) and v[0] == 0.0 for v in values.values()):
        return None
    return Contradiction(
        "all signals are zero throughout",
        next(iter(values)),
        0.0,
        "nothing is measured: sensors without supply, or a logger that is not connected",
        "dead",
    )


def _may_be_wrong(dead: Signal, read: bool) -> bool:
    """Whether a signal of one value may be why the others do not fit: what is ``read`` and always
    0, and what drives the equations, unless it changes slowly."""
    return not dead.only_valid().value.any() if read else not _is_temperature(dead)


def _is_temperature(signal: Signal) -> bool:
    """Which may stay the same for long, and has no sign and no factor."""
    return units.compatible(signal.unit, "°C")


def _constant(value: Floats) -> bool:
    return len(value) > 10 and float(np.ptp(value)) == 0.0
