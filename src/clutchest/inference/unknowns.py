"""Drives of one vehicle and all that is unknown about them, as numbers θ with priors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.lower import NOISE, START
from clutchest.estimate.initial_state import prior_std
from clutchest.estimate.whole_log import compile_model, present_effects
from clutchest.inference.input_noise_covariance import taken_in
from clutchest.inference.linearisation import LinearisedDrive
from clutchest.models.effects import Effect
from clutchest.models.model import Model
from clutchest.progress import Progress
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

TIMING = 0.002  # s, standard deviation of a signal's delay beyond what the vehicle file states
# s, standard deviation by which the delay of a signal in white noise comes out wrong beside what
# that noise makes of it: measured on 140 simulated drives; samples come 20 times as far apart.
CLOCK = 0.0005

Shapes = Mapping[tuple[str, str], float]  # (effect, key of a shape) → value


@dataclass(frozen=True, slots=True)
class Unknown:
    """One unknown number: ``owner`` is ``parameter``, ``start`` or an effect's name.

    ``unit`` is what 1 means: the prior's standard deviation of a nuisance, the largest plausible
    size of a gain (``gain`` True).  ``drive``: whose start it is, −1 for a number of all drives.
    ``healthy``: standard deviation of a gain, in its unit, from one healthy vehicle to the next.
    A delay is both: ``timing`` is the small one that any signal may have.  ``exact``: stated by the
    vehicle file without a spread, and no unknown.
    """

    owner: str
    key: str
    unit: float
    gain: bool = False
    drive: int = -1
    healthy: float = 0.0
    exact: bool = False


@dataclass(frozen=True, slots=True)
class Rows:
    """The readings of one drive that tell of any θ, sensor after sensor, each in order of time.

    ``table`` (K, 1 + a): ``r`` (K) innovations over their predicted standard deviation, and their
    derivatives by the ``active`` (a) ones of ``count`` thetas, all unless given, each in its unit.
    """

    table: Floats
    count: int
    active: NDArray[np.int64] | None = None

    @property
    def r(self) -> Floats:
        """Shape (K,)."""
        return self.table[:, 0]

    @property
    def psi(self) -> Floats:
        """Derivatives by every θ, shape (K, count): 0 by those that are not active."""
        return self.spread(self.table[:, 1:])

    def spread(self, columns: Floats) -> Floats:
        """``columns`` (K, a) of active thetas at their places among all of them, (K, count)."""
        if self.active is None:
            return columns
        every = np.zeros((len(columns), self.count))
        every[:, self.active] = columns
        return every


class Problem:
    """Drives of one vehicle and every number that is unknown about them.

    ``thetas`` (m) in the order of all vectors θ here, each in its own unit and 0 where the vehicle
    file has it.  ``nuisances`` are indices of those with a prior, of variance 1; ``gains`` of the
    rest, the gains of ``effects``, which are absent at 0.  ``usable``: the signals of which every
    drive has readings.
    """

    def __init__(
        self,
        signals: Signals,
        vehicle: Vehicle,
        effects: Sequence[Effect],
        progress: Progress | None = None,
    ) -> None:
        drives = signals.drives
        self.usable = frozenset.intersection(*(drive.available for drive in drives))
        model = vehicle.machine.equations(self.usable)
        # readings count in full: Gauss–Newton steps take care of what a first order lacks
        model = replace(model, sensors=tuple(replace(s, repeats=0.0) for s in model.sensors))
        present = model.taking(present_effects(vehicle))
        sought = tuple(e for e in model.taking(effects) if e not in present)
        self.vehicle, self.effects = vehicle, {e.name: e for e in sought}
        self.compiled = compile_model(
            vehicle,
            model,
            present + sought,
            healthy_stds(vehicle, model),
            taken_in(model),
            progress,
        )
        shared, own = [], []
        for (owner, key), spread in zip(self.compiled.thetas, self.compiled.spread, strict=True):
            if owner in self.effects:
                gain = next(n for n in self.effects[owner].gains if n.key == key)
                shared.append(
                    Unknown(owner, key, gain.upper, gain=True, healthy=gain.healthy / gain.upper)
                )
            elif owner == START:
                own.append(Unknown(owner, key, spread))
            elif owner != NOISE:
                shared.append(Unknown(owner, key, spread or 1.0, exact=spread == 0.0))
        self.shared = len(shared)
        starts = [replace(t, drive=i) for i in range(len(drives)) for t in own]
        # a delay too small to be a finding answers as the delay that effects know
        first_of = {
            signal: k
            for k, t in reversed(list(enumerate(shared)))
            if t.gain
            for signal, key in self.effects[t.owner].delays.items()
            if key == t.key
        }
        self.timing = {k: signal for signal, k in first_of.items()}
        late = [Unknown("timing", signal, TIMING) for signal in self.timing.values()]
        self.thetas = tuple(shared + starts + late)
        self.units = np.array([t.unit for t in self.thetas])
        first = np.array([t.unit for t in shared + own])
        self.drives = [LinearisedDrive(drive, vehicle, self.compiled, first) for drive in drives]
        self.gains = np.flatnonzero([t.gain for t in self.thetas])
        self.nuisances = np.flatnonzero([not t.gain and not t.exact for t in self.thetas])

    def index(self, effect: str, key: str) -> int:
        """Where a gain stands in θ."""
        wanted = (effect, key)
        return next(i for i, t in enumerate(self.thetas) if (t.owner, t.key) == wanted)

    def clock(self, gain: int) -> float:
        """Standard deviation, s, to which a delay is told at best; 0 for any other gain."""
        if gain not in self.timing:
            return 0.0
        stated = self.vehicle.signals.get(self.timing[gain])
        ar = stated.noise_ar if stated else 0.0  # slow noise: as many readings are worth fewer
        return float(CLOCK * np.sqrt((1.0 + ar) / (1.0 - ar)))

    def tolerances(self, gains: Iterable[int]) -> NDArray[np.int64]:
        """Indices of the small delays that the signals delayed by these ``gains`` may have too."""
        first, wanted = len(self.thetas) - len(self.timing), set(gains)
        return np.array([first + i for i, k in enumerate(self.timing) if k in wanted], np.int64)

    def blocks(self, seconds: float) -> NDArray[np.int64]:
        """The number, from 0, of the block of so many ``seconds`` of a drive in which each reading
        (K) lies; drives share none."""
        places = [
            (np.full(len(d.t), i), np.floor(d.t / seconds)) for i, d in enumerate(self.drives)
        ]
        pairs = np.concatenate([np.column_stack(place) for place in places])
        return np.asarray(np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1))

    def numbers(self, theta: Floats, shapes: Shapes) -> tuple[Floats, Floats, dict[str, float]]:
        """Parameters and numbers of effects at ``theta`` (m), and by how much signals are late
        besides what effects make them."""
        c = self.compiled
        p, g, late = c.p.copy(), c.g.copy(), dict[str, float]()
        keys = [q.key for q in c.model.parameters]
        numbers = [(effect.name, key) for effect, key in c.model.numbers]
        for t, value in zip(self.thetas[: self.shared], theta * self.units, strict=False):
            if t.owner == "parameter":
                p[keys.index(t.key)] += value
                continue
            g[numbers.index((t.owner, t.key))] += value
        for k, t in enumerate(self.thetas):
            if t.owner == "timing":
                late[t.key] = theta[k] * t.unit
        for name, value in shapes.items():
            g[numbers.index(name)] = value
        return p, g, late

    def linearise(
        self, theta: Floats, shapes: Shapes, active: NDArray[np.int64] | None = None
    ) -> list[Rows]:
        """Every drive at ``theta`` (m); shapes of effects at their defaults unless given.

        Derivatives by the ``active`` ones only (indices; all unless given) are other than zero.
        """
        p, g, late = self.numbers(theta, shapes)
        wanted = np.ones(len(theta), bool) if active is None else np.zeros(len(theta), bool)
        wanted[slice(None) if active is None else active] = True
        late_rows = np.arange(len(self.thetas) - len(self.timing), len(self.thetas))
        wanted[list(self.timing)] |= wanted[late_rows]
        found, active = [], np.flatnonzero(wanted)
        place = np.cumsum(wanted) - 1  # of each active θ among them
        for i, drive in enumerate(self.drives):
            own = [k for k, t in enumerate(self.thetas) if t.drive == i]
            columns = np.array([*range(self.shared), *own])
            compiled_ones = np.flatnonzero(wanted[columns])
            columns = columns[compiled_ones]
            innovations, answers = drive.answer(p, g, self._first(i, theta), late, compiled_ones)
            with np.errstate(over="ignore"):  # a step tried too far, where the equations run away
                answers /= drive.std[:, None]
                answers *= self.units[columns]
            table = np.zeros((len(answers), 1 + len(active)))
            table[:, 0] = innovations / drive.std
            table[:, 1 + place[columns]] = answers
            for k, of in zip(late_rows, self.timing, strict=True):
                if wanted[k]:
                    per_delay = table[:, 1 + place[of]] / self.units[of]
                    table[:, 1 + place[k]] = per_delay * self.units[k]
            found.append(Rows(table, len(theta), None if wanted.all() else active))
        return found

    def modulated(
        self,
        theta: Floats,
        shapes: Shapes,
        thetas: NDArray[np.int64],
        bases: Sequence[Floats],
        columns: NDArray[np.int64],
    ) -> list[Floats]:
        """Derivatives (K, c) of every drive's innovations by shared ``thetas`` (c) of which each
        acts in proportion to one of the ``columns`` (c) of ``bases`` (events, b)."""
        p, g, late = self.numbers(theta, shapes)
        found = []
        for i, (drive, basis) in enumerate(zip(self.drives, bases, strict=True)):
            answers = drive.modulated(
                p, g, self._first(i, theta), late, thetas, np.ascontiguousarray(basis), columns
            )
            answers /= drive.std[:, None]
            answers *= self.units[thetas]
            found.append(answers)
        return found

    def _first(self, drive: int, theta: Floats) -> Floats:
        """First states (n) of one drive, before effects."""
        x = self.drives[drive].nominal.copy()
        for k, t in enumerate(self.thetas):
            if t.drive == drive:
                x[self.compiled.model.state(t.key)] += theta[k] * self.units[k]
        return x


def healthy_stds(vehicle: Vehicle, model: Model) -> dict[str, float]:
    """State → how far its first value may lie from nominal in a healthy vehicle, where it may."""
    stds = {}
    for state, std in zip(model.states, prior_std(vehicle, model), strict=True):
        if state.name in model.renewed or state.name in model.unobservable:
            continue
        if state.healthy_std is not None:
            std = min(std, state.healthy_std)
        if std > 0.0:
            stds[state.name] = float(std)
    return stds
