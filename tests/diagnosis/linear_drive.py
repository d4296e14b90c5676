"""Blocks of a random linear problem, beside its dense matrices."""

import numpy as np

from clutchest.diagnosis.blocks import Blocks
from clutchest.inference.unknowns import InitialState, UnknownGain, UnknownParameter
from clutchest.models import machine_of

STATES = machine_of("dry_clutch").states
THETAS = (
    UnknownParameter("heat_capacity_body", 1.0),
    UnknownParameter("kiss_point", 1.0),
    InitialState("friction", 0.02),
    UnknownGain("friction_level", "change", 0.5),
    UnknownGain("torque_gain", "change", 0.3),
)
FAULTS = (3, 4)


def linear_drive(
    seed, size=0.0, onset=0, blocks=12, per_block=15, thetas=THETAS, psi=None, masked=False
):
    """Blocks, their rows (K, 1 + m), the covariance (K, K) of the readings and the block (K) of
    each; a fault of ``size`` units, of the first gain, begins with block ``onset``.

    ``psi`` (K, m) replaces the random derivatives; ``masked``: those by gains are 0 before that
    block.
    """
    rng = np.random.default_rng(seed)
    count = blocks * per_block
    random = rng.standard_normal((count, len(thetas)))
    random[:, 3] = random[:, 2] + 0.3 * random[:, 3]  # a fault that a nuisance resembles
    psi = random if psi is None else psi.copy()
    of = np.repeat(np.arange(blocks), per_block)
    if masked:
        psi[of < onset, 3:] = 0.0
    begin = 300.0 * np.arange(blocks)
    drift = np.cumsum(np.r_[1.0, np.full(blocks - 1, 300.0 / 3600.0)])  # variance of the friction
    friction = np.minimum(*np.meshgrid(drift, drift))[np.ix_(of, of)]
    covariance = np.eye(count) + psi[:, :2] @ psi[:, :2].T
    covariance += friction * np.outer(psi[:, 2], psi[:, 2])
    r = np.linalg.cholesky(covariance) @ rng.standard_normal(count)
    r = r - size * psi[:, 3] * (of >= onset)  # innovations fall as the number grows
    rows = np.column_stack([r, psi])
    gram = np.array([rows[of == k].T @ rows[of == k] for k in range(blocks)])
    count, near = np.full(blocks, per_block), np.ones(blocks)
    drive = Blocks(STATES, (), thetas, begin, begin + 1.0, count, near, gram)
    return drive, rows, covariance, of
