"""Sizes of strong faults: the equations linearised anew where the fault is part of them.

Faults are found and told apart by derivatives at a healthy clutch, whose parameters have bent
towards what the fault did.  What is strong enough to bend them much is not in proportion to its
trace any more: a clutch that fades passes less torque, stays cooler, and fades less for that.  So
the likeliest faults are put into the equations, with all that a healthy truck may differ by settled
beside them, and their sizes read from derivatives taken there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchest.diagnosis.blocks import Blocks, blocks_of
from clutchest.diagnosis.equations import Watched
from clutchest.diagnosis.isolation import TIED, Explanation, Hypothesis, hypotheses
from clutchest.diagnosis.predicted import predicted, since
from clutchest.models.effects import Effect
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

STRONG = 5.0  # standard deviations; what is weaker lies within its own interval by derivatives


def refined(
    signals: Signals,
    vehicle: Vehicle,
    effects: Sequence[Effect],
    watched: Watched,
    causes: Sequence[Explanation],
    progress: Progress | None = None,
) -> tuple[Explanation, ...]:
    """``causes`` with the sizes of those that may be it, are strong, and were there from the start:
    where that explains the drive as well, by the equations with the fault in them.

    What began later is told against a clutch that was known before, and stays as it is.
    """
    known = {h.name: h for h in hypotheses(watched)}
    found = []
    for cause in causes:
        h = known[cause.fault]
        if cause.behind < TIED and abs(cause.size) > STRONG * cause.std:
            present = {h.index: cause.size / h.scale}
            blocks = blocks_of(signals, vehicle, effects, progress, present)
            size, std, gained = _explained(blocks, h, 0)
            if not cause.onset or gained > _explained(blocks, h, cause.onset)[2] - TIED:
                cause = replace(cause, size=size * h.scale, std=std * h.scale)
        found.append(cause)
    return tuple(found)


def _explained(blocks: Blocks, h: Hypothesis, onset: int) -> tuple[float, float, float]:
    """Size and standard deviation, in units, of a fault from block ``onset`` on, and what it gains
    in −2 ln(probability)."""
    told = since(blocks, [h.index], predicted(blocks, [h.index]).before, onset, len(blocks))
    score, information = float(told.score[-1, 0]), float(told.information[-1, 0, 0])
    if information <= 0.0:
        return 0.0, np.inf, 0.0
    size = float(np.clip(score / information, 0.0 if h.one_sided else -1.0, 1.0))
    return size, information**-0.5, 2.0 * size * score - size**2 * information
