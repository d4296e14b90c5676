"""The filter over a whole log: compiled, fixed, with no model in it.

This text and the model's lowered functions make one generated module (see ``compute.build``); the
imports below stand for those functions here, so that this file can be read and checked by itself.
Matrices are small and their sizes constants of the generated module: plain loops, which the
compiler unrolls, are the fastest form.
"""

from math import ceil, log, pi, sqrt

import numpy as np
from numba import njit

from clutchest.compute.lowered import (
    DOUBTED,
    INPUTS,
    OUTPUTS,
    SCALES,
    STATES,
    THETAS,
    implied,
    outputs,
    outputs_signature,
    reading,
    reading_signature,
    step,
    step_signature,
)

# --- the generated module goes on from here ---

# A covariance with a state that is measured again and again, and fed by nothing, fades by a factor
# at each reading.  Far below 1e-280 a processor takes a hundred times as long over every number;
# what is added and taken away again makes it nought before.
TINY = 1e-280


@njit(cache=True, error_model="numpy")
def add_product(F, X, T, columns):
    """T ← T + F X, the first ``columns`` of them; the zeros of F cost nothing."""
    for i in range(STATES):
        for k in range(STATES):
            a = F[i, k]
            if a != 0.0:
                for j in range(columns):
                    T[i, j] += a * X[k, j]


@njit(cache=True, error_model="numpy")
def propagate(P, F, Q, T):
    """P ← F P Fᵀ + Q, exactly symmetric; the zeros of F cost nothing."""
    for i in range(STATES):
        for j in range(STATES):
            T[i, j] = 0.0
    add_product(F, P, T, STATES)
    for i in range(STATES):
        for j in range(i + 1):
            P[i, j] = Q[i, j]
    for j in range(STATES):
        for k in range(STATES):
            a = F[j, k]
            if a != 0.0:
                for i in range(j, STATES):
                    P[i, j] += T[i, k] * a
    for i in range(STATES):
        for j in range(i):
            P[j, i] = P[i, j]


@njit(cache=True, error_model="numpy")
def propagate_signature(S, F, G, T):
    """S ← F S + G: how the state answers to every θ."""
    for i in range(STATES):
        for c in range(THETAS):
            T[i, c] = G[i, c]
    add_product(F, S, T, THETAS)
    for i in range(STATES):
        for c in range(THETAS):
            S[i, c] = T[i, c]


@njit(cache=True, error_model="numpy")
def slopes(va, vb, dt, slope):
    """slope (nu) of inputs that go from ``va`` to ``vb`` in ``dt`` s."""
    for j in range(INPUTS):
        slope[j] = (vb[j] - va[j]) / dt


@njit(cache=True, error_model="numpy")
def step_answer(x, xn, ua, ub, dt, w, p, g, va, vb, slope, G, eG):
    """G (n, m) and eG (m): how a step from ``x`` to ``xn`` and its energy answer to every θ.

    For gains that weigh θ, so taken at the inputs that other measurements imply.  Noise of an
    input that stands in an innovation and in its derivative alike would pass for information: a
    number that multiplies the input (an inertia) would seem smaller than it is, and the gain
    would follow.
    """
    implied(x, ua, w, p, g, va)
    implied(xn, ub, w, p, g, vb)
    slopes(va, vb, dt, slope)
    step_signature(x, va, vb, dt, w, p, g, slope, G, eG)


@njit(cache=True, error_model="numpy")
def propagate_energy(E, cE, P, F, e, work):
    """The energy as a state that no measurement corrects: its variance and covariance with x."""
    for i in range(STATES):
        total = cE[i]
        for j in range(STATES):
            total += P[i, j] * e[j]
        work[i] = total  # cov(E', x) before the step
    for i in range(STATES):
        E[1] += e[i] * (cE[i] + work[i])
    for i in range(STATES):
        total = 0.0
        for j in range(STATES):
            total += F[i, j] * work[j]
        cE[i] = total


@njit(cache=True, error_model="numpy")
def inputs_between(u, k, i, steps, ua, ub):
    """Inputs at both ends of the i-th of ``steps`` equal steps from event k − 1 to event k."""
    share = 1.0 / steps
    for j in range(INPUTS):
        slope = (u[k, j] - u[k - 1, j]) * share
        ua[j] = u[k - 1, j] + i * slope
        ub[j] = u[k - 1, j] + (i + 1) * slope


@njit(cache=True, error_model="numpy")
def doubt(P, held):
    """held ← the standard deviations that equations may use until the next reading."""
    for i in range(len(DOUBTED)):
        held[i] = sqrt(max(P[DOUBTED[i], DOUBTED[i]], 0.0))


@njit(cache=True, error_model="numpy")
def reading_answer(sensor, x, u, w, p, g, H, S, Hm):
    """Hm (m) ← how a sensor's reading answers to every θ, by itself and through the state."""
    reading_signature(sensor, x, u, w, p, g, Hm)
    for i in range(STATES):
        if H[i] != 0.0:
            for c in range(THETAS):
                Hm[c] += H[i] * S[i, c]


