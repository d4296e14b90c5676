"""The filter over a whole log: compiled, fixed, with no model in it.

This text and the model's lowered functions make one generated module (see ``compute.build``); the
imports below stand for those functions here, so that this file can be read and checked by itself.
"""

from math import ceil, log, pi, sqrt

import numpy as np

from clutchest.compute.lowered import (
    DOUBTED,
    INPUTS,
    OUTPUTS,
    STATES,
    THETAS,
    outputs,
    outputs_signature,
    propagate,
    propagate_signature,
    reading,
    step,
    step_signature,
)
from clutchest.compute.records import Work
from clutchest.compute.update import (
    answer_of_energy,
    correct_energy,
    correct_signature,
    doubt,
    in_proportion,
    inlined,
    inputs_between,
    propagate_energy,
    reading_answer,
    slopes,
    step_answer,
    times,
    update,
)
from clutchest.native import compiled

# --- the generated module goes on from here ---


def workspace(flags):
    """Memory for a run of the filter, with so many regime flags."""
    n, m, nu, outputs = STATES, THETAS, INPUTS, OUTPUTS
    return Work(
        w=np.zeros(flags),
        xn=np.zeros(n),
        ua=np.zeros(nu),
        ub=np.zeros(nu),
        va=np.zeros(nu),
        vb=np.zeros(nu),
        slope=np.zeros(nu),
        F=np.zeros((n, n)),
        Q=np.zeros((n, n)),
        T=np.zeros((n, n)),
        e=np.zeros(n),
        G=np.zeros((n, m)),
        eG=np.zeros(m),
        H=np.zeros(n),
        Hm=np.zeros(m),
        K=np.zeros(n),
        PH=np.zeros(n),
        y=np.zeros(outputs),
        Y=np.zeros((outputs, n)),
        Yu=np.zeros((outputs, nu)),
        Ym=np.zeros((outputs, m)),
        L=np.zeros((n, 1 + m)),
        A=np.zeros((n, n)),
        nothing=np.zeros(0),
    )


@inlined
def predict_signature(belief, dt, numbers, weighting, work):
    """The response to every θ of state and energy, carried on over a step that ``work`` holds."""
    w, p, g = work.w, numbers.p, numbers.g
    if len(weighting.considered) > 0:
        step_answer(
            belief.x,
            work.xn,
            work.ua,
            work.ub,
            dt,
            w,
            p,
            g,
            work.va,
            work.vb,
            work.slope,
            work.G,
            work.eG,
        )
    else:
        slopes(work.ua, work.ub, dt, work.slope)
        step_signature(belief.x, work.ua, work.ub, dt, w, p, g, work.slope, work.G, work.eG)
    answer_of_energy(belief.sE, work.eG, work.e, belief.S)
    propagate_signature(belief.S, work.F, work.G)


@inlined
def predict(k, span, belief, events, regimes, numbers, weighting, work):
    """Carry the belief over the ``span`` s from event k − 1 to event k."""
    x, P, E, cE, w, row = belief.x, belief.P, belief.E, belief.cE, work.w, events.row[k]
    xn, F, Q, e = work.xn, work.F, work.Q, work.e
    steps = ceil(span / regimes.longest[row])
    dt = span / steps
    for j in range(len(DOUBTED)):
        w[len(w) - len(DOUBTED) + j] = belief.held[j]
    for i in range(steps):
        inputs_between(events.u, k, i, steps, work.ua, work.ub)
        E[0] += step(
            x,
            work.ua,
            work.ub,
            dt,
            w,
            numbers.p,
            numbers.g,
            regimes.Q[row],
            regimes.noise,
            xn,
            F,
            Q,
            e,
        )
        if weighting.signature:
            predict_signature(belief, dt, numbers, weighting, work)
        propagate_energy(E, cE, P, F, e, work.PH)
        propagate(P, F, Q, work.T)
        for j in range(STATES):
            x[j] = xn[j]


@inlined
def correct(k, h, belief, gained, events, weighting, work):
    """Take the reading of event k, predicted as ``h``; returns innovation, its predicted and its
    used variance, and the log-likelihood."""
    x, P, cE, held, K, H = belief.x, belief.P, belief.cE, belief.held, work.K, work.H
    innovation, predicted, used = update(
        x,
        P,
        belief.S,
        h,
        H,
        work.Hm,
        events.z[k],
        events.R[k],
        weighting.considered,
        K,
        work.PH,
        weighting.limit,
    )
    correct_energy(cE, gained, H, K, used)
    in_proportion(x, P, cE, K, innovation)
    doubt(P, held)
    gains = weighting.gains
    if len(gains) > 0:
        for i in range(STATES):
            gains[k, i] = K[i]
        for i in range(len(DOUBTED)):
            gains[k, STATES + i] = sqrt(P[DOUBTED[i], DOUBTED[i]])
    likelihood = -0.5 * (log(2.0 * pi * used) + innovation * innovation / used)
    return innovation, predicted, used, likelihood


