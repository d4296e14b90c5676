"""Fault isolation: the fault that explains a drive best, and all that the data do not exclude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from clutchest.diagnosis.codes import WEAR
from clutchest.diagnosis.fault_tests import FaultTestResults
from clutchest.diagnosis.recursive_residuals import onset_scores
from clutchest.inference.score_test import NOT_EXCLUDED, d_prime
from clutchest.shown import plus_minus
from clutchest.signals import Floats

AROUND = 2  # blocks by which the onset may be off


@dataclass(frozen=True, slots=True)
class Explanation:
    """A possible cause: its most probable ``size`` ± ``std``, from block ``onset`` on, and by how
    much it fits worse than the best, in 2 Δ ln L (``behind``).  Where residuals with its effect
    taken out are ``left`` so many times as large as noise, which noise does not explain, its size
    is not determined; its sign is that of what comes closest.  ``began_s``: its onset, s since
    the drive's start, where that is estimated within a block."""

    fault: str
    size: float
    std: float
    unit: str
    onset: int
    behind: float
    left: float | None = None
    began_s: float | None = None

    @property
    def determined(self) -> bool:
        """Whether it has a size."""
        return self.left is None

    @property
    def why_not(self) -> str:
        """Why its size is not determined; nothing where it is."""
        if self.left is None:
            return ""
        return (
            f"with its most probable size, residuals are still {self.left:.2g} times as large as "
            "noise: it does not act as the equations say, or not alone, or the vehicle file states "
            "too little noise"
        )

    @property
    def magnitude(self) -> str:
        """Its size with sign, standard deviation and unit, or that it is not determined."""
        if not self.determined:
            return f"size not determined ({self.why_not})"
        sign = "+" if self.size > 0.0 else ""
        return sign + plus_minus(self.size, self.std, self.unit)


@dataclass(frozen=True, slots=True)
class FaultHypothesis:
    """One gain that may have changed: its ``index`` among the thetas and ``scale``, the size of one
    unit there; ``only_from_start``: it cannot begin later."""

    name: str
    index: int
    unit: str
    scale: float
    one_sided: bool
    only_from_start: bool = False


def hypotheses(results: FaultTestResults) -> tuple[FaultHypothesis, ...]:
    """Every fault that is tested, and wear that was present before the drive."""
    thetas, wear = results.blocks.thetas, results.machine.wear
    tested = [
        FaultHypothesis(
            r.fault.name, column, r.fault.gain.unit, thetas[column].unit, r.fault.gain.one_sided
        )
        for r, column in zip(results.faults, results.columns, strict=True)
    ]
    worn = [
        FaultHypothesis(WEAR, i, wear.unit, t.unit, one_sided=True, only_from_start=True)
        for i, t in enumerate(thetas)
        if wear is not None and str(t) == f"{wear.effect}.{wear.amount}"
    ]
    return (*tested, *worn)


def explanations(results: FaultTestResults, onsets: Sequence[int], until: int) -> list[Explanation]:
    """Each fault's most probable explanation of the blocks up to ``until`` (exclusive), best first;
    it began with one of the blocks ``onsets`` or close to it."""
    known = hypotheses(results)
    candidates = sorted(
        {
            k
            for onset in onsets
            for k in range(max(onset - AROUND, 0), onset + AROUND + 1)
            if k < until and (onset or not k)
        }
    )
    best: dict[str, Explanation] = {}
    for onset in candidates:
        score, information = scores(results, known, onset, until)
        for i, h in enumerate(known):
            if (h.only_from_start and onset) or information[i, i] <= 0.0:
                continue
            size = score[i] / information[i, i]
            size = float(np.clip(size, 0.0 if h.one_sided else -1.0, 1.0))
            improvement = float(2.0 * size * score[i] - size**2 * information[i, i])
            std = float(h.scale / np.sqrt(information[i, i]))
            tried = Explanation(h.name, size * h.scale, std, h.unit, onset, -improvement)
            if h.name not in best or tried.behind < best[h.name].behind:
                best[h.name] = tried
    ranked = sorted(best.values(), key=lambda e: e.behind)
    return [replace(e, behind=e.behind - ranked[0].behind) for e in ranked]


def scores(
    results: FaultTestResults, known: Sequence[FaultHypothesis], onset: int, until: int
) -> tuple[Floats, Floats]:
    """Score (H) and information (H, H) of faults that begin with block ``onset``, by the blocks
    from there up to ``until`` (exclusive)."""
    blocks = results.blocks
    of = onset_scores(blocks, [h.index for h in known], results.residuals.before, onset, until)
    change = np.eye(len(known))  # of a fault that grows: less what it would have reached by then
    names = [h.name for h in known]
    hours = float(blocks.begin[onset]) / 3600.0 if onset else 0.0
    for result in results.faults:
        for other, amount in result.fault.grows_as.items():
            i, k = names.index(result.fault.name), names.index(other)
            change[i, k] -= amount * hours * known[i].scale / known[k].scale
    return change @ of.score[-1], change @ of.information[-1] @ change.T


def not_excluded(ranked: Sequence[Explanation]) -> tuple[str, ...]:
    """The faults that the data do not exclude, the most probable first."""
    return tuple(e.fault for e in ranked if e.behind < NOT_EXCLUDED)


def separability(results: FaultTestResults, sizes: Floats) -> tuple[tuple[str, ...], Floats]:
    """Names (H) and the matrix (H, H + 1) of d′ over the whole drive: of each fault, present from
    the start with one of ``sizes`` (H), from each other one at its most similar size, and in the
    last column from no fault."""
    known = hypotheses(results)
    _, information = scores(results, known, 0, len(results.blocks))
    one_sided = [h.one_sided for h in known]
    matrix = np.zeros((len(known), len(known) + 1))
    for i, own in enumerate(known):
        size = float(sizes[i] / own.scale)
        matrix[i, -1] = np.sqrt(max(size**2 * information[i, i], 0.0))
        signs = (size,) if own.one_sided else (size, -size)
        for k in range(len(known)):
            matrix[i, k] = min(d_prime(information, one_sided, i, s, k) for s in signs)
    return tuple(h.name for h in known), matrix
