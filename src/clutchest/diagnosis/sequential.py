"""Sequential tests, compiled: each takes what is new and carries its state to the next batch.

A *log-likelihood ratio* test adds up how much likelier each sample is with the fault than without
and begins anew whenever that sum falls below nought (Page's CUSUM).  Where the size of the fault is
open, the likeliest size and onset stand in its place (GLR).  Both need residuals that are white.
Where the law of a quantity is not known, its tail is learned from what has been seen.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# A tail: of n samples (their sum), those beyond EDGE times their mean fall off exponentially.
COUNT, TOTAL, BEYOND, EXCESS, PRIOR, GRAIN = range(6)
EDGE = 3.0
PRIOR_COUNT = 20.0  # samples that the prior mean stands for


def new_tail(prior_mean: float, grain: float = 0.0) -> np.ndarray:
    """State of a tail that has seen nothing yet; ``prior_mean`` is what a sample may well be,
    ``grain`` the distance of the values that it may take."""
    return np.array([0.0, 0.0, 0.0, 0.0, prior_mean, grain])


@njit(cache=True)
def tail_mean(tail):  # type: ignore[no-untyped-def]
    """Mean of a sample, the prior's share in it."""
    return (tail[TOTAL] + PRIOR_COUNT * tail[PRIOR]) / (tail[COUNT] + PRIOR_COUNT)


@njit(cache=True)
def tail_take(tail, x):  # type: ignore[no-untyped-def]
    """Learn from one healthy sample."""
    edge = EDGE * tail_mean(tail)
    tail[COUNT] += 1.0
    tail[TOTAL] += x
    if x > edge:
        tail[BEYOND] += 1.0
        tail[EXCESS] += x - edge + tail[GRAIN]


@njit(cache=True)
def tail_bound(tail, samples):  # type: ignore[no-untyped-def]
    """What ``samples`` healthy ones exceed once: peaks over a threshold, exponential beyond it.

    One imagined peak as large as the edge itself stands for what has not been seen yet.
    """
    edge = EDGE * tail_mean(tail)
    share = (tail[BEYOND] + 1.0) / (tail[COUNT] + PRIOR_COUNT)
    scale = (tail[EXCESS] + edge) / (tail[BEYOND] + 1.0)
    return edge + scale * max(np.log(max(samples * share, 1.0)), 0.0)


# --- likelihood ratios ------------------------------------------------------------------------


@njit(cache=True)
def cusum(gains, start, path, begun):  # type: ignore[no-untyped-def]
    """Page's sum over log-likelihood ratios ``gains`` (n) from ``start`` on, into ``path`` (n);
    ``begun`` (n) the sample with which the present climb began (−1: before the first)."""
    level, first = start, -1
    for k in range(len(gains)):
        if level <= 0.0:
            level, first = 0.0, k
        level += gains[k]
        path[k], begun[k] = level, first
    return max(level, 0.0)


LEVEL, BEGUN, FAILING = range(3)  # of a climb; whoever carries more puts it behind


@njit(cache=True)
def climb(state, gain, bound, time, changes, n):  # type: ignore[no-untyped-def]
    """Page's sum, one ``gain`` at ``time`` s at a time, at most twice its ``bound``: it fails above
    it and heals at nought.

    ``state`` is carried on; of the n ``changes`` so far (·, 2), one more is (begun, time) where it
    fails and (nan, time) where it heals.  Returns how many there are.
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


@njit(cache=True)
def glr(score, information, low, high, one_sided, window, path, begun):  # type: ignore[no-untyped-def]
    """The likeliest fault of a size from ``low`` to ``high``, either way unless ``one_sided``, that
    began within the last ``window`` samples: its log-likelihood ratio ``path`` (n) and first sample
    ``begun`` (n).

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


@njit(cache=True)
def debounced(z, threshold, count, path):  # type: ignore[no-untyped-def]
    """The plain test: how many samples on end lie beyond a fixed threshold, into ``path`` (n);
    it fails from ``count`` on."""
    on_end = 0
    for k in range(len(z)):
        on_end = on_end + 1 if abs(z[k]) > threshold else 0
        path[k] = on_end / count


@njit(cache=True)
def peaks(path, threshold, apart):  # type: ignore[no-untyped-def]
    """How high ``path`` rises each time that it exceeds ``threshold`` anew, at least ``apart``
    samples after the last time that it did."""
    found = np.zeros(len(path))
    n, last = 0, -apart - 1
    for k in range(len(path)):
        if path[k] > threshold:
            if k - last > apart:
                n += 1
            found[n - 1] = max(found[n - 1], path[k])
            last = k
    return found[:n]
