"""Whether an actuator would give back energy that it has not stored."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from clutchest.estimate.contradiction import Contradiction
from clutchest.models.regimes import average
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

CALM_S = 0.02  # over which readings are averaged
APART = 0.25  # of the travel, beyond the middle on either side, between two times that are there
TRAVEL = 50.0  # standard deviations of the position's noise, that it travels at least
TIMES = 3.0  # what is given back against what is taken, or the other way round
CERTAIN = 5.0  # standard deviations of the noise in what is given back


def against_work(drive: Signals, vehicle: Vehicle) -> Contradiction | None:
    """That the pairs of an actuator that say what it takes have, in all, opposite signs.

    Between two times at the same position it cannot have given back more than it took, whatever
    its friction, springs and gears are.  The pairs that agree tell which signs are wrong.
    """
    way = vehicle.machine.storing
    if way is None or way.position not in drive.available:
        return None
    read = drive[way.position].only_valid()
    calm = average(read.time, read.value, CALM_S)
    places = _at_the_middle(calm, TRAVEL * vehicle.signals[way.position].noise)
    if len(places) < 2:
        return None
    wrong: dict[tuple[str, str], bool] = {}
    for pair in way.pairs:
        if set(pair) <= set(drive.available):
            taken, noise = _taken(drive, vehicle, pair, way.position, read.time, calm)
            parts = np.diff(taken[places])
            back, forth = -parts[parts < 0.0].sum(), parts[parts > 0.0].sum()
            if max(back, forth) > max(TIMES * min(back, forth), CERTAIN * noise):
                wrong[pair] = bool(back > forth)
    if not any(wrong.values()):
        return None
    first, second = next(pair for pair, opposed in wrong.items() if opposed)
    sets = list(_turned(wrong))
    which = ", or ".join(_in_words(names) for names in sets)
    signal, *others = dict.fromkeys(name for names in sets for name in names)
    what = f"the change of {second}" if second == way.position else second
    return Contradiction(
        f"{first} and {what} have, in all, opposite signs between times at the same "
        f"{way.position}: the actuator would give back what it has not taken",
        signal,
        float(read.time[places[1]]),
        which,
        "sign",
        tuple(others),
    )


def _at_the_middle(position: Floats, least: float) -> np.ndarray:
    """The samples at which a position (n) is in the middle of its travel, of those between which
    it is well away from it; none where it travels less than ``least``."""
    low, high = np.percentile(position, (2.0, 98.0))
    if high - low < least:
        return np.zeros(0, np.intp)
    off = position - (low + high) / 2.0
    side = np.where(np.abs(off) > APART * (high - low), np.sign(off), 0.0)
    away = np.flatnonzero(side)
    passes = np.flatnonzero(np.diff(side[away]))
    return np.array(
        [
            a + np.argmin(np.abs(off[a : b + 1]))
            for a, b in zip(away[passes], away[passes + 1], strict=True)
        ],
        np.intp,
    )


def _taken(
    drive: Signals,
    vehicle: Vehicle,
    pair: tuple[str, str],
    position: str,
    time: Floats,
    calm: Floats,
) -> tuple[Floats, float]:
    """What was taken until each ``time`` (n) s, in the units of the ``pair``, and how much noise
    makes of it; ``calm`` (n) the position."""
    effort, flow = (average(time, drive[n].only_valid().at(time), CALM_S) for n in pair)
    step = np.diff(calm) if pair[1] == position else np.diff(time) * (flow[1:] + flow[:-1]) / 2.0
    taken = np.concatenate([[0.0], np.cumsum(step * (effort[1:] + effort[:-1]) / 2.0)])
    return taken, vehicle.signals[pair[0]].noise * float(np.sqrt(np.sum(step**2)))


def _turned(wrong: dict[tuple[str, str], bool]) -> Iterator[Sequence[str]]:
    """The smallest sets of signals whose signs, turned, set right what is ``wrong``, and leave the
    pairs that agree as they are."""
    names = list(dict.fromkeys(name for pair in wrong for name in pair))
    found: list[set[str]] = []
    for count in range(1, len(names)):
        for some in combinations(names, count):
            fits = all((a in some) ^ (b in some) == opposed for (a, b), opposed in wrong.items())
            if fits and not any(smaller < set(some) for smaller in found):
                found.append(set(some))
                yield some


def _in_words(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"the sign of {names[0]} is wrong"
    return f"the signs of {' and '.join(names)} are wrong"
