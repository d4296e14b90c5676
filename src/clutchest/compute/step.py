"""One step of a model in time, written out symbolically."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import casadi as ca

from clutchest.models.model import Expressions, Model

SMALL = 0.1  # of |λ dt|: below, quotients and their derivatives lose digits that a series keeps
TERMS = 9  # of that series: the next one is below 1e-16


@dataclass(frozen=True, slots=True)
class Step:
    """From the state ``e.x`` and inputs ``e.u`` at its start to those at its end, ``dt`` s later.

    ``u1`` inputs at the end; ``q`` (2n) process noise, variance per s and per J of slip energy;
    ``noise`` (nu) input noise, variance per s;
    ``x`` (n) the state after the step, ``Q`` (n, n) the noise gathered, ``energy`` J.
    """

    u1: ca.SX
    dt: ca.SX
    q: ca.SX
    noise: ca.SX
    x: ca.SX
    Q: ca.SX
    energy: ca.SX


def heun(model: Model, e: Expressions, moves: ca.SX | None = None) -> Step:
    """Heun's rule, second order and explicit; exponential where a state is ``stiff``.

    A stiff state relaxes by its own linear decay λ = ∂f_i/∂x_i, taken exactly (an exponential
    Runge–Kutta rule with the Jacobian's diagonal as linear part); at λ = 0 that is Heun's rule.
    A step map acts on the guess and on the result alike; where ``moves`` (nu) of the inputs
    per s are given, it sees those and not what is measured.
    """
    u1, dt = ca.SX.sym("u1", len(model.inputs)), ca.SX.sym("dt")
    q, noise = ca.SX.sym("q", 2 * len(model.states)), ca.SX.sym("noise", len(model.inputs))
    power = model.power(e)
    at = [e.x, e.u, e.w, e.p, e.g]
    rates = ca.Function("rates", at, [e.rate, power])
    by_input = ca.Function("by_input", at, [ca.jacobian(e.rate, e.u)])
    mapped = ca.Function("mapped", [e.x, e.u0, e.u, e.w, e.p, e.g], [e.mapped])
    before = e.u if moves is None else u1 - dt * moves

    f0, power0 = rates(*at)
    growth = decays(model, e)
    first, second = ca.SX.ones(len(model.states)), ca.SX(len(model.states), 1)
    second[:] = 0.5
    once, drift = ca.SX.ones(len(model.states)), ca.SX.zeros(len(model.states))
    for i, rate in growth.items():
        first[i], second[i] = _phi(rate * dt)
        once[i], _ = _phi(2 * rate * dt)
        drift[i] = rate
    guess = mapped(e.x + dt * first * f0, before, u1, e.w, e.p, e.g)
    f1, power1 = rates(guess, u1, e.w, e.p, e.g)
    bend = f1 - f0 - drift * (guess - e.x)
    x = mapped(e.x + dt * (first * f0 + second * bend), before, u1, e.w, e.p, e.g)
    lasting = ca.diag(ca.sqrt(once))  # what a stiff state forgets within the step is not gathered
    B0, B1 = lasting @ by_input(*at), lasting @ by_input(guess, u1, e.w, e.p, e.g)
    noises = ca.diag(noise)
    per_second, per_joule = ca.vertsplit(q, len(model.states))
    energy = dt / 2 * (power0 + power1)
    Q = ca.diag(dt * once * per_second + ca.fabs(energy) * per_joule)
    Q += dt / 2 * (B0 @ noises @ B0.T + B1 @ noises @ B1.T)
    return Step(u1, dt, q, noise, x, Q, energy)


def decays(model: Model, e: Expressions) -> dict[int, ca.SX]:
    """State → λ ≤ 0, 1/s, of every stiff state."""
    stiff = [i for i, state in enumerate(model.states) if state.stiff]
    return {i: ca.fmin(ca.jacobian(e.rate[i], e.x[i]), 0.0) for i in stiff}


def _phi(z: ca.SX) -> tuple[ca.SX, ca.SX]:
    """φ_1 = (e^z − 1)/z = 1 + z φ_2 and φ_2 = (φ_1 − 1)/z = 1/2 + z/6 + z²/24 + …, for z ≤ 0."""
    decays, large = z < -SMALL, ca.fmin(z, -SMALL)  # no quotient by zero, though it be unused
    one = (ca.exp(large) - 1) / large  # as exact there, at half the cost of expm1
    two = ca.SX(1 / factorial(TERMS + 1))
    for k in range(TERMS, 1, -1):
        two = 1 / factorial(k) + z * two
    return (
        ca.if_else(decays, one, 1 + z * two),
        ca.if_else(decays, (one - 1) / large, two),
    )
