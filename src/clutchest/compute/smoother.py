"""The smoother: what the filter did, window by window, and a second look at it from the end.

This text stands behind the kernel's in the generated module (see ``compute.build``); whoever does
not smooth does not compile it.

Smoothing is the modified Bryson–Frazier form of the Rauch–Tung–Striebel smoother (G. J. Bierman,
"Fixed interval smoothing with discrete measurements", Int. J. Control 18, 1973): it goes back with
the adjoint of the state in place of the state, so that it inverts no matrix, takes scalar
measurements one by one and minds no singular process noise.
"""

from math import ceil

import numpy as np
from numba import njit

from clutchest.compute.kernel import (
    add_product,
    correct_signature,
    doubt,
    inputs_between,
    propagate,
    propagate_signature,
    reading_answer,
    step_answer,
    update,
)
from clutchest.compute.lowered import (
    DOUBTED,
    INPUTS,
    STATES,
    THETAS,
    reading,
    step,
)

# --- the generated module goes on from here ---


@njit(cache=True, error_model="numpy")
def product(F, Phi, T):
    """Φ ← F Φ."""
    for i in range(STATES):
        for j in range(STATES):
            T[i, j] = 0.0
    add_product(F, Phi, T, STATES)
    for i in range(STATES):
        for j in range(STATES):
            Phi[i, j] = T[i, j]


@njit(cache=True, error_model="numpy")
def remember(
    x,
    d,
    P,
    S,
    t,
    sensor,
    z,
    R,
    u,
    row,
    W,
    Qs,
    longest,
    noise,
    p,
    g,
    known,
    centre,
    emit,
    Phi,
    H,
    K,
    used,
    told,
    out_X,
    out_P,
):
    """Filter one window with θ at its nominal value and keep what ``look_back`` needs.

    ``x`` (n), ``P`` (n, n) and ``S`` (n, m) as the kernel's ``run`` takes and advances them, and
    so the events; ``R`` is taken as it is: an outlier's has been raised already.  With θ wrong
    this filter may stray far, so that the equations are linearised elsewhere: ``x`` is moved to
    the row ``centre`` (K; −1: none) of the states ``known`` (r, n), and the estimate is x + ``d``
    (n), where ``d`` follows the linear equations.

    Filled per event: ``Phi`` (n, n) the transition from the event before, ``H`` (n), the gain
    ``K`` (n), the innovation's variance ``used`` and ``told`` (1 + m), innovation and its response
    to each θ; per emitted row ``out_X`` (n, 1 + m), state and its response, and ``out_P`` (n, n).
    """
    n, m = STATES, THETAS
    F, Q, T = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    G, Tm, eG = np.zeros((n, m)), np.zeros((n, m)), np.zeros(m)
    xn, e, PH, Hm, nothing = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(m), np.zeros(0)
    ua, ub, va, vb = np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS)
    slope = np.zeros(INPUTS)
    for k in range(len(t)):
        w = W[row[k]].copy()
        doubt(P, w[len(w) - len(DOUBTED) :])
        for i in range(n):
            for j in range(n):
                Phi[k, i, j] = 1.0 if i == j else 0.0
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            steps = ceil(span / longest[row[k]])
            dt = span / steps
            for i in range(steps):
                inputs_between(u, k, i, steps, ua, ub)
                step(x, ua, ub, dt, w, p, g, Qs[row[k]], noise, xn, F, Q, e)
                step_answer(x, xn, ua, ub, dt, w, p, g, va, vb, slope, G, eG)
                propagate_signature(S, F, G, Tm)
                propagate(P, F, Q, T)
                product(F, Phi[k], T)
                for j in range(n):
                    x[j] = xn[j]
                for i in range(n):
                    xn[i] = 0.0
                    for j in range(n):
                        xn[i] += F[i, j] * d[j]
                for j in range(n):
                    d[j] = xn[j]
        if sensor[k] >= 0:
            h = reading(sensor[k], x, u[k], w, p, g, H[k])
            for i in range(n):
                h += H[k, i] * d[i]
            reading_answer(sensor[k], x, u[k], w, p, g, H[k], S, Hm)
            told[k, 0], _, used[k] = update(
                x, P, S, h, H[k], Hm, z[k], R[k], nothing, K[k], PH, np.inf
            )
            correct_signature(S, K[k], Hm)
            for c in range(m):
                told[k, 1 + c] = -Hm[c]
        if centre[k] >= 0:
            for i in range(n):
                d[i] += x[i] - known[centre[k], i]
                x[i] = known[centre[k], i]
        o = emit[k]
        if o >= 0:
            for i in range(n):
                out_X[o, i, 0] = x[i] + d[i]
                for c in range(m):
                    out_X[o, i, 1 + c] = S[i, c]
                for j in range(n):
                    out_P[o, i, j] = P[i, j]


