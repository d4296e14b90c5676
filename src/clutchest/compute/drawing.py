"""Drives drawn from the filter's own model, each with its Cramér–Rao bound.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.  It
integrates by itself: Runge–Kutta's rule for the drift, Euler's and Maruyama's for the noise.
"""

from math import ceil, sqrt

import numpy as np
from numba import njit

from clutchest.compute.kernel import propagate, update
from clutchest.compute.lowered import (
    HAS_MAP,
    INPUTS,
    OUTPUTS,
    STATES,
    dynamics,
    outputs,
    reading,
    step,
    step_map,
)

# --- the generated module goes on from here ---


@njit(cache=True, error_model="numpy")
def wander(x, ua, ub, dt, w, p, g, q, noise, random, k, A, B, y, Y, Yu):
    """x ← x after ``dt`` s of the stochastic differential equation; inputs go ``ua`` → ``ub``.

    ``random`` is numpy's generator; ``k`` (4, n) takes the slopes, ``A``, ``B``, ``y``, ``Y`` and
    ``Yu`` what is not needed of them.
    """
    n = STATES
    middle = (ua + ub) / 2
    dynamics(x, ua, w, p, g, k[0], A, B)
    outputs(x, ua, w, p, g, y, Y, Yu)
    kicks = np.zeros(n)
    for j in range(INPUTS):
        if noise[j] > 0.0:
            draw = sqrt(noise[j] * dt) * random.standard_normal()
            for i in range(n):
                kicks[i] += B[i, j] * draw
    for i in range(n):
        variance = q[i] * dt + q[n + i] * abs(y[OUTPUTS - 1]) * dt
        kicks[i] += sqrt(variance) * random.standard_normal()
    dynamics(x + dt / 2 * k[0], middle, w, p, g, k[1], A, B)
    dynamics(x + dt / 2 * k[1], middle, w, p, g, k[2], A, B)
    dynamics(x + dt * k[2], ub, w, p, g, k[3], A, B)
    for i in range(n):
        x[i] += dt / 6 * (k[0, i] + 2 * k[1, i] + 2 * k[2, i] + k[3, i]) + kicks[i]


@njit(cache=True, error_model="numpy")
def draw(
    random,
    x,
    P,
    t,
    sensor,
    R,
    u,
    row,
    W,
    Qs,
    longest,
    finest,
    noise,
    p,
    g,
    watched,
    held,
    pull,
    emit,
    z,
    out_x,
    out_bound,
):
    """Draw the truth from ``x`` (n) along a timeline, and everything that is measured of it.

    Events as the filter's ``run`` takes them.  ``finest`` s is the longest step of the truth.
    The inputs keep the state near a plan: ``held`` (K) is the reading of sensor ``watched`` that
    was meant, ``pull`` (nu) by how much each input goes up per unit that the last reading fell
    short of it.  So ``u`` (K, nu) is changed in place, by nothing but what was measured before;
    ``z`` (K) is filled.

    ``P`` (n, n) becomes the posterior Cramér–Rao bound: Tichavský's recursion in its covariance
    form, which a singular process noise does not harm, is the filter's own with every derivative
    taken at the truth.  ``out_x`` (rows, n) truth and ``out_bound`` (rows, n) variance.
    """
    n = STATES
    F, Q, T = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    xn, e, K, PH, H, at = (
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
    )
    k4, A, B = np.zeros((4, n)), np.zeros((n, n)), np.zeros((n, INPUTS))
    y, Y, Yu = np.zeros(OUTPUTS), np.zeros((OUTPUTS, n)), np.zeros((OUTPUTS, INPUTS))
    nothing, none, few = np.zeros((n, 0)), np.zeros(0), np.zeros(0)
    behind = 0.0
    for k in range(len(t)):
        for j in range(INPUTS):
            u[k, j] += pull[j] * behind
        w = W[row[k]]
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            steps = ceil(span / longest[row[k]])
            dt = span / steps
            finer = ceil(dt / finest)
            for i in range(steps):
                ua = u[k - 1] + (u[k] - u[k - 1]) * (i / steps)
                ub = u[k - 1] + (u[k] - u[k - 1]) * ((i + 1) / steps)
                step(x, ua, ub, dt, w, p, g, Qs[row[k]], noise, xn, F, Q, e)
                propagate(P, F, Q, T)
                for f in range(finer):
                    uf = ua + (ub - ua) * (f / finer)
                    ug = ua + (ub - ua) * ((f + 1) / finer)
                    wander(
                        x,
                        uf,
                        ug,
                        dt / finer,
                        w,
                        p,
                        g,
                        Qs[row[k]],
                        noise,
                        random,
                        k4,
                        A,
                        B,
                        y,
                        Y,
                        Yu,
                    )
                    if HAS_MAP:
                        step_map(x, uf, ug, w, p, g, at, A)
                        x[:] = at
        if sensor[k] >= 0:
            h = reading(sensor[k], x, u[k], w, p, g, H)
            z[k] = h + sqrt(R[k]) * random.standard_normal()
            at[:] = x  # the bound's update must not move the truth
            update(at, P, nothing, h, H, none, h, R[k], few, K, PH, 1e9)
            if sensor[k] == watched:
                behind = held[k] - z[k]
        o = emit[k]
        if o >= 0:
            for i in range(n):
                out_x[o, i] = x[i]
                out_bound[o, i] = P[i, i]
