"""One generated drive as its readings tell of the clutch: what a truck of other numbers would have
done under the same signals, made white by the noise that the readings have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from blind.drives import NOISES, Drive
from blind.white import SensorNoise, SpeedFilter
from clutchest.generator.generate import SPACING
from clutchest.generator.replay import NONE, STEADY, Own, Recorded, Replayed, replay
from clutchest.generator.replay import slope as slope_of
from clutchest.models import machine_of
from clutchest.reading import load_database
from clutchest.signals import Floats
from clutchest.simulated import Effects

READ = ("engine_speed", "engine_torque", "slave_position")
LATE = ("engine_torque", "slave_position")
NUDGE = 1e-5  # standard deviations, for derivatives
BLOCK = 1.0  # s of readings that one mean stands for where only heat flows
SPELL = 30.0  # s of readings of a temperature whose noise acts as one
SHORTEST = 5  # readings of a stretch
TERMS = 32  # of a random walk: of its variance at a drive's end, 1/150 is left out
SMALL = 1e-3  # of such a term, for derivatives
PLACES = 64  # over the stroke, at which a smooth error is told
ABSENT = 1e-6  # of its largest variance: what it does not have

Vector = Floats  # (m,) in the order of ``Truck.nuisances``


@dataclass(frozen=True)
class Truck:
    """A truck's ``own`` numbers, and ``nuisances``: what a vehicle file leaves open, by name, with
    the standard deviations of its priors; ``wanders``: of its states that are random walks, the
    density in unit/√s; ``curve``: how far its torque curve is off, as a share of the torque, and
    over which length in mm that changes; ``healthy``: effects and their gains that are nuisances
    too, as far as they act in a healthy truck, by name; ``bounds``: their plausible sizes."""

    own: Own
    nuisances: Mapping[str, float]
    wanders: Mapping[str, float]
    healthy: Mapping[str, tuple[str, str]]
    bounds: Mapping[str, tuple[float, float]]
    curve: tuple[float, float] | None = None

    @classmethod
    def of(cls, drive: Drive, own: Own) -> Truck:
        """Of a drive's vehicle file; its states' priors are those of a drive's beginning."""
        vehicle = drive.vehicle
        spreads = {key: p.spread for key, p in vehicle.parameters.items() if p.spread > 0.0}
        starts = {}
        for state in machine_of(vehicle.model).states:
            if state.name in own.start:
                own_spread = spreads.pop(state.prior, None) if state.prior else state.healthy_std
                starts[state.name] = state.initial_std if own_spread is None else own_spread
        wanders = {k: s.wander for k, s in vehicle.estimation.items() if s.wander > 0.0}
        late = {name: vehicle.signals[name].delay_spread for name in LATE}
        for error in vehicle.smooth_errors:
            if (error.error_term, error.covariate) != ("torque", "compression"):
                over = f"{error.error_term} over {error.covariate}"
                raise ValueError(f"an error of {over} is not known here")
        curve = [(error.std / 100.0, error.length) for error in vehicle.smooth_errors]
        effects = machine_of(vehicle.model).effects
        # the oracle's trucks have no further masses: what is told apart of their heat is too much
        known = [gain for gain in vehicle.healthy if gain.effect in effects]
        acts = {gain.gain: gain.std for gain in known}
        healthy = {gain.gain: (gain.effect, gain.key) for gain in known}
        bounds = {
            name: next((n.lower, n.upper) for n in effects[effect].gains if n.key == key)
            for name, (effect, key) in healthy.items()
        }
        return cls(own, {**spreads, **starts, **late, **acts}, wanders, healthy, bounds, *curve)

    def replay(
        self, recorded: Recorded, z: Vector, effects: Effects, walks: Mapping[str, Floats] = STEADY
    ) -> Replayed:
        """With its numbers ``z`` standard deviations higher, some of which have ``walks``."""
        names = list(self.nuisances)
        by = {n: s * u for n, s, u in zip(names, z, self.nuisances.values(), strict=True)}
        late = {name: by[name] for name in LATE}
        acting = {name: dict(numbers) for name, numbers in effects.items()}
        for name, (effect, key) in self.healthy.items():
            if by[name]:
                numbers = acting.setdefault(effect, {})
                numbers[key] = float(np.clip(numbers.get(key, 0.0) + by[name], *self.bounds[name]))
        return replay(recorded, self.own.moved(by), acting, late, walks)


