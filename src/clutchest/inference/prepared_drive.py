"""One drive, with everything that is computed once before it is linearised anywhere.

Everything unknown is a number θ: the parameters that the vehicle file gives a spread, the gains of
effects, and what each state starts from.  States that the model renews at every slip (the engine
speed) are tracked by the filter; all others follow from θ alone, without process noise and without
being corrected.  The innovations are then a smooth function of θ, which Gauss–Newton steps follow
as far as they like, and no adapting state swallows what a cause leaves in the data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.records import Belief, Varying
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Compiled
from clutchest.inference.input_interpolation import InterpolatedInput
from clutchest.inference.last_runs import LastPaths, LastRuns
from clutchest.inference.noise_model import SENSOR, Stretches
from clutchest.inference.operating_point import OperatingPoint
from clutchest.signals import Floats

BENT = SENSOR // 4  # groups of readings at and after bends are numbered from a regime's on
Samples = tuple[Floats, Floats]  # times s, and values there


@dataclass(frozen=True, slots=True)
class PreparedInputs:
    """The inputs of a drive between its events (K).

    ``interpolated`` each input; ``spacing`` (K) s², see
    :func:`~clutchest.inference.input_interpolation.spacing`; ``smooth`` (K, nu) values; by index of
    an input, where it may be late or moves a step map: ``denoised`` values; where it moves one,
    ``dragged`` ones, which a play that an effect gives follows, and ``deadband`` filtered ones,
    which step maps see without one.  ``limit`` (nu): how far an input may lie from its
    reading; ``slow`` (nu): whether it is sampled too seldom for the measured rates to tell where in
    its noise it lies, so that its mean stands for it.
    """

    interpolated: Sequence[InterpolatedInput]
    spacing: Floats
    smooth: Floats
    denoised: Mapping[int, Samples]
    dragged: Mapping[int, Samples]
    deadband: Mapping[int, Samples]
    limit: Floats
    slow: NDArray[np.bool_]

    def first(self, count: int) -> PreparedInputs:
        """Those of so many events."""
        return replace(self, spacing=self.spacing[:count], smooth=self.smooth[:count])


@dataclass(frozen=True, slots=True)
class TrackedStates:
    """States that readings renew: ``which`` (n) they are, where their equations ``act`` (K), their
    measured ``rate`` (K, c) and their ``value`` (K, c) without the noise of their readings;
    ``corrected`` (K, c): where readings correct them; ``settling``: indices of those that an input
    settles at once."""

    which: NDArray[np.bool_]
    act: NDArray[np.bool_]
    rate: Floats
    value: Floats
    corrected: NDArray[np.bool_]
    settling: NDArray[np.int64]

    def first(self, count: int) -> TrackedStates:
        """Those of so many events."""
        return replace(
            self,
            act=self.act[:count],
            rate=self.rate[:count],
            value=self.value[:count],
            corrected=self.corrected[:count],
        )


@dataclass(frozen=True, slots=True)
class FrozenGains:
    """The filter's ``gain`` (K, c) for the tracked states and its predicted ``variance`` (K) at the
    vehicle file's numbers: innovations are a smooth function of θ while these stay."""

    gain: Floats
    variance: Floats


@dataclass(frozen=True, slots=True)
class Readings:
    """The readings (K) of a drive that respond to any θ, sensor after sensor, each in order of
    time.

    ``event`` the index of each among the drive's events, ``t`` s, ``sensor`` index, ``row`` the
    regime's, ``mode``, and ``std`` of the innovation; ``bent``: 1 where an input has just turned so
    sharply that how it went between two samples matters, 2 where it turns, 0 elsewhere;
    ``input_noise`` (K, c): directions in which noise of the inputs makes innovations scatter, by
    way of states that no reading corrects, in the innovations' ``std``.
    """

    event: NDArray[np.int64]
    t: Floats
    sensor: NDArray
    row: NDArray
    mode: NDArray
    std: Floats
    bent: NDArray[np.int64]
    input_noise: Floats

    @classmethod
    def of(
        cls, line: Timeline, event: NDArray[np.int64], std: Floats, bent: NDArray[np.int64]
    ) -> Readings:
        """Of these events of a timeline, without input noise; ``std`` and ``bent`` of every
        event."""
        nothing = np.zeros((len(event), 0))
        at = line.t[event], line.sensor[event], line.row[event], line.mode[event]
        return cls(event, *at, std[event], bent[event], nothing)

    def only(self, keep: NDArray[np.bool_]) -> Readings:
        """Those of these readings (K) that are kept."""
        return Readings(
            self.event[keep],
            self.t[keep],
            self.sensor[keep],
            self.row[keep],
            self.mode[keep],
            self.std[keep],
            self.bent[keep],
            self.input_noise[keep],
        )

    @property
    def stretches(self) -> Stretches:
        """How they follow each other without gaps, those at a bend and those after it by
        themselves: the noise of how inputs went between samples is theirs."""
        return Stretches.of(self.t, self.sensor, self.row + BENT * self.bent)


