"""Innovations and how they answer to every unknown number, for fits that run a log many times.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.  It
does what ``run`` does, without energies, outputs and bounds.
"""

from math import ceil

import numpy as np

from clutchest.compute.lowered import (
    FIRST,
    INPUTS,
    ROW,
    STATES,
    THETAS,
    carry,
    dynamics,
    follow,
    gathered,
    reading,
    reading_signature,
    settle,
    transition,
)
from clutchest.compute.records import SensitivityWork
from clutchest.compute.update import inlined, inputs_between
from clutchest.native import compiled

# --- the generated module goes on from here ---

LANES = 16  # columns that the processor takes at once: what is over, it takes one by one


def sensitivity_workspace(thetas):
    """Memory for :func:`filter_sensitivities`, with responses to so many thetas."""
    n, m, nu = STATES, THETAS, INPUTS
    wide = (thetas + LANES - 1) // LANES * LANES
    return SensitivityWork(
        S=np.zeros((n, wide)),
        T=np.zeros((n, wide)),
        acts=np.ones(thetas),
        by_theta=np.zeros(thetas),
        row=np.zeros(1, np.int64),
        xn=np.zeros(n),
        xc=np.zeros(n),
        xs=np.zeros(n),
        xd=np.zeros(n),
        ua=np.zeros(nu),
        ub=np.zeros(nu),
        va=np.zeros(nu),
        vb=np.zeros(nu),
        F=np.zeros((n, n)),
        Q=np.zeros((n, n)),
        P=np.zeros((n, n)),
        G=np.zeros((n, m)),
        H=np.zeros(n),
        Hm=np.zeros(m),
        PH=np.zeros(n),
    )


@inlined
def carried(k, x, xn, S, T, P, thetas, events, denoised, tracking, regimes, numbers, path, work):
    """State and responses carried from event k − 1 to event k, in memory that takes turns; P in
    place.  Returns x, xn, S and T."""
    row, p, g, active = events.row[k], numbers.p, numbers.g, thetas.active
    w, moves, F, G, xc = regimes.W[row], denoised.moves[k], work.F, work.G, work.xc
    ua, ub, va, vb = work.ua, work.ub, work.va, work.vb
    span = events.t[k] - events.t[k - 1]
    least = ceil(span / regimes.longest[row])
    steps = (least + thetas.at_once[row] - 1) // thetas.at_once[row]  # of the responses
    each = (least + steps - 1) // steps
    dt = span / steps
    for i in range(steps):
        mark(x, path, work)
        inputs_between(denoised.inputs, k, i, steps, va, vb)
        for j in range(STATES):
            xc[j] = x[j]  # from where the step begins
        for b, j in enumerate(tracking.states):
            if denoised.states[k - 1, b] == denoised.states[k - 1, b]:
                xc[j] = denoised.states[k - 1, b]
        for j in tracking.settling:
            xc[j] = work.xs[j]
        if len(tracking.settling) > 0:
            settle(xc, va, vb, dt, w, p, g, moves, work.xd)
            for j in tracking.settling:
                work.xs[j] = work.xd[j]
        for part in range(0 if path.known else each):
            inputs_between(events.u, k, i * each + part, steps * each, ua, ub)
            follow(x, ua, ub, dt / each, w, p, g, moves, xn)
            x, xn = xn, x
        if tracking.frozen and len(active) == 0:
            continue  # nothing is to be differentiated
        transition(xc, va, vb, dt, w, p, g, moves, denoised.slope[k], F, G)
        if not tracking.frozen:
            gathered(xc, va, vb, dt, w, p, g, moves, regimes.Q[row], regimes.noise, work.Q)
            spread(P, F, work.Q, tracking.states, work.P)
        carry(F, S, T, T.shape[1])
        for c in range(len(active)):
            for q in range(FIRST[active[c]], FIRST[active[c] + 1]):
                T[ROW[q], c] += G[ROW[q], active[c]] * work.acts[c]
        S, T = T, S
    return x, xn, S, T


@inlined
def mark(x, path, work):
    """Put x into the next row of the path, or what stands there into x."""
    at = work.row[0]
    work.row[0] = at + 1
    if path.known:
        for j in range(STATES):
            x[j] = path.x[at, j]
    elif at < len(path.x):
        for j in range(STATES):
            path.x[at, j] = x[j]


@inlined
def innovate(k, x, S, P, thetas, events, denoised, tracking, regimes, numbers, work):
    """The innovation of event k; its response to every active θ is put into ``work.by_theta``.
    x, S and P are corrected."""
    sensor, w, p, g = events.sensor[k], regimes.W[events.row[k]], numbers.p, numbers.g
    active, H, Hm, by_theta, gain = thetas.active, work.H, work.Hm, work.by_theta, tracking.gain
    h = reading(sensor, x, events.u[k], w, p, g, H)
    xc = work.xc
    for i in range(STATES):
        xc[i] = x[i]
    for i in tracking.settling:
        xc[i] = work.xs[i]
    reading_signature(sensor, xc, denoised.inputs[k], w, p, g, Hm)
    for c in range(len(active)):
        by_theta[c] = Hm[active[c]] * work.acts[c]
    for i in range(STATES):
        if H[i] != 0.0:
            for c in range(len(active)):
                by_theta[c] += H[i] * S[i, c]
    if not tracking.frozen:
        tracking.variance[k] = weigh(P, H, events.R[k], tracking.states, work.PH, gain[k])
    innovation = events.z[k] - h
    for j, i in enumerate(tracking.states):
        x[i] += gain[k, j] * innovation
        if gain[k, j] != 0.0:
            for c in range(len(active)):
                S[i, c] -= gain[k, j] * by_theta[c]
    return innovation


