"""The fixed-interval smoother: filtered window by window, smoothed from the end of the log.

This text follows the kernel's in the generated module (see ``compute.build``); whoever does
not smooth does not compile it.

Smoothing is the modified Bryson–Frazier form of the Rauch–Tung–Striebel smoother (G. J. Bierman,
"Fixed interval smoothing with discrete measurements", Int. J. Control 18, 1973): it goes back with
the adjoint of the state in place of the state, so that it inverts no matrix, takes scalar
measurements one by one and minds no singular process noise.
"""

from math import ceil

import numpy as np

from clutchest.compute.lowered import (
    DOUBTED,
    STATES,
    THETAS,
    propagate,
    propagate_signature,
    reading,
    step,
)
from clutchest.compute.update import (
    add_product,
    correct_signature,
    doubt,
    inlined,
    inputs_between,
    reading_answer,
    step_answer,
    update,
)
from clutchest.native import compiled

# --- the generated module goes on from here ---


@compiled
def product(F, Phi, T):
    """Φ ← F Φ."""
    for i in range(STATES):
        for j in range(STATES):
            T[i, j] = 0.0
    add_product(F, Phi, T, STATES)
    for i in range(STATES):
        for j in range(STATES):
            Phi[i, j] = T[i, j]


@compiled
def multiplied(F, d, work):
    """d ← F d."""
    for i in range(STATES):
        work[i] = 0.0
        for j in range(STATES):
            work[i] += F[i, j] * d[j]
    for j in range(STATES):
        d[j] = work[j]


@inlined
def predict_window(k, span, belief, apart, events, regimes, numbers, Phi, work):
    """Carry the belief, and ``apart`` (n), over the ``span`` s from event k − 1 to event k;
    ``Phi`` (n, n) is multiplied by the transition."""
    x, w, p, g, xn = belief.x, work.w, numbers.p, numbers.g, work.xn
    ua, ub, F, Q, T, row = work.ua, work.ub, work.F, work.Q, work.T, events.row[k]
    steps = ceil(span / regimes.longest[row])
    dt = span / steps
    for i in range(steps):
        inputs_between(events.u, k, i, steps, ua, ub)
        step(x, ua, ub, dt, w, p, g, regimes.Q[row], regimes.noise, xn, F, Q, work.e)
        step_answer(x, xn, ua, ub, dt, w, p, g, work.va, work.vb, work.slope, work.G, work.eG)
        propagate_signature(belief.S, F, work.G)
        propagate(belief.P, F, Q, T)
        product(F, Phi, T)
        for j in range(STATES):
            x[j] = xn[j]
        multiplied(F, apart, xn)


@inlined
def read_window(k, belief, centre, events, numbers, window, work):
    """Take the reading of event k with all its weight, and keep what it did in ``window``."""
    x, w, p, g, sensor, u = (
        belief.x,
        work.w,
        numbers.p,
        numbers.g,
        events.sensor[k],
        events.u[k],
    )
    H, K, Hm, S = window.H[k], window.K[k], work.Hm, belief.S
    h = reading(sensor, x, u, w, p, g, H)
    for i in range(STATES):
        h += H[i] * centre.apart[i]
    reading_answer(sensor, x, u, w, p, g, H, S, Hm)
    innovation, _, variance = update(
        x, belief.P, S, h, H, Hm, events.z[k], events.R[k], work.nothing, K, work.PH, np.inf
    )
    correct_signature(S, K, Hm)
    window.variance[k] = variance
    window.innovation[k, 0] = innovation
    for c in range(THETAS):
        window.innovation[k, 1 + c] = -Hm[c]


