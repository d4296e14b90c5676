"""Derivatives of the innovations by candidate causes at a fit, and the scores of these."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.candidates import CandidateCause, settings
from clutchest.inference.cores import shared
from clutchest.inference.estimated_noise import EstimatedNoise, with_estimated_noise
from clutchest.inference.objective import NO_SHAPES, SAME, Objective
from clutchest.inference.score_test import ScoreTest, score_test
from clutchest.inference.unknowns import Shapes
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats


def columns(objective: Objective, fit: Linearisation, wanted: Sequence[CandidateCause]) -> Floats:
    """Derivatives (K, C) of the innovations by each candidate's gain at a fit with all of them."""
    derivatives = np.zeros((len(fit.r), len(wanted)))

    def put(together: tuple[list[int], Shapes]) -> None:
        """Derivatives by what one linearisation serves, at its shapes."""
        some, shapes = together
        active = np.array([wanted[i].index for i in some], np.int64)
        at = objective.relinearise(fit, fit.theta, shapes, active) if shapes else fit
        derivatives[:, some] = at.by(active)

    shared(put, by_shapes(fit, wanted))
    return derivatives


def by_shapes(
    fit: Linearisation, wanted: Sequence[CandidateCause]
) -> Iterator[tuple[list[int], Shapes]]:
    """Indices of those of the ``wanted`` that one linearisation serves, and its shapes: first of
    those whose shapes are what their effects have in a ``fit``, which is ``NO_SHAPES``; then one
    value of every effect's at a time."""
    plain = [i for i, c in enumerate(wanted) if _as_in(fit, c)]
    yield plain, NO_SHAPES
    rest = [i for i in range(len(wanted)) if i not in plain]
    while rest:
        now = {wanted[i].name: i for i in reversed(rest)}
        some = [i for i in rest if wanted[i].shapes == wanted[now[wanted[i].name]].shapes]
        yield some, {**settings(tuple(wanted[i] for i in now.values())), **fit.shapes}
        rest = [i for i in rest if i not in some]


def _as_in(fit: Linearisation, cause: CandidateCause) -> bool:
    """Whether the shapes of a cause, if there are any, are those that its effect has in a fit."""
    default = {number.key: number.default for number in cause.effect.parameters}
    return all(
        (cause.name, key) in fit.shapes or value == default[key] for key, value in cause.shapes
    )


def scored(
    objective: Objective,
    fit: Linearisation,
    free: NDArray[np.int64],
    wanted: Sequence[CandidateCause],
    derivatives: Floats,
    seed: int,
) -> ScoreTest:
    """Scores of ``wanted``, whose ``derivatives`` (K, C) are given, beside what is ``free``."""
    one_sided = [c.gain.one_sided for c in wanted]
    test = score_test(fit, free, objective.prior, derivatives, one_sided, seed)
    noise = EstimatedNoise(objective.noise_model, objective.stretches)
    return with_estimated_noise(test, noise, fit, free, objective.prior, derivatives, seed)


def spanned(
    objective: Objective, fits: Sequence[Linearisation], candidates: Sequence[CandidateCause]
) -> Objective:
    """The objective that judges by what every unknown and candidate changes at any of the fits."""
    parts, counts = list[Floats](), list[Floats]()
    for fit in fits:
        own, _ = next(by_shapes(fit, candidates))  # of these, the fit has derivatives already
        rest = [c for i, c in enumerate(candidates) if i not in own]
        count = np.ones(len(fit.theta))
        np.add.at(count, np.array([candidates[i].index for i in own], np.int64), 1.0)
        parts += [fit.psi, columns(objective, fit, rest)]
        counts += [count, np.ones(len(rest))]
    return objective.with_span(parts, SAME, counts)