@inlined
def correct_frozen(k, h, belief, events, weighting, work):
    """Take the reading of event k with the gain that is given; as :func:`correct` returns."""
    innovation, gains = events.z[k] - h, weighting.gains
    for i in range(STATES):
        work.K[i] = gains[k, i]
        belief.x[i] += work.K[i] * innovation
    for i in range(len(DOUBTED)):
        belief.held[i] = gains[k, STATES + i]
    return innovation, 1.0, 1.0, 0.0


@inlined
def take_reading(k, belief, gained, events, numbers, weighting, results, work):
    """What the reading of event k says of the belief; returns its log-likelihood."""
    sensor, w, p, g = events.sensor[k], work.w, numbers.p, numbers.g
    h = reading(sensor, belief.x, events.u[k], w, p, g, work.H)
    if weighting.signature:
        reading_answer(sensor, belief.x, events.u[k], w, p, g, work.H, belief.S, work.Hm)
    if weighting.frozen:
        innovation, predicted, used, likelihood = correct_frozen(
            k, h, belief, events, weighting, work
        )
    else:
        innovation, predicted, used, likelihood = correct(
            k, h, belief, gained, events, weighting, work
        )
    if weighting.signature:
        correct_signature(belief.S, work.K, work.Hm)
        if len(results.signature) > 0:
            for c in range(THETAS):
                results.signature[k, c] = -work.Hm[c]
    results.innovation[k, 0] = innovation
    results.innovation[k, 1] = predicted
    results.innovation[k, 2] = used
    return likelihood


@inlined
def store_states(o, belief, gained, weighting, rows):
    """Row o of the output: state, covariance, and what measurements gave so far."""
    x, P, S, spread = belief.x, belief.P, belief.S, weighting.spread
    followed = THETAS if weighting.signature else 0
    for i in range(STATES):
        rows.x[o, i] = x[i]
        total = P[i, i]
        for j in range(STATES):
            rows.P[o, i, j] = P[i, j]
        for c in range(followed):
            total += (S[i, c] * spread[c]) ** 2
        rows.total[o, i] = total
        if gained[1, i] > 0.0:
            gained[0, i] += 0.5 * log(1.0 + gained[1, i] / total)
            gained[1, i] = 0.0
        rows.gained[o, i] = gained[0, i]


@inlined
def store_outputs(o, u, belief, numbers, variance, weighting, rows, work):
    """Row o of the output: the model's outputs and the energy, each with its variance."""
    S, spread, w, p, g = belief.S, weighting.spread, work.w, numbers.p, numbers.g
    y, Y, Yu, Ym, PH = work.y, work.Y, work.Yu, work.Ym, work.PH
    followed = THETAS if weighting.signature else 0
    outputs(belief.x, u, w, p, g, y, Y, Yu)
    if weighting.signature:
        outputs_signature(belief.x, u, w, p, g, Ym)
    for i in range(OUTPUTS):
        total = 0.0
        times(belief.P, Y[i], PH)
        for j in range(STATES):
            total += Y[i, j] * PH[j]
        for j in range(INPUTS):
            total += Yu[i, j] * Yu[i, j] * variance[j]
        for c in range(followed):
            response = Ym[i, c]
            for j in range(STATES):
                response += Y[i, j] * S[j, c]
            total += (response * spread[c]) ** 2
        rows.outputs[o, i, 0] = y[i]
        rows.outputs[o, i, 1] = total
    energy, own = rows.energy[o], belief.E[1]
    energy[0], energy[1], energy[2] = belief.E[0], own, own
    for c in range(followed):
        energy[1] += (belief.sE[c] * spread[c]) ** 2
        energy[3 + c] = belief.sE[c]


@compiled
def run(belief, gained, events, regimes, numbers, weighting, rows, results, work):
    """Filter a whole log; returns its log-likelihood.

    Advanced in place, so that a log can be run piece by piece: the ``belief`` at ``t[0]``, and
    ``gained`` (2, n), the information in nats that measurements gave of each state up to the last
    output (½ log of its variance before over that after, summed up), and the variance they took
    away since.  Filled: ``rows`` per emitted row, ``results`` per event; ``work`` is memory.
    """
    t, sensor, emit, w = events.t, events.sensor, events.emit, work.w
    if len(DOUBTED) > 0 and belief.held[0] < 0.0:
        doubt(belief.P, belief.held)
    log_likelihood = 0.0
    for k in range(len(t)):
        for j in range(len(w)):
            w[j] = regimes.W[events.row[k], j]
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            predict(k, span, belief, events, regimes, numbers, weighting, work)
        if sensor[k] >= 0:
            log_likelihood += take_reading(
                k, belief, gained, events, numbers, weighting, results, work
            )
        if emit[k] >= 0:
            store_states(emit[k], belief, gained, weighting, rows)
            store_outputs(
                emit[k], events.u[k], belief, numbers, regimes.variance, weighting, rows, work
            )
    return log_likelihood
