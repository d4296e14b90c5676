"""Sequential tests, compiled: each takes new samples and carries its state to the next batch.

*CUSUM* (Page 1954): the log-likelihood ratios of fault and no fault are summed, and the sum is
reset to 0 whenever it falls below.  *GLR* (Willsky and Jones 1976): likewise where size and onset
of the fault are unknown and take their maximum-likelihood values.  Both need white residuals.
*Tail*: where the distribution of a quantity is unknown, its tail is estimated from its samples as
exponential beyond a threshold (peaks over threshold).
"""

from __future__ import annotations

import numpy as np

from clutchest.native import compiled

# State of a tail: number and sum of the samples, number and summed excess of those beyond the edge.
COUNT, TOTAL, EXCEEDING, EXCESS, PRIOR, GRAIN = range(6)
EDGE = 3.0  # means, beyond which the distribution is taken to be exponential
PRIOR_COUNT = 20.0  # samples that the prior mean counts for


def new_tail(prior_mean: float, grain: float = 0.0) -> np.ndarray:
    """State of a tail without samples; ``prior_mean`` of a sample, ``grain`` the resolution of its
    values."""
    return np.array([0.0, 0.0, 0.0, 0.0, prior_mean, grain])


@compiled
def tail_mean(tail):  # type: ignore[no-untyped-def]
    """Posterior mean of a sample."""
    return (tail[TOTAL] + PRIOR_COUNT * tail[PRIOR]) / (tail[COUNT] + PRIOR_COUNT)


@compiled
def tail_take(tail, x):  # type: ignore[no-untyped-def]
    """Update with one healthy sample."""
    edge = EDGE * tail_mean(tail)
    tail[COUNT] += 1.0
    tail[TOTAL] += x
    if x > edge:
        tail[EXCEEDING] += 1.0
        tail[EXCESS] += x - edge + tail[GRAIN]


@compiled
def tail_bound(tail, samples):  # type: ignore[no-untyped-def]
    """The value that ``samples`` healthy ones exceed once: peaks over threshold, exponential.

    One pseudo-peak with an excess as large as the edge is the prior.
    """
    edge = EDGE * tail_mean(tail)
    share = (tail[EXCEEDING] + 1.0) / (tail[COUNT] + PRIOR_COUNT)
    scale = (tail[EXCESS] + edge) / (tail[EXCEEDING] + 1.0)
    return edge + scale * max(np.log(max(samples * share, 1.0)), 0.0)


# --- likelihood ratios ------------------------------------------------------------------------


@compiled
def cusum(gains, start, path, begun):  # type: ignore[no-untyped-def]
    """Page's sum of log-likelihood ratios ``gains`` (n) from ``start`` on, into ``path`` (n);
    ``begun`` (n) the first sample since the last reset (−1: before the first of these)."""
    level, first = start, -1
    for k in range(len(gains)):
        if level <= 0.0:
            level, first = 0.0, k
        level += gains[k]
        path[k], begun[k] = level, first
    return max(level, 0.0)


LEVEL, BEGUN, FAILING = range(3)  # state of cusum_step; further entries belong to its caller


@compiled
def cusum_step(state, gain, bound, time, changes, n):  # type: ignore[no-untyped-def]
    """One step of Page's sum with ``gain`` at ``time`` s, limited to twice its ``bound``: the test
    fails above the bound and heals at 0.

    ``state`` is updated; the n-th row of ``changes`` (·, 2) becomes (begun, time) where the test
    fails and (nan, time) where it heals.  Returns the number of changes.
    """
    if state[LEVEL] <= 0.0:
        state[LEVEL], state[BEGUN] = 0.0, time
    state[LEVEL] = min(state[LEVEL] + gain, 2.0 * bound)
    if state[LEVEL] > bound and not state[FAILING]:
        state[FAILING] = 1.0
        changes[n] = state[BEGUN], time
        return n + 1
    if state[FAILING] and state[LEVEL] <= 0.0:
        state[FAILING] = 0.0
        changes[n] = np.nan, time
        return n + 1
    return n


@compiled
def glr(score, information, low, high, one_sided, window, path, begun):  # type: ignore[no-untyped-def]
    """Generalised likelihood ratio of a fault of size ``low`` to ``high``, of either sign unless
    ``one_sided``, that began within the last ``window`` samples: ``path`` (n) and the maximising
    onset ``begun`` (n).

    Sample k of ``score`` (n) has mean b·information and variance ``information`` (n) under a fault
    of size b.
    """
    for k in range(len(score)):
        best, first = 0.0, k
        u = i = 0.0
        for j in range(k, max(k - window, -1), -1):
            u += score[j]
            i += information[j]
            if i > 0.0:
                v = u if one_sided else abs(u)
                b = min(max(v / i, low), high)
                ratio = b * v - b * b * i / 2.0
                if ratio > best:
                    best, first = ratio, j
        path[k], begun[k] = best, first


@compiled
def peaks(path, threshold, apart):  # type: ignore[no-untyped-def]
    """Maxima of ``path`` over its excursions beyond ``threshold``; excursions less than ``apart``
    samples apart count as one."""
    maxima = np.zeros(len(path))
    n, last = 0, -apart - 1
    for k in range(len(path)):
        if path[k] > threshold:
            if k - last > apart:
                n += 1
            maxima[n - 1] = max(maxima[n - 1], path[k])
            last = k
    return maxima[:n]
