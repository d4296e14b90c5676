"""Whether signals and model can both be right, while a drive is filtered.

Three things cannot be, whatever the noise: a state outside what is physically possible, dissipated
energy that comes back, and innovations far outside what noise and the largest plausible errors of
the model allow.  All are judged over stretches of a drive, so that a short transient counts little.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.contradiction import MISFIT, Contradiction
from clutchest.estimate.run import Estimate, Track
from clutchest.estimate.worn import worn_range, worn_so_far
from clutchest.models.model import Model
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

STRETCH_S = 10.0  # s of innovations that are judged together
SHORT_S = 30.0  # s; of a shorter drive too few stretches are whole
FEWEST = 2  # stretches beyond FAR
LEAST = 5  # readings of a sensor in a stretch that is judged
MEDIAN = 0.6745  # of |z|, standard normal
# Times a sensor's tolerance → share of the stretches that may exceed it in a right model.  With any
# effect of the library at its bound none of some 10 000 exceeds three times.
SHARES = {1.0: 0.1, 3.0: 1e-3, 25.0: 1e-4}
FAR = 10.0  # standard deviations, root mean square of a stretch, at which no state is believed
LASTING_S = 10.0  # s beyond a physical bound
STD = 3.0  # standard deviations beyond it
ROUNDING = 1e-6  # s
RETURNED_J = 1e3  # J of dissipated energy that rounding may take back
BACKWARDS = 0.05  # of it likewise


class Consistency:
    """Judges the pieces of one drive, one after another.

    ``per_1000h``: false alarms in a right model; ``worn``: a state, and between which values a part
    that is worn may have brought it; ``found`` the first contradiction, None without.
    """

    def __init__(
        self, model: Model, per_1000h: float, worn: tuple[str, float, float] | None = None
    ) -> None:
        self.model, self.per_1000h, self.worn = model, per_1000h, worn
        self.found: Contradiction | None = None
        self._open: dict[int, list[tuple[Floats, Floats]]] = {}  # sensor → times and |z|
        # sensor → stretches, and those beyond each multiple of the tolerance
        self._judged = dict.fromkeys(range(len(model.sensors)), (0, (0,) * len(SHARES)))
        self._far = dict.fromkeys(range(len(model.sensors)), 0)  # sensor → stretches beyond FAR
        self._worst = dict.fromkeys(range(len(model.sensors)), 0.0)  # largest scale over tolerance
        self._outside: dict[str, float] = {}  # state → s
        self._last_s, self._most_J = -np.inf, 0.0

    @classmethod
    def of(cls, model: Model, vehicle: Vehicle) -> Consistency:
        """With the vehicle's rate of false alarms, and its limit of wear."""
        return cls(model, vehicle.false_alarms_per_1000h, worn_range(vehicle))

    def contradict(self, found: Contradiction) -> None:
        """What was found by other means; an explanation is worth more than none."""
        if self.found is None:
            self.found = found
        elif not self.found.is_explained:
            self.found = replace(found, since_s=min(found.since_s, self.found.since_s))

    def take(self, track: Track, last: bool = False) -> Track:
        """The next piece, or the ``last`` one, its estimates not valid behind a contradiction."""
        found = [self._misfit(track, last), self._impossible(track), self._returned(track)]
        if self.found is None or self.found.kind == MISFIT:
            known = [c for c in found if c is not None]
            self.found = min(
                known, key=lambda c: c.since_s, default=self.found or self._astray(track, last)
            )
        if self.found is None:
            return track
        before = track.time < self.found.since_s
        return replace(valid_where(track, before), contradiction=self.found)

    def _misfit(self, track: Track, last: bool) -> Contradiction | None:
        """Innovations: the median of each stretch against the sensor's tolerance; a stretch ends
        with a short drive, too."""
        events = track.innovations
        latest = np.concatenate([events.time[-1:], track.time[-1:], [0.0]]).max()
        now = int(latest // STRETCH_S) + (last and latest < SHORT_S)
        first: Contradiction | None = None
        for i, sensor in enumerate(self.model.sensors):
            if sensor.name not in self.model.predicted:
                continue
            time, innovation, std = events.of(sensor.name)
            parts = self._open.setdefault(i, [])
            parts.append((time, np.abs(innovation / np.maximum(std, 1e-300))))
            time, z = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
            number = (time // STRETCH_S).astype(np.int64)
            complete = int(np.searchsorted(number, now))
            self._open[i] = [(time[complete:], z[complete:])]
            edges = np.flatnonzero(np.diff(number[:complete], prepend=-1, append=-1))
            for a, b in pairwise(edges):
                found = self._stretch(i, z[a:b], (int(number[a]) + 1) * STRETCH_S)
                if found and (first is None or found.since_s < first.since_s):
                    first = found
        return first

    def _stretch(self, i: int, z: Floats, end: float) -> Contradiction | None:
        if len(z) < LEAST:
            return None
        sensor, (n, beyond) = self.model.sensors[i], self._judged[i]
        scale = _median(z) / MEDIAN
        times = scale / sensor.tolerance
        self._worst[i] = max(self._worst[i], times)
        n, beyond = n + 1, tuple(k + (times > of) for k, of in zip(beyond, SHARES, strict=True))
        self._judged[i] = n, beyond
        self._far[i] += bool(np.mean(z**2) > FAR**2)
        allowed = self.per_1000h * end / 3.6e6 / len(self.model.sensors)
        shares = zip(beyond, SHARES.values(), strict=True)
        if min(_at_least(k, n, share) for k, share in shares) >= allowed:
            return None
        return Contradiction(
            f"{sensor.name} differs from the model's prediction by more than {sensor.tolerance:g} "
            f"times its standard deviation in {beyond[0]} of {n} stretches of {STRETCH_S:g} s, "
            f"lately {scale:.0f} times",
            sensor.column or sensor.name,
            end,
        )

    def _astray(self, track: Track, last: bool) -> Contradiction | None:
        """Readings far off in most stretches though none of its own is beyond what an effect at
        its bound makes: the filter follows them, and its numbers are none of the machine's.  One
        that is worn looks like it, too, where the filter began with new parts."""
        if worn_so_far(track, self.worn):
            return None
        for i, sensor in enumerate(self.model.sensors):
            far, (n, _) = self._far[i], self._judged[i]
            if far >= FEWEST and 2 * far > n and (last or n > FEWEST):
                return Contradiction(
                    f"{sensor.name} differs from the model's prediction by more than {FAR:g} times "
                    f"its standard deviation, root mean square, in {far} of {n} stretches of "
                    f"{STRETCH_S:g} s",
                    sensor.column or sensor.name,
                    n * STRETCH_S,
                    kind=MISFIT,
                )
        return None

    def _impossible(self, track: Track) -> Contradiction | None:
        """States beyond their physical bounds, and for how long."""
        if not len(track.time):
            return None
        step = np.diff(track.time, prepend=max(self._last_s, track.time[0] - 1.0))
        self._last_s = float(track.time[-1])
        first: Contradiction | None = None
        for state in self.model.states:
            (low, high), each = state.possible, track.states[state.name]
            off = np.maximum(low - each.value, each.value - high)
            spent = np.cumsum(np.where(off > STD * each.std, np.minimum(step, 1.0), 0.0))
            spent += self._outside.get(state.name, 0.0)
            self._outside[state.name] = float(spent[-1])
            rows = np.flatnonzero(spent >= LASTING_S - ROUNDING)
            if len(rows) and (first is None or track.time[rows[0]] < first.since_s):
                k = int(rows[0])
                first = Contradiction(
                    f"{state.name} {each.value[k]:.3g} ± {each.std[k]:.2g} {state.unit} is "
                    f"physically impossible, expected {_range(low, high)}".replace(" 1 is", " is"),
                    self._suspect(state.name),
                    float(track.time[k]),
                )
        return first

    def _returned(self, track: Track) -> Contradiction | None:
        """Dissipated energy rises."""
        energy = track.slip_energy
        if energy is None or not len(energy.value):
            return None
        value = np.nan_to_num(energy.value)
        most = np.maximum(np.maximum.accumulate(value), self._most_J)
        self._most_J = float(most[-1])
        fallen = most - value
        allowed = np.maximum(BACKWARDS * most, RETURNED_J) + STD * np.nan_to_num(energy.std)
        rows = np.flatnonzero(fallen > allowed)
        if not len(rows):
            return None
        k = int(rows[0])
        return Contradiction(
            f"dissipated energy falls by {fallen[k] / 1e3:.3g} kJ, and heat does not come back",
            self._suspect(""),
            float(track.time[k]),
        )

    def _suspect(self, state: str) -> str:
        """The signal of a state, or of the sensor that the model predicts worst."""
        names = [sensor.column or sensor.name for sensor in self.model.sensors]
        if state in names:
            return state
        return names[max(self._worst, key=lambda i: self._worst[i])]


def _median(z: Floats) -> float:
    """Of numbers, at least one: what ``np.median`` gives, which takes ten times as long for few."""
    half = len(z) // 2
    parted = np.partition(z, half)
    if len(z) % 2:
        return float(parted[half])
    return float((parted[:half].max() + parted[half]) / 2.0)


def all_invalid(track: Track, found: Contradiction) -> Track:
    """A drive that contradicts the model, known as a whole: none of its estimates is valid."""
    return replace(valid_where(track, np.zeros(len(track.time), bool)), contradiction=found)


def valid_where(
    track: Track, still: NDArray[np.bool_], names: Container[str] | None = None
) -> Track:
    """A drive whose states and outputs, all or those of these ``names``, are valid at most where
    ``still`` (m) holds."""
    states, outputs = (_invalid(each, still, names) for each in (track.states, track.outputs))
    torque, energy = outputs.get("clutch_torque"), outputs.get("slip_energy")
    return replace(track, states=states, clutch_torque=torque, slip_energy=energy)


def _invalid(
    estimates: Mapping[str, Estimate], still: NDArray[np.bool_], names: Container[str] | None
) -> dict[str, Estimate]:
    return {
        name: replace(each, valid=each.valid & still) if names is None or name in names else each
        for name, each in estimates.items()
    }


def _range(low: float, high: float) -> str:
    if not np.isfinite(low):
        return f"at most {high:g}"
    return f"{low:g} … {high:g}" if np.isfinite(high) else f"at least {low:g}"


def _at_least(k: int, n: int, p: float) -> float:
    """Probability of at least ``k`` of ``n``, each with probability ``p``."""
    if k <= n * p:
        return 1.0
    n, k = (n, k) if n <= 1000 else (1000, k * 1000 // n)  # of a long drive its share
    return sum(comb(n, j) * p**j * (1 - p) ** (n - j) for j in range(k, n + 1))
