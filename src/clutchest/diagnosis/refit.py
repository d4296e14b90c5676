"""Sizes of strong faults: the equations linearised again with the fault in them.

Faults are detected and isolated by derivatives at a healthy vehicle, at an operating point that the
fault has biased.  A strong fault is not proportional to its derivative there: a clutch that fades
transmits less torque, stays cooler, and fades less.  So the most probable faults are put into the
equations, fitted together with all nuisances, and their sizes estimated by derivatives there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchest.diagnosis.blocks import Blocks, blocks_of
from clutchest.diagnosis.fault_tests import FaultTestResults
from clutchest.diagnosis.isolation import Explanation, FaultHypothesis, hypotheses
from clutchest.diagnosis.recursive_residuals import onset_scores, recursive_residuals
from clutchest.inference.score_test import NOT_EXCLUDED
from clutchest.models.effects import Effect
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

STRONG = 5.0  # standard deviations; of a weaker fault the first-order size is within its interval


def refitted(
    signals: Signals,
    vehicle: Vehicle,
    effects: Sequence[Effect],
    results: FaultTestResults,
    causes: Sequence[Explanation],
    progress: Progress | None = None,
) -> tuple[Explanation, ...]:
    """``causes`` with the refitted sizes of those that are not excluded, strong, and present from
    the start, as far as that explains the drive as well as a later onset.

    A fault that begins later is measured against the same vehicle before and keeps its size.
    """
    known = {h.name: h for h in hypotheses(results)}
    refits = []
    for cause in causes:
        h = known[cause.fault]
        if cause.behind < NOT_EXCLUDED and abs(cause.size) > STRONG * cause.std:
            present = {h.index: cause.size / h.scale}
            blocks = blocks_of(signals, vehicle, effects, progress, present)
            size, std, improvement = _fit(blocks, h, 0)
            later = _fit(blocks, h, cause.onset)[2] if cause.onset else -np.inf
            if improvement > later - NOT_EXCLUDED:
                cause = replace(cause, size=size * h.scale, std=std * h.scale)
        refits.append(cause)
    return tuple(refits)


def _fit(blocks: Blocks, h: FaultHypothesis, onset: int) -> tuple[float, float, float]:
    """Size and standard deviation, in units, of a fault from block ``onset`` on, and the
    improvement of the fit, 2 Δ ln L."""
    before = recursive_residuals(blocks, [h.index]).before
    of = onset_scores(blocks, [h.index], before, onset, len(blocks))
    score, information = float(of.score[-1, 0]), float(of.information[-1, 0, 0])
    if information <= 0.0:
        return 0.0, np.inf, 0.0
    size = float(np.clip(score / information, 0.0 if h.one_sided else -1.0, 1.0))
    return size, information**-0.5, 2.0 * size * score - size**2 * information