@njit(cache=True, error_model="numpy")
def correct_signature(S, K, Hm):
    """S ← S − K Hmᵀ: what a measurement leaves of the state's answer to every θ."""
    for i in range(STATES):
        for c in range(THETAS):
            S[i, c] = S[i, c] - K[i] * Hm[c] + TINY - TINY


@njit(cache=True, error_model="numpy")
def times(P, H, PH):
    """PH ← P H; a sensor sees few states, and the others cost nothing."""
    for i in range(STATES):
        PH[i] = 0.0
    for j in range(STATES):
        h = H[j]
        if h != 0.0:
            for i in range(STATES):
                PH[i] += P[i, j] * h


@njit(cache=True, error_model="numpy")
def update(x, P, S, h, H, Hm, z, R, considered, K, PH, limit):
    """One scalar measurement, Joseph's form; P stays exactly symmetric.

    The gain weighs what unknown parameters do to state and reading as well (Schmidt's consider
    filter): ``S`` (n, m) and ``Hm`` (m) are the responses to them, ``considered`` (m or 0) their
    variances.

    Where the innovation is beyond ``limit`` standard deviations the measurement counts for less:
    its variance is raised until the innovation is at the limit.  Returns innovation, its variance
    as predicted, and the variance used.
    """
    predicted = R
    times(P, H, PH)
    for i in range(STATES):
        predicted += H[i] * PH[i]
        K[i] = PH[i]
    for c in range(len(considered)):
        part = considered[c] * Hm[c]
        predicted += part * Hm[c]
        for i in range(STATES):
            K[i] += S[i, c] * part
    innovation = z - h
    used = predicted
    if innovation * innovation > limit * limit * predicted:
        used = innovation * innovation / (limit * limit)
    R_used = R + (used - predicted)
    for i in range(STATES):
        K[i] /= used
        x[i] += K[i] * innovation
    # (I − K Hᵀ) P (I − K Hᵀ)ᵀ + K R Kᵀ, one factor after the other
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] -= K[i] * PH[j]
    times(P, H, PH)
    for i in range(STATES):
        for j in range(i + 1):
            value = P[i, j] - PH[i] * K[j] + R_used * K[i] * K[j] + TINY - TINY
            P[i, j] = value
            P[j, i] = value
    return innovation, predicted, used


@njit(cache=True, error_model="numpy")
def in_proportion(x, P, cE, K, innovation):
    """What is known of factors, in proportion to where the last update has moved them.

    A reading of a product does not tell its factors apart.  Linearised at one value of a factor
    and, once that has moved the factor, at another, two readings would: what both leave open is
    not the same direction.  It is where uncertainties keep their shares of the factors.
    """
    for c in range(len(SCALES)):
        i = SCALES[c]
        before = x[i] - K[i] * innovation
        ratio = x[i] / before if before > 0.0 < x[i] else 1.0
        for j in range(STATES):
            P[i, j] *= ratio
        for j in range(STATES):
            P[j, i] *= ratio
        cE[i] *= ratio