@compiled
def filter_sensitivities(
    start, thetas, events, denoised, varying, tracking, regimes, numbers, path, results, work
):
    """Filter a log and follow the responses to the active thetas.

    States that are tracked are corrected by readings; of others nothing is unknown but θ.
    Responses are taken at the inputs ``denoised.inputs``, not at the measured ones, and where
    tracked states stand at ``denoised.states``, not where noisy readings put them; step maps see
    inputs move by ``denoised.moves``: what has a play does not follow the noise of a reading.
    Tracked states that an input settles at once stand, for responses, where the denoised one puts
    them: it and the noisy state side by side would seem to be settling all the time.
    Noise that stands in an innovation and in its derivative alike would make every number that
    multiplies an input seem smaller than it is.

    Filled: ``results``, the ``path`` where it is not known, and gain and variance of ``tracking``
    where they are not frozen; ``start`` is moved to the end, ``numbers`` become the ``varying``
    ones there, and ``work`` is memory of its own for each run.
    """
    t, sensor, emit, which, acts = events.t, events.sensor, events.emit, thetas.which, work.acts
    x, xn, P, S, T = start.x, work.xn, start.P, work.S, work.T
    for i in range(STATES):
        for c in range(len(acts)):
            S[i, c] = start.S[i, c]
        work.xs[i] = start.settled[i]
    for k in range(len(t)):
        for c in range(len(acts)):
            if which[c] >= 0:
                acts[c] = thetas.basis[k, which[c]]
        vary(k, varying, numbers)
        if k > 0 and t[k] > t[k - 1]:
            x, xn, S, T = carried(
                k, x, xn, S, T, P, thetas, events, denoised, tracking, regimes, numbers, path, work
            )
        mark(x, path, work)
        if sensor[k] >= 0:
            innovation = innovate(
                k, x, S, P, thetas, events, denoised, tracking, regimes, numbers, work
            )
            emitted(emit[k], innovation, thetas, results, work)
        for i in range(STATES):
            results.x[k, i] = x[i]
        for i in tracking.settling:
            results.x[k, i] = work.xs[i]
    for i in range(STATES):
        start.x[i] = x[i]
        start.settled[i] = work.xs[i]
        for c in range(len(acts)):
            start.S[i, c] = S[i, c]


@inlined
def emitted(row, innovation, thetas, results, work):
    """Put an innovation and its response to every active θ into a row of the results, if any."""
    if row >= 0:
        results.innovation[row] = innovation
        for c in range(len(thetas.active)):
            results.by_theta[row, thetas.place[c]] = -work.by_theta[c]


@inlined
def vary(k, varying, numbers):
    """Put the ``varying`` of the ``numbers`` to what they are at event k."""
    for j, i in enumerate(varying.which):
        numbers.g[i] = varying.value[k, j]


@compiled
def spread(P, F, Q, tracked, moved):
    """P ← F P Fᵀ + Q of the ``tracked`` states; of others nothing is unknown but θ."""
    for i in tracked:
        for j in tracked:
            moved[i, j] = 0.0
            for k in tracked:
                moved[i, j] += F[i, k] * P[k, j]
    for i in tracked:
        for j in tracked:
            P[i, j] = Q[i, j]
            for k in tracked:
                P[i, j] += moved[i, k] * F[j, k]


@compiled
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


@compiled
def imply_inputs(x, row, rates, varying, regimes, numbers, measured, u):
    """Put inputs ``u`` (K, nu), in place, to where they explain the measured slopes, as near to the
    ``measured`` ones (K, nu) as that goes: one step of Gauss and Newton from where they stand.

    ``x`` (K, n) states, ``row`` (K) their regimes; ``numbers`` become the ``varying`` ones.  What
    the ``rates`` lack is shared among the inputs as their noise densities have it: the most
    probable share of each.
    """
    W, p, g, noise = regimes.W, numbers.p, numbers.g, regimes.noise
    tracked, rate, acts = rates.tracked, rates.rate, rates.acts
    f, A, B = np.zeros(STATES), np.zeros((STATES, STATES)), np.zeros((STATES, INPUTS))
    aim = np.zeros(INPUTS)
    for k in range(len(x)):
        if not acts[k]:
            continue
        vary(k, varying, numbers)
        dynamics(x[k], u[k], W[row[k]], p, g, f, A, B)
        for j in range(INPUTS):
            aim[j] = measured[k, j]
        for a, i in enumerate(tracked):
            total, lacks = 0.0, rate[k, a] - f[i]
            for j in range(INPUTS):
                total += B[i, j] * B[i, j] * noise[j]
                lacks -= B[i, j] * (aim[j] - u[k, j])
            if total > 0.0:
                for j in range(INPUTS):
                    aim[j] += lacks * B[i, j] * noise[j] / total
        for j in range(INPUTS):
            u[k, j] = aim[j]
