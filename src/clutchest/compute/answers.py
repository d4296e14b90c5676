"""Innovations and how they answer to every unknown number, for fits that run a log many times.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.  It
does what ``run`` does, without energies, outputs and bounds.
"""

from math import ceil

import numpy as np
from numba import njit

from clutchest.compute.kernel import add_product, inputs_between, propagate, update
from clutchest.compute.lowered import (
    INPUTS,
    STATES,
    THETAS,
    dynamics,
    reading,
    reading_signature,
    step,
    step_signature,
)

# --- the generated module goes on from here ---


@njit(cache=True, error_model="numpy")
def answer(
    x, P, S, active, basis, which, t, sensor, z, R, u, expected, slope, calm, tracked, row, W, Qs,
    longest, noise, p, g, out_x, out_innovation, out_answer,
):  # fmt: skip
    """Filter a log and follow the signatures ``S`` (n, a) of the ``active`` (a) thetas; the rest as
    the kernel's ``run`` takes it.  A theta may come and go: c acts in proportion to the column
    ``which[c]`` of ``basis`` (K, b), fully where that is −1.

    Signatures are taken at the inputs ``expected`` (K, nu), not at the measured ``u``, and where
    states that are ``tracked`` (n) stand at ``calm`` (K, n), not where noisy readings put them;
    ``slope`` (K, nu) is that of the inputs on the way to each event, without their noise.  Noise
    that stands in an innovation and in its derivative alike would make every number that
    multiplies an input seem smaller than it is.  Filled per event: ``out_x`` (n) the state,
    ``out_innovation`` (innovation, predicted variance) and ``out_answer`` (a) its derivative.
    """
    n, m = STATES, THETAS
    F, Q, T = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    G, eG, a = np.zeros((n, m)), np.zeros(m), len(active)
    T_a, H_a, acts = np.zeros((n, a)), np.zeros(a), np.ones(a)
    xn, e, K, PH, H, Hm = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n),
                           np.zeros(m))  # fmt: skip
    xe, xc = np.zeros(n), np.zeros(n)
    ua, ub, va, vb = np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS)
    nothing = np.zeros(0)
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
                step(x, ua, ub, dt, w, p, g, Qs[row[k]], noise, xn, F, Q, e)
                propagate(P, F, Q, T)
                for j in range(n):
                    xc[j] = calm[k - 1, j] if tracked[j] else x[j]
                step(xc, va, vb, dt, w, p, g, Qs[row[k]], noise, xe, F, Q, e)
                step_signature(xc, va, vb, dt, w, p, g, slope[k], G, eG)
                for j in range(n):
                    for c in range(a):
                        T_a[j, c] = G[j, active[c]] * acts[c]
                add_product(F, S, T_a, a)
                for j in range(n):
                    for c in range(a):
                        S[j, c] = T_a[j, c]
                for j in range(n):
                    x[j] = xn[j]
        if sensor[k] >= 0:
            h = reading(sensor[k], x, u[k], w, p, g, H)
            reading_signature(sensor[k], x, expected[k], w, p, g, Hm)
            for c in range(a):
                H_a[c] = Hm[active[c]] * acts[c]
            for i in range(n):
                if H[i] != 0.0:
                    for c in range(a):
                        H_a[c] += H[i] * S[i, c]
            innovation, predicted, _ = update(x, P, S, h, H, Hm, z[k], R[k], nothing, K, PH, np.inf)
            for i in range(n):
                if K[i] != 0.0:
                    for c in range(a):
                        S[i, c] -= K[i] * H_a[c]
            out_innovation[k, 0] = innovation
            out_innovation[k, 1] = predicted
            for c in range(a):
                out_answer[k, c] = -H_a[c]
        for i in range(n):
            out_x[k, i] = x[i]


@njit(cache=True, error_model="numpy")
def imply(x, slope, tracked, row, acts, W, noise, p, g, u):
    """Move inputs ``u`` (K, nu), in place, to where they explain the measured slopes.

    ``x`` (K, n) states, ``slope`` (K, n) the measured rates of the ``tracked`` ones (indices);
    ``acts`` (K) where their equations hold.  What the rate lacks is shared among the inputs as
    their noise densities ``noise`` (nu) have it: the most probable share of each.
    """
    f, A, B = np.zeros(STATES), np.zeros((STATES, STATES)), np.zeros((STATES, INPUTS))
    for k in range(len(x)):
        if not acts[k]:
            continue
        dynamics(x[k], u[k], W[row[k]], p, g, f, A, B)
        for i in tracked:
            total = 0.0
            for j in range(INPUTS):
                total += B[i, j] * B[i, j] * noise[j]
            if total > 0.0:
                for j in range(INPUTS):
                    u[k, j] += (slope[k, i] - f[i]) * B[i, j] * noise[j] / total
