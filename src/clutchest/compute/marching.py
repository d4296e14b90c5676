"""A model by itself, step after step: no filter, no derivatives.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.
"""

import numpy as np

from clutchest.compute.lowered import advance, watch
from clutchest.native import compiled

# --- the generated module goes on from here ---


@compiled
def march(x, u, dt, between, w, p, g, out):
    """Advance ``x`` (n), in place, along inputs ``u`` (K, nu), straight between rows that lie
    ``between`` steps of ``dt`` s apart; ``out`` (K, watched) is filled."""
    xn, ua, ub = np.zeros(len(x)), np.zeros(u.shape[1]), np.zeros(u.shape[1])
    for k in range(len(u)):
        for i in range(between if k > 0 else 0):
            for j in range(u.shape[1]):
                slope = (u[k, j] - u[k - 1, j]) / between
                ua[j] = u[k - 1, j] + i * slope
                ub[j] = u[k - 1, j] + (i + 1) * slope
            advance(x, ua, ub, dt, w, p, g, xn)
            x, xn = xn, x
        watch(x, u[k], w, p, g, out[k])