@njit(cache=True, error_model="numpy")
def look_back(L, A, t, sensor, emit, Phi, H, K, used, told, X, P):
    """Smooth one window that ``remember`` has filled, from its last event to its first.

    The adjoint ``L`` (n, 1 + m) of state and responses and its covariance ``A`` (n, n) are
    advanced in place, so that windows can be smoothed one by one; zero at the end of the log.
    ``X`` and ``P`` of the emitted rows become X − P L and P − P A P, smoothed.
    """
    n, columns = STATES, THETAS + 1
    AK, T, LT, PA = np.zeros(n), np.zeros((n, n)), np.zeros((n, columns)), np.zeros((n, n))
    for k in range(len(t) - 1, -1, -1):
        o = emit[k]
        if o >= 0:
            for i in range(n):
                for j in range(n):
                    T[i, j], PA[i, j] = P[o, i, j], 0.0
                for c in range(columns):
                    LT[i, c] = 0.0
            add_product(T, A, PA, STATES)
            add_product(T, L, LT, THETAS + 1)
            for i in range(n):
                for c in range(columns):
                    X[o, i, c] -= LT[i, c]
            for i in range(n):
                for j in range(i + 1):
                    total = 0.0
                    for q in range(n):
                        total += PA[i, q] * T[q, j]
                    P[o, i, j] = T[i, j] - total
                    P[o, j, i] = P[o, i, j]
        if sensor[k] >= 0:
            # λ ← (I − K Hᵀ)ᵀ λ − H ν/s and Λ ← (I − K Hᵀ)ᵀ Λ (I − K Hᵀ) + H Hᵀ/s
            weight = 1.0 / used[k]
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += A[i, j] * K[k, j]
                AK[i] = total
                weight += K[k, i] * total
            for i in range(n):
                for j in range(n):
                    A[i, j] += weight * H[k, i] * H[k, j] - H[k, i] * AK[j] - AK[i] * H[k, j]
            for c in range(columns):
                total = told[k, c] / used[k]
                for i in range(n):
                    total += K[k, i] * L[i, c]
                for i in range(n):
                    L[i, c] -= H[k, i] * total
        if k > 0 and t[k] > t[k - 1]:
            # λ ← Φᵀ λ and Λ ← Φᵀ Λ Φ
            for i in range(n):
                for c in range(columns):
                    LT[i, c] = 0.0
                for j in range(n):
                    T[i, j] = 0.0
            for q in range(n):
                for i in range(n):
                    a = Phi[k, q, i]
                    if a != 0.0:
                        for c in range(columns):
                            LT[i, c] += a * L[q, c]
                        for j in range(n):
                            T[i, j] += a * A[q, j]
            for i in range(n):
                for c in range(columns):
                    L[i, c] = LT[i, c]
                for j in range(i + 1):
                    A[i, j] = 0.0
                for q in range(n):
                    a = T[i, q]
                    if a != 0.0:
                        for j in range(i + 1):
                            A[i, j] += a * Phi[k, q, j]
            for i in range(n):
                for j in range(i):
                    A[j, i] = A[i, j]
