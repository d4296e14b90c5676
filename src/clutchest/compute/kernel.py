"""The filter over a whole log: compiled, fixed, with no model in it.

This text and the model's lowered functions make one generated module (see ``compute.build``); the
imports below stand for those functions here, so that this file can be read and checked by itself.
Matrices are small and their sizes constants of the generated module: plain loops, which the
compiler unrolls, are the fastest form.
"""

from math import ceil, log, pi

import numpy as np
from numba import njit

from clutchest.compute.lowered import (
    HAS_MAP,
    INPUTS,
    OUTPUTS,
    STATES,
    THETAS,
    dynamics,
    dynamics_signature,
    outputs,
    outputs_signature,
    reading,
    reading_signature,
    step_map,
)

# --- the generated module goes on from here ---


@njit(cache=True, error_model="numpy")
def _times(A, B, out):
    """out = A B, skipping the zeros of A."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            out[i, j] = 0.0
        for k in range(A.shape[1]):
            a = A[i, k]
            if a != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += a * B[k, j]


@njit(cache=True, error_model="numpy")
def predict_state(x, dt, u0, u1, w, p, g, F, Q, q, noise, work):
    """One step of Heun's rule with its exact derivative.

    ``x`` (n) is advanced in place by ``dt`` s with inputs running straight from ``u0`` to ``u1``;
    ``F`` (n, n) becomes dx'/dx and ``Q`` (n, n) the noise of process (``q`` (n), variance per s)
    and inputs (``noise`` (nu), variance per s).  ``work`` keeps what the signatures need.
    Returns the slip power at both ends.
    """
    f0, f1, x1, A0, A1, B0, B1, e0, e1, J0, J1, Jm0, Jm1, T, M, mapped = work
    power0 = dynamics(x, u0, w, p, g, f0, A0, B0, e0)
    for i in range(STATES):
        x1[i] = x[i] + dt * f0[i]
        for j in range(STATES):
            T[i, j] = dt * A0[i, j]
        T[i, i] += 1.0
    if HAS_MAP:
        step_map(x1, u0, u1, p, g, mapped, J0, Jm0)
        x1[:] = mapped
        _times(J0, T, M)
        T[:, :] = M
    power1 = dynamics(x1, u1, w, p, g, f1, A1, B1, e1)
    _times(A1, T, F)
    for i in range(STATES):
        x[i] += 0.5 * dt * (f0[i] + f1[i])
        for j in range(STATES):
            F[i, j] = 0.5 * dt * (A0[i, j] + F[i, j])
        F[i, i] += 1.0
    if HAS_MAP:
        step_map(x, u0, u1, p, g, mapped, J1, Jm1)
        x[:] = mapped
        _times(J1, F, M)
        F[:, :] = M
    for i in range(STATES):
        for j in range(i + 1):
            total = 0.0
            for k in range(INPUTS):
                total += noise[k] * (B0[i, k] * B0[j, k] + B1[i, k] * B1[j, k])
            Q[i, j] = 0.5 * dt * total
            Q[j, i] = Q[i, j]
        Q[i, i] += dt * q[i]
    return power0, power1


@njit(cache=True, error_model="numpy")
def _predict_covariance(P, F, Q, T):
    """P ← F P Fᵀ + Q, kept exactly symmetric."""
    _times(F, P, T)
    for i in range(STATES):
        for j in range(i + 1):
            total = Q[i, j]
            for k in range(STATES):
                total += T[i, k] * F[j, k]
            P[i, j] = total
            P[j, i] = total


@njit(cache=True, error_model="numpy")
def _predict_signature(S, x0, x1, dt, u0, u1, w, p, g, sE, work, own):
    """S ← dx'/dθ: the derivative of the same step with respect to every θ; sE that of the energy."""
    A0, A1, e0, e1 = work[3], work[4], work[7], work[8]
    J0, J1, Jm0, Jm1 = work[9], work[10], work[11], work[12]
    du, G, R0, R1, S1, T, eG = own
    for j in range(INPUTS):
        du[j] = (u1[j] - u0[j]) / dt
    dynamics_signature(x0, u0, du, w, p, g, G, eG)
    _times(A0, S, R0)
    for k in range(THETAS):
        rate = eG[k]
        for i in range(STATES):
            R0[i, k] += G[i, k]
            S1[i, k] = S[i, k] + dt * R0[i, k]
            rate += e0[i] * S[i, k]
        sE[k] += 0.5 * dt * rate
    if HAS_MAP:
        _times(J0, S1, T)
        S1[:, :] = T + Jm0
    dynamics_signature(x1, u1, du, w, p, g, G, eG)
    _times(A1, S1, R1)
    for k in range(THETAS):
        rate = eG[k]
        for i in range(STATES):
            S[i, k] += 0.5 * dt * (R0[i, k] + R1[i, k] + G[i, k])
            rate += e1[i] * S1[i, k]
        sE[k] += 0.5 * dt * rate
    if HAS_MAP:
        _times(J1, S, T)
        S[:, :] = T + Jm1


