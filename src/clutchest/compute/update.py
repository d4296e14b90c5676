"""Prediction and update of a covariance and its responses, one step and one reading at a time.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.
Matrices are small and their sizes constants of the generated module: plain loops, which the
compiler unrolls, are the fastest form.
"""

from math import sqrt

from clutchest.compute.lowered import (
    DOUBTED,
    INPUTS,
    SCALES,
    STATES,
    THETAS,
    implied,
    reading_signature,
    step_signature,
)
from clutchest.native import compiled

# --- the generated module goes on from here ---

inlined = compiled(inline=True)  # what takes records
apart = compiled(apart=True)  # no array overlaps another: a row's elements go in parallel

# A covariance with a state that is measured again and again, and fed by nothing, fades by a factor
# at each reading.  Far below 1e-280 a processor takes a hundred times as long over every number;
# what is added and taken away again makes it zero before.
TINY = 1e-280


@apart
def add_product(F, X, T, columns):
    """T ← T + F X, the first ``columns`` of them; the zeros of F cost nothing."""
    for i in range(STATES):
        for k in range(STATES):
            a = F[i, k]
            if a != 0.0:
                for j in range(columns):
                    T[i, j] += a * X[k, j]


@compiled
def slopes(va, vb, dt, slope):
    """slope (nu) of inputs that go from ``va`` to ``vb`` in ``dt`` s."""
    for j in range(INPUTS):
        slope[j] = (vb[j] - va[j]) / dt


@compiled
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


@apart
def propagate_energy(E, cE, P, F, e, work):
    """The energy as a state that no measurement corrects: its variance and covariance with x."""
    for i in range(STATES):
        work[i] = cE[i]
    for j in range(STATES):
        if e[j] != 0.0:
            for i in range(STATES):
                work[i] += P[j, i] * e[j]  # cov(E', x) before the step
    for i in range(STATES):
        E[1] += e[i] * (cE[i] + work[i])
    for i in range(STATES):
        total = 0.0
        for j in range(STATES):
            total += F[i, j] * work[j]
        cE[i] = total


@apart
def answer_of_energy(sE, eG, e, S):
    """sE ← sE + eG + eᵀ S: how the energy answers to every θ after a step."""
    for c in range(THETAS):
        sE[c] += eG[c]
    for j in range(STATES):
        if e[j] != 0.0:
            for c in range(THETAS):
                sE[c] += e[j] * S[j, c]


@apart
def correct_energy(cE, gained, H, K, used):
    """What a reading leaves of the energy's covariance with x, and takes away of x's variance."""
    correlated = 0.0
    for i in range(STATES):
        correlated += H[i] * cE[i]
    for i in range(STATES):
        cE[i] = cE[i] - K[i] * correlated + TINY - TINY
        gained[1, i] += K[i] * K[i] * used


@compiled
def inputs_between(u, k, i, steps, ua, ub):
    """Inputs at both ends of the i-th of ``steps`` equal steps from event k − 1 to event k."""
    share = 1.0 / steps
    for j in range(INPUTS):
        slope = (u[k, j] - u[k - 1, j]) * share
        ua[j] = u[k - 1, j] + i * slope
        ub[j] = u[k - 1, j] + (i + 1) * slope


@compiled
def doubt(P, held):
    """held ← the standard deviations that equations may use until the next reading."""
    for i in range(len(DOUBTED)):
        held[i] = sqrt(max(P[DOUBTED[i], DOUBTED[i]], 0.0))


@apart
def reading_answer(sensor, x, u, w, p, g, H, S, Hm):
    """Hm (m) ← how a sensor's reading answers to every θ, by itself and through the state."""
    reading_signature(sensor, x, u, w, p, g, Hm)
    for i in range(STATES):
        if H[i] != 0.0:
            for c in range(THETAS):
                Hm[c] += H[i] * S[i, c]


@apart
def correct_signature(S, K, Hm):
    """S ← S − K Hmᵀ: what a measurement leaves of the state's answer to every θ."""
    for i in range(STATES):
        for c in range(THETAS):
            S[i, c] = S[i, c] - K[i] * Hm[c] + TINY - TINY


@apart
def times(P, H, PH):
    """PH ← Pᵀ H, of whole rows; a sensor sees few states, and the others cost nothing."""
    for i in range(STATES):
        PH[i] = 0.0
    for j in range(STATES):
        h = H[j]
        if h != 0.0:
            for i in range(STATES):
                PH[i] += P[j, i] * h


@apart
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
    if len(considered) > 0:
        for c in range(THETAS):
            predicted += considered[c] * Hm[c] * Hm[c]
        for i in range(STATES):
            for c in range(THETAS):
                K[i] += S[i, c] * (considered[c] * Hm[c])
    innovation = z - h
    used = predicted
    if innovation * innovation > limit * limit * predicted:
        used = innovation * innovation / (limit * limit)
    R_used = R + (used - predicted)
    for i in range(STATES):
        K[i] /= used
        x[i] += K[i] * innovation
    # (I − K Hᵀ) P (I − K Hᵀ)ᵀ + K R Kᵀ, one factor after the other, and in between transposed
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] -= PH[i] * K[j]
    times(P, H, PH)
    for j in range(STATES):
        for i in range(STATES):
            P[j, i] = P[j, i] - PH[i] * K[j] + R_used * K[i] * K[j] + TINY - TINY
    for i in range(1, STATES):
        for j in range(i):
            P[i, j] = P[j, i]
    return innovation, predicted, used


@apart
def in_proportion(x, P, cE, K, innovation):
    """What is known of factors, in proportion to where the last update has moved them.

    A reading of a product does not separate its factors.  Linearised at one value of a factor
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
