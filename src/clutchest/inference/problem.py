"""Drives of one vehicle and all that is unknown about them, as numbers θ with priors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.compute import build
from clutchest.estimate.whole_log import Compiled, compile_model, present_effects
from clutchest.inference.discrepancy import Discrepancy, directions_of
from clutchest.inference.healthy import healthy_parts, healthy_stds, unmodelled
from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.input_noise_covariance import taken_in
from clutchest.inference.linearisation import Derivatives, Modulation, linearise, modulated
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.preparation import (
    prepared,
    prepared_like,
    with_gains_at,
    with_input_noise_at,
)
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.smooth_errors import acting_by
from clutchest.inference.unknowns import (
    HealthyPart,
    InitialState,
    Shapes,
    SignalDelay,
    StatedGain,
    Unknown,
    UnknownGain,
    UnknownParameter,
    of_compiled,
)
from clutchest.models.effects import Effect
from clutchest.models.model import Model
from clutchest.native import compiled
from clutchest.progress import Progress
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import wander
from clutchest.vehicle.vehicle import TIMING

FURTHEST = 10.0  # standard deviations that are stated, by which a number may be off in discovery
INDEPENDENT = 1.0  # s; noise of one block of such a length says nothing of the next
STEPS = 2  # from nominal inputs to those that numbers imply
# s, standard deviation by which the delay of a signal in white noise comes out wrong beside what
# that noise makes of it: measured on 140 simulated drives; samples come 20 times as far apart.
CLOCK = 0.0005


@dataclass(frozen=True, slots=True)
class Problem:
    """Drives of one vehicle and every number that is unknown about them.

    ``thetas`` (m) in the order of all vectors θ here, each in its own unit and 0 where the vehicle
    file has it: first the ``shared`` ones of all drives.  ``nuisances`` are indices of those with a
    prior, of variance 1; ``gains`` of the rest, the gains of ``effects``, which are absent at 0.
    ``usable``: the signals of which every drive has readings; ``delayed``: indices of gains that
    are the delay of a signal; ``tolerated``: of the last thetas, each of which acts as a gain does
    and has a prior, the index of this gain; ``discrepancies``: what else the equations of a healthy
    machine are off by; ``near`` (m): θ of the gains by which states are tracked; ``begin`` (m):
    where the fit without a cause begins.
    """

    vehicle: Vehicle
    compiled: Compiled
    effects: Mapping[str, Effect]
    usable: frozenset[str]
    thetas: tuple[Unknown, ...]
    shared: int
    delayed: Mapping[int, str]
    tolerated: tuple[int, ...]
    drives: tuple[PreparedDrive, ...]
    nuisances: NDArray[np.int64]
    discrepancies: tuple[Discrepancy, ...]
    near: Floats
    begin: Floats

    @classmethod
    def of(
        cls,
        signals: Signals,
        vehicle: Vehicle,
        effects: Sequence[Effect],
        progress: Progress | None = None,
        *,
        discrepant: bool = False,
        input_noise: bool = True,
    ) -> Problem:
        """Of all drives of ``signals``, with candidate ``effects``; where ``discrepant``, what
        states, effects and equations of a healthy vehicle may be off by is allowed for, and no
        number is off by more than :data:`FURTHEST`.  Without ``input_noise``, what this does is
        not known yet."""
        drives, usable = signals.drives, signals.available_throughout
        model = _counting_in_full(vehicle.machine.to_fit(usable))
        present = model.taking(present_effects(vehicle))
        parts = unmodelled(vehicle) if discrepant else {}
        tried = model.taking((*effects, *parts.values()))
        sought = {e.name: e for e in tried if e not in present}
        wanders = wander(vehicle, model) if discrepant else ()
        compiled = compile_model(
            vehicle,
            model,
            (*present, *sought.values()),
            healthy_stds(vehicle, model),
            taken_in(model),
            tuple(each.state for each in wanders),
            progress,
            build.generate_for_fits,
        )
        known = tuple(of_compiled(compiled, sought))
        errors = acting_by(map(str, known), vehicle.smooth_errors) if discrepant else ()
        shared = _shared(known, FURTHEST if discrepant else np.inf)
        starts = [t for t in known if isinstance(t, InitialState)]
        delayed = _delayed(shared, sought)
        healthy = healthy_parts(vehicle, shared) if discrepant else []
        thetas = (
            *shared,
            *(replace(t, drive=i) for i in range(len(drives)) for t in starts),
            *(SignalDelay(name, _delay_spread(vehicle, name)) for name in delayed.values()),
            *(part for part, _ in healthy),
        )
        units, near = np.array([t.unit for t in (*shared, *starts)]), np.zeros(len(thetas))
        problem = cls(
            vehicle,
            compiled,
            {name: e for name, e in sought.items() if name not in parts},
            usable,
            thetas,
            len(shared),
            delayed,
            (*delayed, *(place for _, place in healthy)),
            tuple(prepared(drive, vehicle, compiled, units) for drive in drives),
            np.flatnonzero([_has_prior(t) for t in thetas]),
            (*wanders, *errors),
            near,
            near,
        )
        return problem.with_input_noise_at(near) if input_noise else problem

    def once_more(self, signals: Sequence[Signals]) -> Problem:
        """The same drives with these ``signals`` in place of their own, states tracked by the gains
        that the filter has there, and with all readings."""
        pairs = zip(self.drives, signals, strict=True)
        drives = tuple(prepared_like(drive, each, self.vehicle) for drive, each in pairs)
        return replace(self, drives=drives).with_gains_at(self.near)

    def with_gains_at(self, theta: Floats) -> Problem:
        """The same with states tracked by the gains that the filter has at ``theta`` (m); what
        noise of the inputs does to the readings stays as it was."""
        drives = tuple(
            with_gains_at(drive, self.numbers(theta, {}, i)) for i, drive in enumerate(self.drives)
        )
        return replace(self, drives=drives, near=theta)

    def with_input_noise_at(self, theta: Floats) -> Problem:
        """The same with what noise of the inputs does to the readings at ``theta`` (m)."""
        drives = tuple(
            with_input_noise_at(drive, self.numbers(theta, {}, i), self.vehicle)
            for i, drive in enumerate(self.drives)
        )
        return replace(self, drives=drives)

    def holding(self, *names: str) -> Problem:
        """The same with these unknowns, by name (``str`` of each), taken for exact."""
        held = [i for i, t in enumerate(self.thetas) if str(t) in names]
        return replace(self, nuisances=np.setdiff1d(self.nuisances, held))

    def only(self, sensor: str) -> Problem:
        """The same of which the readings of one sensor alone count."""
        which = self.compiled.model.sensor(sensor)
        return self.counting([drive.readings.sensor == which for drive in self.drives])

    def counting(self, rows: Sequence[NDArray[np.bool_]]) -> Problem:
        """The same of which these ``rows`` of each drive's readings (K) alone count."""
        drives = tuple(drive.only(keep) for drive, keep in zip(self.drives, rows, strict=True))
        return replace(self, drives=drives)

    def until(self, share: float) -> Problem:
        """The same of which every drive ends after that ``share`` of its time."""
        ends = [d.line.t[0] + share * (d.line.t[-1] - d.line.t[0]) for d in self.drives]
        drives = tuple(d.until(end) for d, end in zip(self.drives, ends, strict=True))
        return replace(self, drives=drives)

    @property
    def units(self) -> Floats:
        """What 1 means of each θ (m)."""
        return np.array([t.unit for t in self.thetas])

    @property
    def gains(self) -> NDArray[np.int64]:
        """Indices of the gains of candidate effects."""
        return np.flatnonzero([isinstance(t, UnknownGain) for t in self.thetas])

    @property
    def entries(self) -> int:
        """How many derivatives of readings, by unknowns and noise of inputs, are held at a time."""
        each = (drive.readings for drive in self.drives)
        return sum(len(r.t) * (len(self.thetas) + r.input_noise.shape[1]) for r in each)

    def index(self, name: str) -> int:
        """Where an unknown stands in θ, by its name: ``str`` of it."""
        return next(i for i, t in enumerate(self.thetas) if str(t) == name)

    def clock(self, gain: int) -> float:
        """Standard deviation, s, to which a delay is known at best; 0 for any other gain."""
        if gain not in self.delayed:
            return 0.0
        stated = self.vehicle.signals.get(self.delayed[gain])
        ar = stated.noise_ar if stated else 0.0  # slow noise: as many readings are worth fewer
        return float(CLOCK * np.sqrt((1.0 + ar) / (1.0 - ar)))

    def tolerances(self, gains: Iterable[int]) -> NDArray[np.int64]:
        """Indices of the thetas that act as these ``gains`` do, to a small extent."""
        first, wanted = len(self.thetas) - len(self.tolerated), set(gains)
        return np.array([first + i for i, k in enumerate(self.tolerated) if k in wanted], np.int64)

    def blocks(self, seconds: float) -> NDArray[np.int64]:
        """The number, from 0, of the block of so many ``seconds`` of a drive in which each reading
        (K) lies; drives share none."""
        blocks, count = list[NDArray[np.int64]](), 0
        for drive in self.drives:
            own, of = np.unique(np.floor(drive.readings.t / seconds), return_inverse=True)
            blocks.append(count + of)
            count += len(own)
        return np.concatenate(blocks)

    def numbers(self, theta: Floats, shapes: Shapes, drive: int = 0) -> ModelNumbers:
        """Those of the equations of one drive at ``theta`` (m)."""
        c = self.compiled
        p, g, x, late = c.p.copy(), c.g.copy(), self.drives[drive].nominal.copy(), {}
        keys = [q.key for q in c.model.parameters]
        rows = {(effect.name, key): i for i, (effect, key) in enumerate(c.model.numbers)}
        for t, value in zip(self.thetas, theta, strict=True):
            match t:
                case UnknownParameter(key):
                    p[keys.index(key)] += value * t.unit
                case UnknownGain(effect, key) | StatedGain(effect, key) | HealthyPart(effect, key):
                    g[rows[effect, key]] += value * t.unit
                case InitialState(state) if t.drive == drive:
                    x[c.model.state(state)] += value * t.unit
                case SignalDelay(signal):
                    late[signal] = value * t.unit
        for name, value in shapes.items():
            g[rows[name]] = value
        return ModelNumbers(p, g, x, late)

    def linearise(
        self,
        theta: Floats,
        shapes: Shapes,
        active: NDArray[np.int64] | None = None,
        at: Sequence[OperatingPoint] | None = None,
    ) -> tuple[NormalisedInnovations, ...]:
        """Every drive at ``theta`` (m); shapes of effects at their defaults unless given.

        Derivatives by the ``active`` ones only (indices; all unless given) are other than zero.
        They are taken at the inputs of these operating points, a drive each: those of the vehicle
        file's numbers unless given.
        """
        wanted = np.ones(len(theta), bool) if active is None else np.zeros(len(theta), bool)
        wanted[slice(None) if active is None else active] = True
        for k, of in enumerate(self.tolerated, len(theta) - len(self.tolerated)):
            wanted[of] |= wanted[k]
        points = [drive.at_nominal for drive in self.drives] if at is None else at
        return tuple(
            self._of_drive(i, self.numbers(theta, shapes, i), wanted, point)
            for i, point in enumerate(points)
        )

    def implied(self, theta: Floats, shapes: Shapes) -> tuple[OperatingPoint, ...]:
        """The operating point of every drive at ``theta`` (m).

        Two steps of Gauss and Newton from that of the vehicle file's numbers: after one, inputs
        are still off by what is not linear on the way, and derivatives by several unknowns, taken
        at such inputs and at later ones, would differ by more than what tells them apart.
        """
        none, at = np.zeros(0, np.int64), None
        for _ in range(STEPS):
            at = tuple(drive.implied for drive in self.linearise(theta, shapes, none, at))
        assert at is not None
        return at

    def _of_drive(
        self, drive: int, numbers: ModelNumbers, wanted: NDArray[np.bool_], at: OperatingPoint
    ) -> NormalisedInnovations:
        """One drive, with derivatives by the ``wanted`` thetas (m)."""
        known = self.drives[drive].runs.at(numbers, at, wanted)
        if known is None:
            known = self._run(drive, numbers, wanted, at)
            self.drives[drive].runs.keep(numbers, at, wanted, known)
        return known

    def _run(
        self, drive: int, numbers: ModelNumbers, wanted: NDArray[np.bool_], at: OperatingPoint
    ) -> NormalisedInnovations:
        prepared_drive, units = self.drives[drive], self.units
        std = prepared_drive.readings.std
        active = np.flatnonzero(wanted)
        place = np.cumsum(wanted) - 1  # of each active θ among them
        own = [
            k for k, t in enumerate(self.thetas) if isinstance(t, InitialState) and t.drive == drive
        ]
        columns = np.array([*range(self.shared), *own])
        compiled_ones = np.flatnonzero(wanted[columns])
        columns = columns[compiled_ones]
        scale, table = np.ones(1 + len(active)), np.zeros((len(std), 1 + len(active)))
        into = Derivatives(table, 1 + place[columns])
        table[:, 0], implied = linearise(prepared_drive, numbers, at, compiled_ones, into)
        scale[into.place] = units[columns]
        in_std(table, scale, std)
        for k, of in enumerate(self.tolerated, len(self.thetas) - len(self.tolerated)):
            if wanted[k]:
                by_unit = table[:, 1 + place[of]] / units[of]
                table[:, 1 + place[k]] = by_unit * units[k]
        return NormalisedInnovations(table, len(wanted), implied, None if wanted.all() else active)

    def modulated(
        self,
        theta: Floats,
        shapes: Shapes,
        at: Sequence[OperatingPoint],
        thetas: NDArray[np.int64],
        modulations: Iterable[Modulation],
    ) -> list[Floats]:
        """Derivatives (K, c) of every drive's innovations by shared ``thetas`` (c), each of which
        acts as the drive's one of the ``modulations`` says."""
        columns = []
        for i, (drive, point, how) in enumerate(zip(self.drives, at, modulations, strict=True)):
            derivatives = modulated(drive, self.numbers(theta, shapes, i), point, thetas, how)
            in_std(derivatives, self.units[thetas], drive.readings.std)
            columns.append(derivatives)
        return columns

    def discrepancy_directions(
        self, theta: Floats, shapes: Shapes, at: Sequence[OperatingPoint]
    ) -> list[list[Floats]]:
        """Directions (K, c) in which each discrepancy scatters each drive's readings."""
        return [
            directions_of(drive, self.numbers(theta, shapes, i), point, self.discrepancies)
            for i, (drive, point) in enumerate(zip(self.drives, at, strict=True))
        ]


