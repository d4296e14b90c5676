"""Inputs as the tracked states imply them.

Like ``compute.kernel`` this text joins the model's lowered functions in the generated module.
"""

import numpy as np
from numba import njit

from clutchest.compute.lowered import INPUTS, STATES, dynamics

# --- the generated module goes on from here ---


@njit(cache=True, error_model="numpy")
def imply(x, slope, tracked, row, acts, W, noise, p, g, u):
    """Move inputs ``u`` (K, nu), in place, to where they explain the measured slopes.

    ``x`` (K, n) states, ``slope`` (K, n) the measured rates of the ``tracked`` ones (indices);
    ``acts`` (K) where their equations hold.  What the rate lacks is shared among the inputs as
    their noise densities ``noise`` (nu) have it: the most probable share of each.
    """
    f, A, B = np.zeros(STATES), np.zeros((STATES, STATES)), np.zeros((STATES, INPUTS))
    for k in range(len(x)):
        if not acts[k]:
            continue
        dynamics(x[k], u[k], W[row[k]], p, g, f, A, B)
        for i in tracked:
            total = 0.0
            for j in range(INPUTS):
                total += B[i, j] * B[i, j] * noise[j]
            if total > 0.0:
                for j in range(INPUTS):
                    u[k, j] += (slope[k, i] - f[i]) * B[i, j] * noise[j] / total
