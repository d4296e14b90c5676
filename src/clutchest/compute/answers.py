"""Innovations and how they answer to every unknown number, for fits that run a log many times.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.  It
does what ``run`` does, without energies, outputs and bounds.
"""

from math import ceil

import numpy as np
from numba import njit

from clutchest.compute.kernel import inputs_between
from clutchest.compute.lowered import (
    INPUTS,
    STATES,
    THETAS,
    carry,
    dynamics,
    follow,
    gathered,
    reading,
    reading_signature,
    transition,
)

# --- the generated module goes on from here ---

LANES = 16  # columns that the processor takes at once: what is over, it takes one by one


@njit(cache=True, error_model="numpy")
def answer(
    x,
    P,
    S,
    active,
    basis,
    which,
    t,
    sensor,
    z,
    R,
    u,
    expected,
    slope,
    moves,
    calm,
    tracked,
    row,
    W,
    Qs,
    longest,
    noise,
    p,
    g,
    frozen,
    gain,
    variance,
    place,
    out_x,
    out_innovation,
    out_answer,
):
    """Filter a log and follow the signatures ``S`` (n, a) of the ``active`` (a) thetas; the rest as
    the kernel's ``run`` takes it.  A theta may come and go: c acts in proportion to the column
    ``which[c]`` of ``basis`` (K, b), fully where that is −1.

    States that are ``tracked`` (indices) are corrected by readings; of others nothing is unknown
    but θ.  Signatures are taken at the inputs ``expected`` (K, nu), not at the measured ``u``, and
    where tracked states stand at ``calm`` (K, len(tracked)), not where noisy readings put them;
    ``slope`` (K, nu) is that of the inputs on the way to each event, without their noise, and
    ``moves`` (K, nu) that by which step maps see them move: what has a play does not follow the
    noise of a reading.  Noise that stands in an innovation and in its derivative alike would make
    every number that multiplies an input seem smaller than it is.

    ``gain`` (K, len(tracked)) of each reading and its predicted ``variance`` (K) are used where
    they are ``frozen``, so that innovations are a smooth function of θ; else filled.  Filled: per
    event ``out_x`` (n) the state; ``out_innovation`` and ``out_answer`` (a), its derivative, at
    the ``place`` (K) of each reading, which is −1 where nobody asks.
    """
    n, m, a = STATES, THETAS, len(active)
    wide = (a + LANES - 1) // LANES * LANES
    F, Q, G, Hm = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, m)), np.zeros(m)
    T, H_a, acts = np.zeros((n, wide)), np.zeros(a), np.ones(a)
    S = widened(S, wide)
    xn, xc, H, PH = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    ua, ub, va, vb = np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS)
    for k in range(len(t)):
        w = W[row[k]]
        for c in range(a):
            if which[c] >= 0:
                acts[c] = basis[k, which[c]]
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            steps = ceil(span / longest[row[k]])
            dt = span / steps
            for i in range(steps):
                inputs_between(u, k, i, steps, ua, ub)
                inputs_between(expected, k, i, steps, va, vb)
                for j in range(n):
                    xc[j] = x[j]
                for b, j in enumerate(tracked):
                    xc[j] = calm[k - 1, b]
                follow(x, ua, ub, dt, w, p, g, moves[k], xn)
                transition(xc, va, vb, dt, w, p, g, moves[k], slope[k], F, G)
                if not frozen:
                    gathered(xc, va, vb, dt, w, p, g, moves[k], Qs[row[k]], noise, Q)
                    spread(P, F, Q, tracked)
                for j in range(n):
                    for c in range(a):
                        T[j, c] = G[j, active[c]] * acts[c]
                carry(F, S, T, wide)
                S, T = T, S
                x, xn = xn, x
        if sensor[k] >= 0:
            h = reading(sensor[k], x, u[k], w, p, g, H)
            reading_signature(sensor[k], x, expected[k], w, p, g, Hm)
            for c in range(a):
                H_a[c] = Hm[active[c]] * acts[c]
            for i in range(n):
                if H[i] != 0.0:
                    for c in range(a):
                        H_a[c] += H[i] * S[i, c]
            if not frozen:
                variance[k] = weigh(P, H, R[k], tracked, PH, gain[k])
            for j, i in enumerate(tracked):
                x[i] += gain[k, j] * (z[k] - h)
                if gain[k, j] != 0.0:
                    for c in range(a):
                        S[i, c] -= gain[k, j] * H_a[c]
            at = place[k]
            if at >= 0:
                out_innovation[at] = z[k] - h
                for c in range(a):
                    out_answer[at, c] = -H_a[c]
        for i in range(n):
            out_x[k, i] = x[i]


@njit(cache=True, error_model="numpy")
def widened(S, wide):
    """The same with columns of zeros up to ``wide`` of them."""
    found = np.zeros((len(S), wide))
    found[:, : S.shape[1]] = S
    return found


@njit(cache=True, error_model="numpy")
def spread(P, F, Q, tracked):
    """P ← F P Fᵀ + Q of the ``tracked`` states; of others nothing is unknown but θ."""
    moved = np.zeros((len(tracked), len(tracked)))
    for a, i in enumerate(tracked):
        for b, j in enumerate(tracked):
            moved[a, b] = Q[i, j]
            for k in tracked:
                for m in tracked:
                    moved[a, b] += F[i, k] * P[k, m] * F[j, m]
    for a, i in enumerate(tracked):
        for b, j in enumerate(tracked):
            P[i, j] = moved[a, b]


@njit(cache=True, error_model="numpy")
def weigh(P, H, R, tracked, PH, gain):
    """``gain`` of the ``tracked`` ← that of a reading; P ← what it leaves; returns the reading's
    variance."""
    predicted = R
    for i in tracked:
        PH[i] = 0.0
        for j in tracked:
            PH[i] += P[i, j] * H[j]
        predicted += H[i] * PH[i]
    for a, i in enumerate(tracked):
        gain[a] = PH[i] / predicted
        for j in tracked:
            P[i, j] -= gain[a] * PH[j]
    return predicted


@njit(cache=True, error_model="numpy")
def imply(x, slope, tracked, row, acts, W, noise, p, g, measured, u):
    """Put inputs ``u`` (K, nu), in place, to where they explain the measured slopes, as near to the
    ``measured`` ones (K, nu) as that goes: one step of Gauss and Newton from where they stand.

    ``x`` (K, n) states, ``slope`` (K, len(tracked)) the measured rates of the ``tracked`` ones;
    ``acts`` (K) where their equations hold.  What the rate lacks is shared among the inputs as
    their noise densities ``noise`` (nu) have it: the most probable share of each.
    """
    f, A, B = np.zeros(STATES), np.zeros((STATES, STATES)), np.zeros((STATES, INPUTS))
    aim = np.zeros(INPUTS)
    for k in range(len(x)):
        if not acts[k]:
            continue
        dynamics(x[k], u[k], W[row[k]], p, g, f, A, B)
        for j in range(INPUTS):
            aim[j] = measured[k, j]
        for a, i in enumerate(tracked):
            total, lacks = 0.0, slope[k, a] - f[i]
            for j in range(INPUTS):
                total += B[i, j] * B[i, j] * noise[j]
                lacks -= B[i, j] * (aim[j] - u[k, j])
            if total > 0.0:
                for j in range(INPUTS):
                    aim[j] += lacks * B[i, j] * noise[j] / total
        for j in range(INPUTS):
            u[k, j] = aim[j]
