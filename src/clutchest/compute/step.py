"""One step of a model in time, written out symbolically."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from clutchest.models.model import Expressions, Model


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


def heun(model: Model, e: Expressions) -> Step:
    """Heun's rule, second order and explicit: right where nothing is stiff.

    A step map acts on the guess and on the result alike.
    """
    u1, dt = ca.SX.sym("u1", len(model.inputs)), ca.SX.sym("dt")
    q, noise = ca.SX.sym("q", 2 * len(model.states)), ca.SX.sym("noise", len(model.inputs))
    power = e.outputs[model.outputs.index("power")]
    rates = ca.Function("rates", [e.x, e.u, e.w, e.p, e.g], [e.rate, power])
    by_input = ca.Function("by_input", [e.x, e.u, e.w, e.p, e.g], [ca.jacobian(e.rate, e.u)])
    mapped = ca.Function("mapped", [e.x, e.u0, e.u, e.p, e.g], [e.mapped])

    f0, power0 = rates(e.x, e.u, e.w, e.p, e.g)
    guess = mapped(e.x + dt * f0, e.u, u1, e.p, e.g)
    f1, power1 = rates(guess, u1, e.w, e.p, e.g)
    x = mapped(e.x + dt / 2 * (f0 + f1), e.u, u1, e.p, e.g)
    B0, B1 = by_input(e.x, e.u, e.w, e.p, e.g), by_input(guess, u1, e.w, e.p, e.g)
    noises = ca.diag(noise)
    per_second, per_joule = ca.vertsplit(q, len(model.states))
    energy = dt / 2 * (power0 + power1)
    Q = ca.diag(dt * per_second + ca.fabs(energy) * per_joule)
    Q += dt / 2 * (B0 @ noises @ B0.T + B1 @ noises @ B1.T)
    return Step(u1, dt, q, noise, x, Q, energy)