@njit(cache=True, error_model="numpy", nogil=True)
def run(
    x,
    P,
    S,
    E,
    cE,
    sE,
    held,
    gained,
    spread,
    considered,
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
    variance,
    p,
    g,
    limit,
    emit,
    with_signature,
    frozen,
    gains,
    out_x,
    out_P,
    out_total,
    out_y,
    out_energy,
    out_gained,
    out_innovation,
    out_signature,
):
    """Filter a whole log.

    Advanced in place, so that a log can be run piece by piece: state ``x`` (n), covariance ``P``
    (n, n) and signatures ``S`` (n, m) at ``t[0]``; ``E`` (2), the slip energy and its variance,
    with its covariance ``cE`` (n) with x and its own signature ``sE`` (m); ``held`` (n), whose
    first ones are the standard deviations that equations use, as the last reading left them
    (negative: as in P); ``gained`` (2, n), the information in nats that measurements gave of each
    state up to the last output (½ log of its variance before over that after, summed up), and the
    variance they took away since.

    Events k = 0…K−1 at times ``t``: ``sensor`` index or −1, measurement ``z`` with variance
    ``R``; ``u`` (K, nu) inputs, straight between events; ``row`` (K) the regime of the interval
    that ends at k: a row of the flags ``W``, process noise ``Qs`` and step ``longest``; ``emit``
    (K) output row, −1 for none.  ``noise`` (nu) input noise density, ``variance`` (nu) of one
    input sample, ``spread`` (m) standard deviation of every θ, ``considered`` the variances that
    gains weigh: (m), or (0) where they weigh none.  ``gains`` (K, n + doubted), behind each
    the standard deviations that it leaves: with ``frozen`` they are used, else stored where it has
    rows.

    Outputs per emitted row: ``out_x`` (n), ``out_P`` (n, n), ``out_total`` (n) variance with the
    spreads (where signatures are followed), ``out_y`` (outputs, value and variance),
    ``out_energy`` (energy, variance, own part of it; then its response to each θ), ``out_gained``
    (n).  Per event: ``out_innovation`` (innovation, predicted and used variance) and, where it has
    rows, ``out_signature`` (m).  Returns the log-likelihood.
    """
    n, m = STATES, THETAS
    F, Q, T = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    G, Tm, eG = np.zeros((n, m)), np.zeros((n, m)), np.zeros(m)
    xn, e, K, PH, H, Hm = (
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(m),
    )
    ua, ub, va, vb = np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS), np.zeros(INPUTS)
    slope, w = np.zeros(INPUTS), np.zeros(W.shape[1])
    if len(DOUBTED) > 0 and held[0] < 0.0:
        doubt(P, held)
    y, Y, Yu, Ym = (
        np.zeros(OUTPUTS),
        np.zeros((OUTPUTS, n)),
        np.zeros((OUTPUTS, INPUTS)),
        np.zeros((OUTPUTS, m)),
    )
    log_likelihood = 0.0
    followed = m if with_signature else 0

    for k in range(len(t)):
        for j in range(len(w)):
            w[j] = W[row[k], j]
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            steps = ceil(span / longest[row[k]])
            dt = span / steps
            for j in range(len(DOUBTED)):
                w[W.shape[1] - len(DOUBTED) + j] = held[j]
            for i in range(steps):
                inputs_between(u, k, i, steps, ua, ub)
                E[0] += step(x, ua, ub, dt, w, p, g, Qs[row[k]], noise, xn, F, Q, e)
                if with_signature:
                    if len(considered) > 0:
                        step_answer(x, xn, ua, ub, dt, w, p, g, va, vb, slope, G, eG)
                    else:
                        slopes(ua, ub, dt, slope)
                        step_signature(x, ua, ub, dt, w, p, g, slope, G, eG)
                    for c in range(m):
                        sE[c] += eG[c]
                        for j in range(n):
                            sE[c] += e[j] * S[j, c]
                    propagate_signature(S, F, G, Tm)
                propagate_energy(E, cE, P, F, e, PH)
                propagate(P, F, Q, T)
                for j in range(n):
                    x[j] = xn[j]

        if sensor[k] >= 0:
            h = reading(sensor[k], x, u[k], w, p, g, H)
            if with_signature:
                reading_answer(sensor[k], x, u[k], w, p, g, H, S, Hm)
            if frozen:
                innovation = z[k] - h
                for i in range(n):
                    K[i] = gains[k, i]
                    x[i] += K[i] * innovation
                predicted, used = 1.0, 1.0
                for i in range(len(DOUBTED)):
                    held[i] = gains[k, n + i]
            else:
                innovation, predicted, used = update(
                    x, P, S, h, H, Hm, z[k], R[k], considered, K, PH, limit
                )
                correlated = 0.0
                for i in range(n):
                    correlated += H[i] * cE[i]
                for i in range(n):
                    cE[i] = cE[i] - K[i] * correlated + TINY - TINY
                    gained[1, i] += K[i] * K[i] * used
                in_proportion(x, P, cE, K, innovation)
                doubt(P, held)
                log_likelihood -= 0.5 * (log(2.0 * pi * used) + innovation * innovation / used)
                if len(gains) > 0:
                    for i in range(n):
                        gains[k, i] = K[i]
                    for i in range(len(DOUBTED)):
                        gains[k, n + i] = sqrt(P[DOUBTED[i], DOUBTED[i]])
            if with_signature:
                correct_signature(S, K, Hm)
                if len(out_signature) > 0:
                    for c in range(m):
                        out_signature[k, c] = -Hm[c]
            out_innovation[k, 0] = innovation
            out_innovation[k, 1] = predicted
            out_innovation[k, 2] = used

        o = emit[k]
        if o >= 0:
            outputs(x, u[k], w, p, g, y, Y, Yu)
            if with_signature:
                outputs_signature(x, u[k], w, p, g, Ym)
            for i in range(n):
                out_x[o, i] = x[i]
                out_total[o, i] = P[i, i]
                for j in range(n):
                    out_P[o, i, j] = P[i, j]
                for c in range(followed):
                    out_total[o, i] += (S[i, c] * spread[c]) ** 2
                if gained[1, i] > 0.0:
                    gained[0, i] += 0.5 * log(1.0 + gained[1, i] / out_total[o, i])
                    gained[1, i] = 0.0
                out_gained[o, i] = gained[0, i]
            for i in range(OUTPUTS):
                total = 0.0
                times(P, Y[i], PH)
                for j in range(n):
                    total += Y[i, j] * PH[j]
                for j in range(INPUTS):
                    total += Yu[i, j] * Yu[i, j] * variance[j]
                for c in range(followed):
                    response = Ym[i, c]
                    for j in range(n):
                        response += Y[i, j] * S[j, c]
                    total += (response * spread[c]) ** 2
                out_y[o, i, 0] = y[i]
                out_y[o, i, 1] = total
            out_energy[o, 0] = E[0]
            out_energy[o, 1] = E[1]
            for c in range(followed):
                out_energy[o, 1] += (sE[c] * spread[c]) ** 2
                out_energy[o, 3 + c] = sE[c]
            out_energy[o, 2] = E[1]
    return log_likelihood
