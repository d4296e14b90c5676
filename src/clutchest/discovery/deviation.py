"""Whether coefficients beside an effect are larger than noise, and than what no model is exact to.

An effect that is right is right to some share of itself: equations are integrated and inputs
interpolated.  So deviations from its form have a variance of their own, in proportion to the
effect, beside that of the noise; the stronger a cause, the more it counts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from clutchest.signals import Floats

VISIBLE = 4.0  # information of a coefficient of 1 that is seen at two standard deviations


class FormDeviation(NamedTuple):
    """``statistic`` of coefficients against none but inexact ones, its degrees of ``freedom`` and
    the ``p_value`` by the χ² distribution: 1 where the data say nothing."""

    statistic: float
    freedom: int
    p_value: float


def deviation(
    pure: Floats,
    r: Floats,
    score: Floats,
    information: Floats,
    blocks: NDArray[np.int64],
    negligible: Floats,
    inexact: float,
) -> FormDeviation:
    """Of coefficients (c) by their ``score`` (c) with its ``information`` (c, c), in units of the
    effect, of which they have a standard deviation ``inexact`` where its form is right.

    ``pure`` (K, c): the derivatives of innovations ``r`` (K) that nuisances leave; in ``blocks``
    (K) they may correlate.  Directions with less information than the matrix ``negligible`` (c, c)
    has there are no more than the inputs' noise.
    """
    strength, directions = np.linalg.eigh(information)
    floor = np.sum(directions * (negligible @ directions), axis=0)
    seen = strength > np.maximum(VISIBLE, floor)
    if not seen.any():
        return FormDeviation(0.0, 0, 1.0)
    strength, directions = strength[seen], directions[:, seen]
    along = score @ directions
    columns = pure @ directions
    left = r + columns @ (along / strength)
    variance = strength * _dispersion(columns, left, blocks, strength)
    statistic = float(np.sum(along**2 / (variance + (inexact * strength) ** 2)))
    return FormDeviation(statistic, len(strength), float(chdtrc(len(strength), statistic)))


def _dispersion(
    columns: Floats, left: Floats, blocks: NDArray[np.int64], strength: Floats
) -> float:
    """How much more the scores of ``columns`` (K, c) scatter from block to block than noise of
    variance 1 makes them, in the mean: where inputs move fast, their noise and timing weigh
    more."""
    each = np.zeros((int(blocks.max()) + 1, columns.shape[1]))
    np.add.at(each, blocks, columns * left[:, None])
    return max(1.0, float(np.mean(np.sum(each**2, axis=0) / strength)))