@dataclass(frozen=True, slots=True)
class DelayedSignal:
    """A ``signal`` is late by so many s times ``size``, 1 or one per event, the most of which is
    its ``reach``; the number stands in ``row`` of the effects' and is the compiled model's
    ``theta``."""

    signal: str
    row: int
    theta: int
    size: float | Floats
    reach: float


@dataclass(frozen=True, slots=True)
class LaterGain:
    """A gain, ``row`` of the effects' numbers and the compiled model's ``theta``, that acts by a
    share ``acts`` (events): 0 before it begins."""

    row: int
    theta: int
    acts: Floats


def constant(events: int) -> Varying:
    """Numbers none of which varies, for so many events."""
    return Varying(np.zeros(0, np.int64), np.zeros((events, 0)))


@dataclass(frozen=True, slots=True)
class UnaveragedReadings:
    """Every reading (k) of a sensor of which decimation keeps averages: ``t`` s, ``z`` and its
    ``std``."""

    t: Floats
    z: Floats
    std: Floats


@dataclass(frozen=True, slots=True)
class PreparedDrive:
    """Events of one drive on a ``line``, and all that linearisations of it share.

    ``unaveraged``: index of a sensor of which the line has averages → all its readings;
    ``nominal`` (n) first states, ``start`` what the filter knows of the tracked ones then;
    ``plays``: numbers of effects that give an input a play; ``at_nominal``: the operating point at
    the vehicle file's numbers, from which linearisations at any others begin; ``varying``: numbers
    of effects that are others at every event; ``later``: gains that begin within the drive;
    ``runs`` and ``paths``: the last ones of this drive.
    """

    compiled: Compiled
    line: Timeline
    unaveraged: Mapping[int, UnaveragedReadings]
    nominal: Floats
    start: Belief
    delayed: Sequence[DelayedSignal]
    plays: Sequence[int]
    inputs: PreparedInputs
    tracked: TrackedStates
    gains: FrozenGains
    readings: Readings
    at_nominal: OperatingPoint
    varying: Varying
    later: Sequence[LaterGain] = ()
    runs: LastRuns = field(default_factory=LastRuns, init=False, repr=False, compare=False)
    paths: LastPaths = field(default_factory=LastPaths, init=False, repr=False, compare=False)

    @property
    def at_once(self) -> NDArray[np.int64]:
        """Of every regime (r), how many steps of the states derivatives take in one."""
        model = self.compiled.model
        return model.by_pace(model.at_once, self.line.W).astype(np.int64)

    def until(self, end: float) -> PreparedDrive:
        """The same drive as far as ``end`` s."""
        count = max(int(np.searchsorted(self.line.t, end, "right")), 1)
        return replace(
            self.only(self.readings.event < count),
            line=self.line.first(count),
            delayed=[replace(d, size=_first(d.size, count)) for d in self.delayed],
            inputs=self.inputs.first(count),
            tracked=self.tracked.first(count),
            gains=FrozenGains(self.gains.gain[:count], self.gains.variance[:count]),
            at_nominal=self.at_nominal.first(count),
            varying=self.varying._replace(value=self.varying.value[:count]),
            later=[replace(each, acts=each.acts[:count]) for each in self.later],
        )

    def with_later_gains(self, effects: Floats) -> PreparedDrive:
        """The same drive whose :attr:`later` gains vary along it, those of these numbers of
        ``effects`` (ng)."""
        if not self.later:
            return self
        which = np.array([*self.varying.which, *(each.row for each in self.later)], np.int64)
        values = [self.varying.value, *(effects[e.row] * e.acts for e in self.later)]
        return replace(self, varying=Varying(which, np.column_stack(values)))

    def only(self, keep: NDArray[np.bool_]) -> PreparedDrive:
        """The same drive of which these readings (K) alone count."""
        return replace(self, readings=self.readings.only(keep))


def _first(size: float | Floats, count: int) -> float | Floats:
    return size[:count] if isinstance(size, np.ndarray) else size
