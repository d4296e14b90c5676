"""Drives drawn from the filter's own model, each with its Cramér–Rao bound.

Like ``compute.kernel`` this text joins the model's lowered functions in a generated module: one of
its own, which :mod:`drawn` makes.  It integrates by itself: Runge–Kutta's rule for the drift,
Euler's and Maruyama's for the noise.
"""

from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np

from clutchest.compute.lowered import (
    HAS_MAP,
    INPUTS,
    OUTPUTS,
    STATES,
    dynamics,
    outputs,
    propagate,
    reading,
    step,
    step_map,
)
from clutchest.compute.update import update
from clutchest.native.reference import compiled

# --- the generated module goes on from here ---


class Plan(NamedTuple):
    """The inputs keep the state near a plan: ``z`` (K) is the reading of ``sensor`` that was meant,
    ``pull`` (nu) by how much each input goes up per unit that the last reading fell short of it.
    ``finest`` s is the longest step of the truth."""

    sensor: Any
    z: Any
    pull: Any
    finest: Any


@compiled
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


@compiled
def wander_finely(x, ua, ub, dt, finer, w, numbers, q, noise, random, work):
    """:func:`wander` in so many ``finer`` steps, each with the step map behind it."""
    k4, A, B, y, Y, Yu, at = work
    for f in range(finer):
        uf = ua + (ub - ua) * (f / finer)
        ug = ua + (ub - ua) * ((f + 1) / finer)
        wander(x, uf, ug, dt / finer, w, numbers.p, numbers.g, q, noise, random, k4, A, B, y, Y, Yu)
        if HAS_MAP:
            step_map(x, uf, ug, w, numbers.p, numbers.g, at, A)
            x[:] = at


@compiled
def draw(random, x, P, events, regimes, numbers, plan, z, out_x, out_bound):
    """Draw the truth from ``x`` (n) along a timeline, and everything that is measured of it.

    ``events`` as the filter's ``run`` takes them; ``u`` (K, nu) is changed in place, by nothing
    but what was measured before, and ``z`` (K) is filled.

    ``P`` (n, n) becomes the posterior Cramér–Rao bound: Tichavský's recursion in its covariance
    form, which a singular process noise does not harm, is the filter's own with every derivative
    taken at the truth.  ``out_x`` (rows, n) truth and ``out_bound`` (rows, n) variance.
    """
    n, t, u, p, g = STATES, events.t, events.u, numbers.p, numbers.g
    F, Q, T, H, at = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    xn, e, K, PH, A = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, n))
    y, Y, Yu = np.zeros(OUTPUTS), np.zeros((OUTPUTS, n)), np.zeros((OUTPUTS, INPUTS))
    work = np.zeros((4, n)), A, np.zeros((n, INPUTS)), y, Y, Yu, at
    nothing, none, few = np.zeros((n, 0)), np.zeros(0), np.zeros(0)
    behind = 0.0
    for k in range(len(t)):
        for j in range(INPUTS):
            u[k, j] += plan.pull[j] * behind
        row = events.row[k]
        w, q = regimes.W[row], regimes.Q[row]
        span = t[k] - t[k - 1] if k > 0 else 0.0
        if span > 0.0:
            steps = ceil(span / regimes.longest[row])
            dt = span / steps
            finer = ceil(dt / plan.finest)
            for i in range(steps):
                ua = u[k - 1] + (u[k] - u[k - 1]) * (i / steps)
                ub = u[k - 1] + (u[k] - u[k - 1]) * ((i + 1) / steps)
                step(x, ua, ub, dt, w, p, g, q, regimes.noise, xn, F, Q, e)
                propagate(P, F, Q, T)
                wander_finely(x, ua, ub, dt, finer, w, numbers, q, regimes.noise, random, work)
        if events.sensor[k] >= 0:
            h = reading(events.sensor[k], x, u[k], w, p, g, H)
            z[k] = h + sqrt(events.R[k]) * random.standard_normal()
            at[:] = x  # the bound's update must not move the truth
            update(at, P, nothing, h, H, none, h, events.R[k], few, K, PH, 1e9)
            if events.sensor[k] == plan.sensor:
                behind = plan.z[k] - z[k]
        o = events.emit[k]
        if o >= 0:
            for i in range(n):
                out_x[o, i] = x[i]
                out_bound[o, i] = P[i, i]