@njit(cache=True, error_model="numpy")
def update(x, P, h, H, z, R, K, PH, limit):
    """One scalar measurement, Joseph's form; P stays exactly symmetric.

    Where the innovation is beyond ``limit`` standard deviations the measurement counts for less:
    its variance is raised until the innovation is at the limit.  Returns innovation, its variance
    as predicted, and the variance used.
    """
    S = R
    for i in range(STATES):
        total = 0.0
        for j in range(STATES):
            total += P[i, j] * H[j]
        PH[i] = total
    for i in range(STATES):
        S += H[i] * PH[i]
    innovation = z - h
    used = S
    if innovation * innovation > limit * limit * S:
        used = innovation * innovation / (limit * limit)
    R_used = R + (used - S)
    for i in range(STATES):
        K[i] = PH[i] / used
        x[i] += K[i] * innovation
    # (I − K Hᵀ) P (I − K Hᵀ)ᵀ + K R Kᵀ, one factor after the other
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] -= K[i] * PH[j]
    for i in range(STATES):
        total = 0.0
        for j in range(STATES):
            total += P[i, j] * H[j]
        PH[i] = total
    for i in range(STATES):
        for j in range(i + 1):
            value = P[i, j] - PH[i] * K[j] + R_used * K[i] * K[j]
            P[i, j] = value
            P[j, i] = value
    return innovation, S, used