class Seen:
    """A recorded drive, looked at as a drive of ``truck``; it began with the numbers ``own``."""

    def __init__(self, drive: Drive, truck: Truck, recorded: Recorded, own: Own) -> None:
        self.truck, self.recorded, self._own = truck, recorded, own
        vehicle = drive.vehicle
        database = load_database(vehicle)
        kept = 1.0 - NOISES[drive.noise].outliers
        self._noise = {
            name: SensorNoise(s.noise / kept**0.5, s.noise_ar)
            for name, s in vehicle.signals.items()
        }
        self._period = {
            name: s.period or database.message(s.bus.message).cycle_time_s or 0.0
            for name, s in vehicle.signals.items()
        }
        self._stretches = self._free()
        self._blocks, self._counts = self._retracted()

    def _free(self) -> list[slice]:
        """Rows of the engine speed's readings in each stretch in which the clutch is not locked."""
        every = round(self._period["engine_speed"] / SPACING)
        # the first and the last may be of a moment at which the clutch is still locked
        stretches = [slice(a + 1, b - 1, every) for a, b in _runs(~self.recorded.locked)]
        return [one for one in stretches if one.stop - one.start >= SHORTEST * every]

    def _retracted(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Begins and ends (n, 2) of blocks of rows in which the sensor shows the zero position;
        readings in each, (n,)."""
        time, period, blocks = self.recorded.time, self._period["slave_position"], []
        for a, b in _runs(self.recorded.retracted):
            if b - a < 2:
                continue
            edges = a + np.searchsorted(time[a:b], np.arange(time[a], time[b - 1], BLOCK))
            blocks += list(zip(edges, [*edges[1:], b], strict=True))
        rows = np.array(blocks, np.int64).reshape(-1, 2)
        lasts = time[rows[:, 1] - 1] - time[rows[:, 0]]
        told = lasts >= SHORTEST * period
        return rows[told], np.rint(lasts[told] / period).astype(int)

    @cached_property
    def _plain(self) -> Replayed:
        return self.truck.replay(self.recorded, self.nought, NONE)

    @cached_property
    def _slope(self) -> Floats:
        return slope_of(self.recorded, self.truck.own)

    @property
    def nought(self) -> Vector:
        """The truck's own numbers."""
        return np.zeros(len(self.truck.nuisances))

    @property
    def begun(self) -> Vector:
        """The truck's own numbers, but the drive's own start: what rests is warm from a cause."""
        own, truck, std = self._own.start, self.truck.own.start, self.truck.nuisances
        return np.array([(own[k] - truck[k]) / std[k] if k in own else 0.0 for k in std])

    def misfit(self, z: Vector, effects: Effects, walks: Mapping[str, Floats] = STEADY) -> Floats:
        """Readings less what the truck with numbers ``z``, ``walks`` of these and ``effects`` would
        show; not white."""
        told, signals = self.truck.replay(self.recorded, z, effects, walks), self.recorded.signals
        speed = signals["engine_speed"] - told.speed
        sums = np.r_[0.0, np.cumsum(signals["slave_position"] - told.zero_position)]
        begins, ends = self._blocks.T
        means = (sums[ends] - sums[begins]) / (ends - begins)
        return np.concatenate([*(speed[stretch] for stretch in self._stretches), means])

    def white(self, columns: Floats) -> Floats:
        """Misfits (K, m) in standard deviations, independent of each other."""
        white = self._still(columns)
        for around, sizes in self._wandered:
            white -= around @ (sizes[:, None] * (around.T @ white))
        return white

    def _still(self, columns: Floats) -> Floats:
        """The same, were nothing to wander."""
        parts, at = [], 0
        for one in self._filters:
            rows = columns[at : at + len(one.spread)]
            parts.append(one.innovations(rows))
            at += len(rows)
        rest = columns[at:] / self._std[:, None]
        around, sizes = self._scattered
        return np.concatenate([*parts, rest - around @ (sizes[:, None] * (around.T @ rest))])

    @cached_property
    def _filters(self) -> list[SpeedFilter]:
        noise = [self._noise[name] for name in READ]
        inertia = self.truck.own.parameters["engine_inertia"]
        step, slope = self._period["engine_speed"], self._slope
        return [SpeedFilter.of(slope[rows], inertia, step, noise) for rows in self._stretches]

    @cached_property
    def _std(self) -> Floats:
        """Of the blocks' means."""
        counts, which = np.unique(self._counts, return_inverse=True)
        sensor = self._noise["slave_position"]
        return np.array([sensor.of_mean(int(count)) for count in counts])[which]

    @cached_property
    def _scattered(self) -> tuple[Floats, Floats]:
        """Directions (K, d) in which noise that has become heat scatters the zero position, and by
        what share (d,) each counts for less."""
        return _scattering(self._heated() / self._std[:, None])

    @cached_property
    def _wandered(self) -> list[tuple[Floats, Floats]]:
        """Directions (K, d) in which wander and an error of the curve scatter misfits, white
        without these, and by what share (d,) each counts for less; none where nothing does."""
        raw = [
            (self.misfit(self.nought, NONE, {state: SMALL * walk}) - self._raw) / SMALL
            for state, walk in (*self._walks(), *self._bends())
        ]
        return [_scattering(self._still(np.column_stack(raw)))] if raw else []

    def _walks(self) -> Iterator[tuple[str, Floats]]:
        """The sines (n,) of random walks of states that wander: Karhunen and Loève."""
        since = self.recorded.time - self.recorded.time[0]
        for state, density in self.truck.wanders.items():
            for k in range(TERMS):
                rate = (k + 0.5) * np.pi / since[-1]
                yield state, density * np.sqrt(2.0 / since[-1]) / rate * np.sin(rate * since)

    def _bends(self) -> Iterator[tuple[str, Floats]]:
        """Of an error of the torque curve, what each of its independent parts (n,) does: as if the
        friction changed with the stroke below the kiss point."""
        if self.truck.curve is None:
            return
        share, length = self.truck.curve
        stroke = self.recorded.signals["slave_position"] - self._plain.zero_position
        places = np.linspace(stroke.min(), stroke.max(), PLACES)
        apart = np.subtract.outer(places, places) / length
        variance, parts = np.linalg.eigh(np.exp(-0.5 * apart**2))
        for size, part in zip(variance, parts.T, strict=True):
            if size > ABSENT * variance[-1]:
                yield "friction", share * np.sqrt(size) * np.interp(stroke, places, part)

    def _heated(self) -> Floats:
        """What one standard deviation of every heat error does to the blocks' means, (K, d)."""
        capacities, own = self.truck.own.parameters, self.truck.own
        still, after = self.recorded.resting(), {}
        calm = replay(still, own).zero_position
        for part in ("body", "housing", "disc"):
            warmer = replay(still, own.moved({f"temp_{part}": 1.0})).zero_position - calm
            after[part] = warmer / capacities[f"heat_capacity_{part}"]
        time = self.recorded.time
        middles = np.array([time[a:b].mean() for a, b in self._blocks])

        def response(part: str, when: float) -> Floats:
            since = middles - when
            return np.where(since > 0.0, np.interp(since, time, after[part]), 0.0)

        columns = [std * response("disc", end) for end, std in self._slips()]
        for part, signal, path in (
            ("body", "coolant_temp", "conductance_engine_body"),
            ("housing", "ambient_temp", "conductance_housing_ambient"),
        ):
            count = SPELL / self._period[signal]
            std = self._noise[signal].of_sum * np.sqrt(count) * self._period[signal]
            for begin in np.arange(0.0, time[-1], SPELL):
                columns.append(capacities[path] * std * response(part, begin + SPELL / 2.0))
        return np.column_stack(columns)

    def _slips(self) -> list[tuple[float, float]]:
        """When each slip ends, and by how many joules its heat scatters."""
        signals, step = self.recorded.signals, self._period["engine_speed"]
        slip = signals["engine_speed"] - signals["input_shaft_speed"]
        slope, torque = self._slope, self._plain.torque
        found = []
        for stretch in self._stretches:
            x = np.linalg.norm((slope * slip)[stretch]) * self._noise["slave_position"].of_sum
            w = np.linalg.norm(torque[stretch]) * self._noise["engine_speed"].of_sum * 2**0.5
            if x + w > 0.0:
                found.append((self.recorded.time[stretch.stop], float(np.hypot(x, w)) * step))
        return found

    @cached_property
    def residual(self) -> Floats:
        """White, at the truck's own numbers, (K,)."""
        return self.white(self._raw[:, None])[:, 0]

    @cached_property
    def _raw(self) -> Floats:
        return self.misfit(self.nought, NONE)

    @cached_property
    def nuisances(self) -> Floats:
        """White derivatives of the misfit by the truck's numbers, (K, m)."""
        return self.by_nuisances(self.nought, NONE)

    def by_nuisances(self, z: Vector, effects: Effects) -> Floats:
        """The same at other numbers, with ``effects``."""
        before, one = self.misfit(z, effects), np.eye(len(z)) * NUDGE
        raw = [self.misfit(z + step, effects) - before for step in one]
        return self.white(np.column_stack(raw)) / NUDGE

    def by_effects(self, tried: Sequence[tuple[Effects, float]], z: Vector, at: Effects) -> Floats:
        """White differences of the misfit, (K, len(tried)), between each of the ``tried`` effects
        and those ``at`` work, per so much."""
        before = self.misfit(z, at)
        raw = [(self.misfit(z, effects) - before) / share for effects, share in tried]
        return self.white(np.column_stack(raw)) if raw else np.zeros((len(self.residual), 0))


def _scattering(columns: Floats) -> tuple[Floats, Floats]:
    """Orthonormal directions (K, d) of columns (K, c), each of which is taken a number of times
    that is normal, of variance 1; and by what share (d,) what lies along each counts for less."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u, 1.0 - 1.0 / np.sqrt(1.0 + s**2)


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Begin and end of every run of flags that are set."""
    edges = np.flatnonzero(np.diff(np.r_[0, flags, 0]))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
