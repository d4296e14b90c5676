"""The manoeuvre that would separate rivals best, each simulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from clutchest.discovery.candidates import CandidateCause, settings
from clutchest.discovery.result import Experiment
from clutchest.errors import ClutchestError
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import ScoreTest, d_prime, score_test
from clutchest.models.machine import Machine
from clutchest.progress import Progress
from clutchest.signals import Signals

SEPARATED = 4.0  # standard deviations at which two causes are separated
SEED = 1  # of the simulated manoeuvres

Sized = tuple[CandidateCause, float]  # and its size, in its unit


def propose(
    rivals: Sequence[Sized],
    beside: Sequence[Sized],
    machine: Machine,
    simulated: Callable[[str, dict[str, dict[str, float]]], Signals],
    problem_of: Callable[[Signals], Problem],
    progress: Progress | None = None,
) -> Experiment:
    """The manoeuvre in which the closest two of ``rivals`` are separated best, each judged by one
    drive ``simulated`` with the first rival and the causes ``beside`` it that are certain."""
    names = " or ".join(c.name for c, _ in rivals)
    best, scenario, simulable, why = 0.0, None, False, ""
    hidden: dict[str, dict[str, float]] = {}
    for c, size in (rivals[0], *beside):  # two numbers of one effect may be among them
        hidden.setdefault(c.name, {}).update({c.gain.key: size * c.gain.upper, **dict(c.shapes)})
    scenarios = machine.scenario_names
    for k, name in enumerate(scenarios):
        if progress:
            progress(f"simulating '{name}'", k / len(scenarios))
        try:
            least = _least_distance(rivals, beside, problem_of(simulated(name, hidden)))
        except ClutchestError as error:  # a cause of the user's own, or too large for a manoeuvre
            why = str(error)
            continue
        simulable = True
        if least > best:
            best, scenario = least, name
    if scenario is not None and best >= SEPARATED:
        return Experiment(
            f"drive '{scenario}': it separates {names} by {best:.0f} standard deviations", scenario
        )
    sensor = machine.sensor_to_separate([c.effect.equation for c, _ in rivals])
    if not simulable:
        return Experiment(
            f"no manoeuvre could be simulated ({why}); {sensor} would separate {names}", None
        )
    return Experiment(f"no manoeuvre separates {names} with these signals: {sensor} would", None)


def _least_distance(rivals: Sequence[Sized], beside: Sequence[Sized], problem: Problem) -> float:
    """Between the closest two, by first order at the numbers that the drive was simulated with."""
    theta = np.zeros(len(problem.thetas))
    for c, size in (rivals[0], *beside):
        theta[problem.index(c.gain_name)] = size
    shapes = settings(tuple(c for c, _ in (*rivals, *beside)))
    gains = [problem.index(c.gain_name) for c, _ in rivals]
    certain = [problem.index(c.gain_name) for c, _ in beside]
    free = np.concatenate([problem.nuisances, certain]).astype(int)
    objective = Objective.of(problem)
    fit = objective.linearise_at(theta, shapes, np.union1d(free, gains))
    objective = objective.with_noise_of(fit)
    fit = objective.whitened(fit)
    scores: ScoreTest = score_test(
        fit,
        free,
        objective.prior,
        fit.psi[:, gains],
        [c.gain.one_sided for c, _ in rivals],
        SEED,
        draws=1,
    )
    return min(
        d_prime(scores.information, scores.one_sided, i, rivals[i][1], k)
        for i in range(len(rivals))
        for k in range(len(rivals))
        if i != k
    )