@njit(cache=True, error_model="numpy")
def run(
    x, P, S, E, cE, sE, spread, t, sensor, z, R, u, row, W, Qs, longest, noise, variance, p, g, limit,
    emit, with_signature, frozen, gains, out_x, out_P, out_total, out_y, out_energy,
    out_innovation, out_signature,
):  # fmt: skip
    """Filter a whole log.

    State ``x`` (n), covariance ``P`` (n, n) and signatures ``S`` (n, m) at ``t[0]`` are advanced
    in place, so that a log can be run piece by piece; so are ``E`` (2), the slip energy and its
    variance, with its covariance ``cE`` (n) with x and its own signature ``sE`` (m).  Events k = 0…K−1 at times ``t``: ``sensor`` index or −1, measurement ``z`` with
    variance ``R``; ``u`` (K, nu) inputs, straight between events; ``row`` (K) the regime of the
    interval that ends at k: a row of the flags ``W``, process noise ``Qs`` and step ``longest``.
    ``noise`` (nu) input noise density, ``variance`` (nu) of one input sample, ``spread`` (m)
    standard deviation of every θ.  ``gains`` (K, n): with ``frozen`` they are used, else stored
    where it has rows.  ``emit`` (K): output row, −1 for none.  Outputs per emitted row: ``out_x``
    (n), ``out_P`` (n, n), ``out_total`` (n) variance with the spreads, ``out_y`` (outputs, value
    and variance), ``out_energy`` (energy, variance, own part of it; then its response to each θ);
    per event ``out_innovation`` (innovation, predicted and used variance) and, where it has rows,
    ``out_signature`` (m).  Returns the log-likelihood.
    """
    n, m = STATES, THETAS
    work = (
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros((n, n)),
        np.zeros((n, INPUTS)), np.zeros((n, INPUTS)), np.zeros(n), np.zeros(n),
        np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, m)), np.zeros((n, m)),
        np.zeros((n, n)), np.zeros((n, n)), np.zeros(n),
    )  # fmt: skip
    own = (np.zeros(INPUTS), np.zeros((n, m)), np.zeros((n, m)), np.zeros((n, m)),
           np.zeros((n, m)), np.zeros((n, m)), np.zeros(m))  # fmt: skip
    F, Q, T = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    x0, ua, ub, K, PH = np.zeros(n), np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(n), np.zeros(n)
    H, Hm = np.zeros(n), np.zeros(m)
    y, Y, Yu, Ym = (np.zeros(OUTPUTS), np.zeros((OUTPUTS, n)), np.zeros((OUTPUTS, INPUTS)),
                    np.zeros((OUTPUTS, m)))  # fmt: skip
    log_likelihood = 0.0

    for k in range(len(t)):
        w = W[row[k]]
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            steps = ceil(span / longest[row[k]])
            dt = span / steps
            for step in range(steps):
                for j in range(INPUTS):
                    slope = (u[k, j] - u[k - 1, j]) / steps
                    ua[j] = u[k - 1, j] + step * slope
                    ub[j] = u[k - 1, j] + (step + 1) * slope
                x0[:] = x
                a, b = predict_state(x, dt, ua, ub, w, p, g, F, Q, Qs[row[k]], noise, work)
                if with_signature:
                    _predict_signature(S, x0, work[2], dt, ua, ub, w, p, g, sE, work, own)
                # the energy is a state that no measurement corrects
                E[0] += 0.5 * dt * (a + b)
                e0 = work[7]
                for i in range(n):
                    drift = 0.0
                    for j in range(n):
                        drift += P[i, j] * e0[j]
                    E[1] += dt * e0[i] * (2.0 * cE[i] + dt * drift)
                    PH[i] = cE[i] + dt * drift
                for i in range(n):
                    cE[i] = 0.0
                    for j in range(n):
                        cE[i] += F[i, j] * PH[j]
                _predict_covariance(P, F, Q, T)

        if sensor[k] >= 0:
            h = reading(sensor[k], x, u[k], w, p, g, H)
            if with_signature:
                reading_signature(sensor[k], x, u[k], w, p, g, Hm)
                for c in range(m):
                    for i in range(n):
                        Hm[c] += H[i] * S[i, c]
            if frozen:
                innovation = z[k] - h
                for i in range(n):
                    K[i] = gains[k, i]
                    x[i] += K[i] * innovation
                predicted, used = 1.0, 1.0
            else:
                innovation, predicted, used = update(x, P, h, H, z[k], R[k], K, PH, limit)
                correlated = 0.0
                for i in range(n):
                    correlated += H[i] * cE[i]
                for i in range(n):
                    cE[i] -= K[i] * correlated
                log_likelihood -= 0.5 * (log(2.0 * pi * used) + innovation * innovation / used)
                if len(gains) > 0:
                    gains[k] = K
            if with_signature:
                for i in range(n):
                    for c in range(m):
                        S[i, c] -= K[i] * Hm[c]
                if len(out_signature) > 0:
                    for c in range(m):
                        out_signature[k, c] = -Hm[c]
            out_innovation[k, 0] = innovation
            out_innovation[k, 1] = predicted
            out_innovation[k, 2] = used

        o = emit[k]
        if o >= 0:
            outputs(x, u[k], w, p, g, y, Y, Yu)
            outputs_signature(x, u[k], w, p, g, Ym)
            out_x[o] = x
            out_P[o] = P
            for i in range(n):
                out_total[o, i] = P[i, i]
                for c in range(m):
                    out_total[o, i] += (S[i, c] * spread[c]) ** 2
            for i in range(OUTPUTS):
                total = 0.0
                for a_ in range(n):
                    for b_ in range(n):
                        total += Y[i, a_] * P[a_, b_] * Y[i, b_]
                for j in range(INPUTS):
                    total += Yu[i, j] * Yu[i, j] * variance[j]
                for c in range(m):
                    response = Ym[i, c]
                    for a_ in range(n):
                        response += Y[i, a_] * S[a_, c]
                    total += (response * spread[c]) ** 2
                out_y[o, i, 0] = y[i]
                out_y[o, i, 1] = total
            out_energy[o, 0] = E[0]
            out_energy[o, 1] = E[1]
            for c in range(m):
                out_energy[o, 1] += (sE[c] * spread[c]) ** 2
                out_energy[o, 3 + c] = sE[c]
            out_energy[o, 2] = E[1]
    return log_likelihood