@compiled
def in_std(table: Floats, unit: Floats, std: Floats) -> None:
    """Columns of a ``table`` (K, c), each in its ``unit`` (c), over standard deviations (K): in
    place.  Infinite after a step tried too far, where the equations run away."""
    for k in range(len(table)):
        for c in range(table.shape[1]):
            table[k, c] = table[k, c] / std[k] * unit[c]


def _counting_in_full(model: Model) -> Model:
    """The model with readings that count in full: Gauss–Newton steps take care of what a first
    order lacks."""
    return replace(model, sensors=tuple(replace(s, repeats=0.0) for s in model.sensors))


def _has_prior(unknown: Unknown) -> bool:
    return not (
        isinstance(unknown, UnknownGain) or (isinstance(unknown, StatedGain) and unknown.exact)
    )


def _shared(
    known: Sequence[Unknown], most: float
) -> list[UnknownParameter | StatedGain | UnknownGain]:
    """What drives have in common, parameters off by ``most`` standard deviations at most."""
    some = [t for t in known if isinstance(t, UnknownParameter | StatedGain | UnknownGain)]
    return [t.within(most) if isinstance(t, UnknownParameter) else t for t in some]


def _delayed(shared: Sequence[Unknown], effects: Mapping[str, Effect]) -> dict[int, str]:
    """Index of a gain → the signal whose delay it is, one gain a signal: a delay too small to be a
    cause acts as the delay that effects know."""
    first_of = {
        signal: k
        for k, t in reversed(list(enumerate(shared)))
        if isinstance(t, UnknownGain)
        for signal, key in effects[t.effect].delays.items()
        if key == t.key
    }
    return {k: signal for signal, k in first_of.items()}


def _delay_spread(vehicle: Vehicle, signal: str) -> float:
    """s, standard deviation of a signal's delay around what the vehicle file states."""
    stated = vehicle.signals.get(signal)
    return stated.delay_spread if stated else TIMING
