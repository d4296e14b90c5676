"""Which fault it is: the one that explains the drive best, and all that explain it as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.diagnosis.equations import Watched
from clutchest.diagnosis.predicted import since
from clutchest.signals import Floats

TIED = 1.645**2  # in −2 ln(probability): nearer to the best, a rival is not excluded at 95 %
AROUND = 2  # blocks by which the onset may lie off


@dataclass(frozen=True, slots=True)
class Explanation:
    """A fault that may be behind it: its most probable ``size`` ± ``std``, from block ``onset`` on,
    and by how much it explains less than the best, in −2 ln(probability)."""

    fault: str
    size: float
    std: float
    unit: str
    onset: int
    behind: float


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One gain that may have jumped; ``only_from_start``: it cannot begin later."""

    name: str
    index: int
    unit: str
    scale: float
    one_sided: bool
    only_from_start: bool = False


def hypotheses(watched: Watched) -> tuple[Hypothesis, ...]:
    """Every fault that is watched, and wear that was there before."""
    thetas = watched.blocks.thetas
    found = [
        Hypothesis(
            j.fault.name, column, j.fault.number.unit, thetas[column].unit, j.fault.number.one_sided
        )
        for j, column in zip(watched.faults, watched.columns, strict=True)
    ]
    for i, t in enumerate(thetas):
        if (t.owner, t.key) == ("wear", "amount"):
            found.append(Hypothesis("wear", i, "mm", t.unit, True, True))
    return tuple(found)


def explanations(watched: Watched, onsets: list[int], until: int) -> list[Explanation]:
    """Every fault's best account of blocks up to ``until`` (exclusive), best first; it began with
    one of the blocks ``onsets`` or close to it."""
    able = hypotheses(watched)
    tried = sorted(
        {
            k
            for onset in onsets
            for k in range(max(onset - AROUND, 0), onset + AROUND + 1)
            if k < until and (onset or not k)
        }
    )
    best: dict[str, Explanation] = {}
    for onset in tried:
        score, information = traces(watched, able, onset, until)
        for i, h in enumerate(able):
            if (h.only_from_start and onset) or information[i, i] <= 0.0:
                continue
            size = score[i] / information[i, i]
            size = float(np.clip(size, 0.0 if h.one_sided else -1.0, 1.0))
            gained = float(2.0 * size * score[i] - size**2 * information[i, i])
            std = float(h.scale / np.sqrt(information[i, i]))
            found = Explanation(h.name, size * h.scale, std, h.unit, onset, -gained)
            if h.name not in best or found.behind < best[h.name].behind:
                best[h.name] = found
    ranked = sorted(best.values(), key=lambda e: e.behind)
    least = ranked[0].behind
    return [Explanation(e.fault, e.size, e.std, e.unit, e.onset, e.behind - least) for e in ranked]


def traces(
    watched: Watched, able: tuple[Hypothesis, ...], onset: int, until: int
) -> tuple[Floats, Floats]:
    """Score (H) and information (H, H) of faults that begin with block ``onset``, by the blocks
    from there up to ``until`` (exclusive)."""
    blocks = watched.blocks
    told = since(blocks, [h.index for h in able], watched.residuals.before, onset, until)
    less = np.eye(len(able))
    names = [h.name for h in able]
    hours = float(blocks.begin[onset]) / 3600.0 if onset else 0.0
    for judged in watched.faults:
        for other, amount in judged.fault.onset(hours).items():
            i, k = names.index(judged.fault.name), names.index(other)
            less[i, k] -= amount * able[i].scale / able[k].scale
    return less @ told.score[-1], less @ told.information[-1] @ less.T


def told_apart(ranked: Sequence[Explanation]) -> tuple[str, ...]:
    """The faults that cannot be told apart, the likeliest first."""
    return tuple(e.fault for e in ranked if e.behind < TIED)


def distances(watched: Watched, sizes: Floats) -> tuple[tuple[str, ...], Floats]:
    """Names (H) and the matrix (H, H + 1) of d′ by the whole drive, before any fault: how far one
    of ``sizes`` (H), there from the start, lies from the best that each other one can do for it,
    and in the last column from no fault at all."""
    able = hypotheses(watched)
    _, J = traces(watched, able, 0, len(watched.blocks))
    found = np.zeros((len(able), len(able) + 1))
    for i, own in enumerate(able):
        size = sizes[i] / own.scale
        found[i, -1] = np.sqrt(max(size**2 * J[i, i], 0.0))
        for k, other in enumerate(able):
            low = 0.0 if other.one_sided else -1.0
            either = []  # way, of which the more alike counts
            for b in (size,) if own.one_sided else (size, -size):
                best = b * J[i, k] / J[k, k] if J[k, k] > 0.0 else 0.0
                rival = float(np.clip(best, low, 1.0))
                either.append(b**2 * J[i, i] - 2 * b * rival * J[i, k] + rival**2 * J[k, k])
            found[i, k] = np.sqrt(max(min(either), 0.0))
    return tuple(h.name for h in able), found
