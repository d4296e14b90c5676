"""Whether several drives can be of one vehicle, whose parameters are the same in all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.objective import Objective
from clutchest.inference.score_test import ScoreTest, score_test
from clutchest.inference.unknowns import UnknownParameter
from clutchest.inference.white_linearisation import Linearisation

# Chance that noise makes drives of one vehicle differ so.  Scores are of the first order: of 50
# pairs of drives of one vehicle the least had 3e-4, of 24 pairs of two all but one below 1e-5.
CHANCE = 1e-5
SEED = 20_261_130


def unlike(objective: Objective, lin: Linearisation, free: NDArray[np.int64]) -> Iterator[str]:
    """In words, that a parameter of the vehicle file is another one in one of several drives than
    in the others.

    ``lin`` with derivatives by all thetas, where the ``free`` ones (indices) are most probable.
    """
    problem = objective.problem
    count = len(problem.drives)
    own = [i for i in range(problem.shared) if isinstance(problem.thetas[i], UnknownParameter)]
    if count < 2 or not own:
        return
    tested = range(1 if count == 2 else count)  # of two, what one is off by the other is as well
    found = [_scores(objective, lin, free, own, drive) for drive in tested]
    drive = min(tested, key=lambda each: found[each].least_p)
    p = min(found[drive].least_p * len(tested), 1.0)
    if p >= CHANCE:
        return
    key = problem.thetas[own[int(np.argmax(np.abs(found[drive].z)))]]
    yield (
        f"the {count} drives differ from each other more than those of one vehicle, in {key} most "
        f"(p = {p:.2g}): logs of several vehicles, or one that was changed in between? Give the "
        "logs of each vehicle apart"
    )


def _scores(
    objective: Objective,
    lin: Linearisation,
    free: NDArray[np.int64],
    own: Sequence[int],
    drive: int,
) -> ScoreTest:
    """Scores of the ``own`` parameters (indices) of one ``drive`` alone."""
    edges = np.cumsum([0, *map(len, objective.weights)])
    columns = lin.by(np.array(own, np.int64)).copy()
    columns[: edges[drive]] = columns[edges[drive + 1] :] = 0.0
    return score_test(lin, free, objective.prior, columns, [False] * len(own), SEED + drive)
