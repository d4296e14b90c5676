"""The mean of a posterior that is nearly normal, from its mode.

Where errors are not linear in the numbers, a probability falls off faster on one side of its
maximum than on the other.  The mode is then off to one side, and the more so the wider the standard
deviation at it, whereas of a mean neither is true: whatever else the data decide, also whether they
determine a number at all, its errors are zero on average.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.signals import Floats

REACH = 0.5  # standard deviations, over which second derivatives are taken
FARTHEST = 1.0  # standard deviations; a mean farther from the mode is not nearly normal's


@dataclass(frozen=True, slots=True)
class ErrorBlock:
    """Independent errors of variance 1: ``errors`` (k,) by the step from the mode (n,), the indices
    of the numbers ``acting`` on them, and their ``jacobian`` (k, n) at the mode."""

    errors: Callable[[Floats], Floats]
    acting: Sequence[int]
    jacobian: Floats


def mean_less_mode(blocks: Sequence[ErrorBlock], covariance: Floats) -> Floats:
    """How far (n) the mean lies from the mode, given the numbers' normal prior and all blocks.

    −C t/2 with the covariance C (n, n) and t_i = Σ_jk C_jk ∂³(−ln p)/∂i ∂j ∂k: to the second order
    in the errors r, those derivatives are r_i·r_jk + r_j·r_ik + r_k·r_ij.  Zero where that order
    does not do.
    """
    std = np.sqrt(np.diag(covariance))
    t = np.zeros(len(std))
    for block in blocks:
        t += _contracted(block, covariance, REACH * std)
    shift = -0.5 * covariance @ t
    return shift if np.all(np.abs(shift) < FARTHEST * std) else np.zeros(len(std))


def _contracted(block: ErrorBlock, covariance: Floats, reach: Floats) -> Floats:
    """t (n) of one block, second derivatives over a ``reach`` (n) either way."""

    def moved(*numbers: int) -> Floats:
        step = np.zeros(len(reach))
        step[list(numbers)] = reach[list(numbers)]
        return np.asarray(block.errors(step) + block.errors(-step))

    twice = moved()
    alone = {i: moved(i) - twice for i in block.acting}
    spread = block.jacobian @ covariance
    t, trace = np.zeros(len(reach)), np.zeros(len(twice))
    for count, i in enumerate(block.acting):
        for j in block.acting[: count + 1]:
            both = 2 * alone[i] if i == j else moved(i, j) - twice - alone[i] - alone[j]
            bent = both / (2 * reach[i] * reach[j])
            t[i] += 2 * spread[:, j] @ bent
            t[j] += 2 * spread[:, i] @ bent * (i != j)
            trace += covariance[i, j] * bent * (1 if i == j else 2)
    return np.asarray(t + block.jacobian.T @ trace)
