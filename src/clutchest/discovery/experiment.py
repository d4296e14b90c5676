"""The manoeuvre that would tell rivals apart, found by simulating each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from clutchest.discovery.candidates import Candidate, settings
from clutchest.discovery.identifiable import distance
from clutchest.discovery.result import Experiment
from clutchest.discovery.score import Board, board
from clutchest.errors import ClutchestError
from clutchest.estimate.whole_log import Progress
from clutchest.identify.maximum import Fitter
from clutchest.identify.problem import Problem
from clutchest.models import told_apart_by
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

APART = 4.0  # standard deviations at which two causes are told apart
SEED = 1  # of the simulated manoeuvres


def propose(
    rivals: Sequence[tuple[Candidate, float]],
    vehicle: Vehicle,
    scenarios: Sequence[str],
    simulated: Callable[[str, dict[str, dict[str, float]]], Signals],
    problem_of: Callable[[Signals], Problem],
    progress: Progress | None = None,
) -> Experiment:
    """The manoeuvre in which the closest two of ``rivals`` (candidate, size in its unit) lie
    furthest apart, each judged by one simulated drive with the first rival in it."""
    names = " or ".join(c.name for c, _ in rivals)
    best, scenario = 0.0, None
    first, size = rivals[0]
    for k, name in enumerate(scenarios):
        if progress:
            progress(f"trying what '{name}' would tell", k / len(scenarios))
        values = {first.gain.key: size * first.gain.upper, **dict(first.shapes)}
        try:
            signals = simulated(name, {first.name: values})
            least = _least_distance(rivals, problem_of(signals))
        except ClutchestError:  # a cause of the user's own, or a manoeuvre that this size upsets
            continue
        if least > best:
            best, scenario = least, name
    if scenario is not None and best >= APART:
        return Experiment(
            f"drive '{scenario}': there {names} lie {best:.0f} standard deviations apart", scenario
        )
    sensor = told_apart_by(vehicle.model, [c.effect.equation for c, _ in rivals])
    return Experiment(f"no manoeuvre tells {names} apart on these signals: {sensor} would", None)


def _least_distance(rivals: Sequence[tuple[Candidate, float]], problem: Problem) -> float:
    """Between the closest two, by first order at the numbers that the drive was simulated with."""
    fitter = Fitter(problem)
    first, size = rivals[0]
    theta = np.zeros(len(problem.thetas))
    theta[problem.index(first.name, first.gain.key)] = size
    shapes = settings(tuple(c for c, _ in rivals))
    gains = [problem.index(c.name, c.gain.key) for c, _ in rivals]
    fitter.come(theta, shapes)
    look = fitter.lesson(theta, shapes, np.union1d(problem.nuisances, gains))
    scores: Board = board(look, problem.nuisances, fitter.prior, look.psi[:, gains],
                          [c.gain.one_sided for c, _ in rivals], SEED, draws=1)  # fmt: skip
    return min(distance(scores, i, rivals[i][1], k)
               for i in range(len(rivals)) for k in range(len(rivals)) if i != k)  # fmt: skip