@compiled
def filter_window(belief, events, regimes, numbers, centre, window, work):
    """Filter one window with θ at its nominal value and keep in ``window`` what
    :func:`smooth_window` needs.

    ``x``, ``P`` and ``S`` of the ``belief`` are advanced in place; the variance of a reading is
    taken as it is: an outlier's has been raised already.  With θ wrong this filter may stray far,
    so that the equations would be linearised at the wrong place: ``x`` is moved to the state that
    ``centre`` knows, and the estimate is x + ``centre.apart``, which follows the linear equations.
    """
    x, P, w, t, apart = belief.x, belief.P, work.w, events.t, centre.apart
    for k in range(len(t)):
        for j in range(len(w)):
            w[j] = regimes.W[events.row[k], j]
        doubt(P, w[len(w) - len(DOUBTED) :])
        for i in range(STATES):
            for j in range(STATES):
                window.Phi[k, i, j] = 1.0 if i == j else 0.0
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            predict_window(k, span, belief, apart, events, regimes, numbers, window.Phi[k], work)
        if events.sensor[k] >= 0:
            read_window(k, belief, centre, events, numbers, window, work)
        if centre.row[k] >= 0:
            for i in range(STATES):
                apart[i] += x[i] - centre.known[centre.row[k], i]
                x[i] = centre.known[centre.row[k], i]
        o = events.emit[k]
        if o >= 0:
            for i in range(STATES):
                window.X[o, i, 0] = x[i] + apart[i]
                for c in range(THETAS):
                    window.X[o, i, 1 + c] = belief.S[i, c]
                for j in range(STATES):
                    window.P[o, i, j] = P[i, j]


@compiled
def smooth_row(L, A, X, P, T, LT, PA):
    """X ← X − P L and P ← P − P A P, in place."""
    for i in range(STATES):
        for j in range(STATES):
            T[i, j], PA[i, j] = P[i, j], 0.0
        for c in range(THETAS + 1):
            LT[i, c] = 0.0
    add_product(T, A, PA, STATES)
    add_product(T, L, LT, THETAS + 1)
    for i in range(STATES):
        for c in range(THETAS + 1):
            X[i, c] -= LT[i, c]
    for i in range(STATES):
        for j in range(i + 1):
            total = 0.0
            for q in range(STATES):
                total += PA[i, q] * T[q, j]
            P[i, j] = T[i, j] - total
            P[j, i] = P[i, j]


@compiled
def back_over_reading(L, A, H, K, variance, innovation, AK):
    """λ ← (I − K Hᵀ)ᵀ λ − H ν/s and Λ ← (I − K Hᵀ)ᵀ Λ (I − K Hᵀ) + H Hᵀ/s."""
    weight = 1.0 / variance
    for i in range(STATES):
        total = 0.0
        for j in range(STATES):
            total += A[i, j] * K[j]
        AK[i] = total
        weight += K[i] * total
    for i in range(STATES):
        for j in range(STATES):
            A[i, j] += weight * H[i] * H[j] - H[i] * AK[j] - AK[i] * H[j]
    for c in range(THETAS + 1):
        total = innovation[c] / variance
        for i in range(STATES):
            total += K[i] * L[i, c]
        for i in range(STATES):
            L[i, c] -= H[i] * total


@compiled
def back_over_step(L, A, Phi, T, LT):
    """λ ← Φᵀ λ and Λ ← Φᵀ Λ Φ."""
    columns = THETAS + 1
    for i in range(STATES):
        for c in range(columns):
            LT[i, c] = 0.0
        for j in range(STATES):
            T[i, j] = 0.0
    for q in range(STATES):
        for i in range(STATES):
            a = Phi[q, i]
            if a != 0.0:
                for c in range(columns):
                    LT[i, c] += a * L[q, c]
                for j in range(STATES):
                    T[i, j] += a * A[q, j]
    for i in range(STATES):
        for c in range(columns):
            L[i, c] = LT[i, c]
        for j in range(i + 1):
            A[i, j] = 0.0
        for q in range(STATES):
            a = T[i, q]
            if a != 0.0:
                for j in range(i + 1):
                    A[i, j] += a * Phi[q, j]
    for i in range(STATES):
        for j in range(i):
            A[j, i] = A[i, j]


@compiled
def smooth_window(L, A, events, window, work):
    """Smooth one window that :func:`filter_window` has filled, from its last event to its first.

    The adjoint ``L`` (n, 1 + m) of state and responses and its covariance ``A`` (n, n) are
    advanced in place, so that windows can be smoothed one by one; zero at the end of the log.
    ``X`` and ``P`` of the window's rows become X − P L and P − P A P, smoothed.
    """
    t, AK, T, LT, PA = events.t, work.K, work.T, work.L, work.A
    for k in range(len(t) - 1, -1, -1):
        o = events.emit[k]
        if o >= 0:
            smooth_row(L, A, window.X[o], window.P[o], T, LT, PA)
        if events.sensor[k] >= 0:
            back_over_reading(
                L, A, window.H[k], window.K[k], window.variance[k], window.innovation[k], AK
            )
        if k > 0 and t[k] > t[k - 1]:
            back_over_step(L, A, window.Phi[k], T, LT)
