"""The manoeuvre that would separate rivals best, as the model foresees it.

A manoeuvre is what driver and control unit of a healthy vehicle do in it; what causes would change
there is computed from the estimator's own equations, so that nothing but the model decides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from clutchest.discovery.candidates import CandidateCause, settings
from clutchest.discovery.result import Experiment
from clutchest.discovery.segmentation import segmented
from clutchest.discovery.verdict import SearchVerdict
from clutchest.discovery.where import place_words
from clutchest.errors import ClutchestError
from clutchest.estimate.other_bench import on_other_bench
from clutchest.inference.cores import shared
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import ScoreTest, d_prime, score_test
from clutchest.models.machine import Machine
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

SEPARATED = 4.0  # standard deviations at which two causes are separated
SEED = 1  # of the simulated manoeuvres
STEPS = 2.5e5  # of the equations, over which a manoeuvre is judged: what comes later is not seen

Sized = tuple[CandidateCause, float]  # and its size, in its unit


def experiment_for(
    verdict: SearchVerdict, vehicle: Vehicle, progress: Progress | None = None
) -> Experiment:
    """The manoeuvre that separates the sets of causes of a verdict."""
    from clutchest.simulated import simulate

    common = set.intersection(*({c.index for c in h.causes} for h in verdict.sets))
    sized = [[(c, float(h.fit.theta[c.index])) for c in h.causes] for h in verdict.sets]
    rivals = [next((one for one in each if one[0].index not in common), each[0]) for each in sized]
    beside = [one for one in sized[0] if one[0].index in common and one not in rivals]
    effects = list({c.effect.name: c.effect for c, _ in (*rivals, *beside)}.values())
    longest = verdict.search.problem.compiled.model.longest[0]

    def problem_of(drive: Signals) -> Problem:
        if (elsewhere := on_other_bench(drive, vehicle)) is not None:
            raise ClutchestError(f"{elsewhere.words}: {elsewhere.explanation}")
        return Problem.of(segmented(drive, vehicle), vehicle, effects, discrepant=True)

    return propose(
        rivals,
        beside,
        vehicle.machine,
        lambda name: beginning(simulate(vehicle, name, 1, nominal=True), longest),
        problem_of,
        progress,
    )


def sensor_for(one: str, other: str, machine: Machine) -> Experiment:
    """The sensor that would tell in which of two equations an error is."""
    sensor, places = machine.sensor_to_separate([one, other]), map(place_words, (one, other))
    return Experiment(f"{sensor} would tell whether the error is in {' or in '.join(places)}", None)


def propose(
    rivals: Sequence[Sized],
    beside: Sequence[Sized],
    machine: Machine,
    driven: Callable[[str], Signals],
    problem_of: Callable[[Signals], Problem],
    progress: Progress | None = None,
) -> Experiment:
    """The manoeuvre in which the closest two of ``rivals`` are separated best, the first of them
    and the causes ``beside`` it that are certain being there; each judged by one drive of a healthy
    vehicle, ``driven`` by its name."""
    names = " or ".join(c.name for c, _ in rivals)
    scenarios = [name for name in machine.scenario_names if not machine.on_other_bench(name)]
    refused = list[str]()

    def judged(name: str) -> float:
        if progress:
            progress(f"simulating '{name}'", scenarios.index(name) / len(scenarios))
        try:
            return _least_distance(rivals, beside, problem_of(driven(name)))
        except ClutchestError as error:
            refused.append(str(error))
            return 0.0

    distances = dict(zip(scenarios, shared(judged, scenarios), strict=True))
    best = max(distances, key=lambda name: distances[name], default="")
    if best and distances[best] >= SEPARATED:
        how = machine.manoeuvres.get(best)
        driven_so = f". How to drive it: {how}" if how else ""
        return Experiment(
            f"drive '{best}': it separates {names} by {distances[best]:.0f} standard deviations "
            f"(the expected d′; {SEPARATED:g} are enough){driven_so}",
            best,
        )
    sensor = machine.sensor_to_separate([c.effect.equation for c, _ in rivals])
    if len(refused) == len(scenarios):
        why = refused[-1] if refused else "the machine has none"
        return Experiment(
            f"no manoeuvre could be simulated ({why}); {sensor} would separate {names}", None
        )
    return Experiment(f"no manoeuvre separates {names} with these signals: {sensor} would", None)


def beginning(drive: Signals, longest: float) -> Signals:
    """As much of a drive as takes ``STEPS`` steps of ``longest`` s: of fast equations, ten minutes
    would take as long as all other manoeuvres together."""
    first = min(signal.time[0] for signal in drive.values() if len(signal.time))
    return drive.between(end=first + STEPS * longest)


def _least_distance(rivals: Sequence[Sized], beside: Sequence[Sized], problem: Problem) -> float:
    """Between the closest two, by first order at the sizes that they have; noise is that of the
    drive itself, in which there is none of them."""
    theta = np.zeros(len(problem.thetas))
    for c, size in (rivals[0], *beside):
        theta[problem.index(c.gain_name)] = size
    shapes = settings(tuple(c for c, _ in (*rivals, *beside)))
    gains = [problem.index(c.gain_name) for c, _ in rivals]
    certain = [problem.index(c.gain_name) for c, _ in beside]
    free = np.concatenate([problem.nuisances, certain]).astype(int)
    objective = Objective.of(problem)
    at = objective.linearise_at(np.zeros(len(theta)), shapes)
    objective = objective.with_noise_of(at).with_discrepancies(at)
    fit = objective.linearise_at(theta, shapes, np.union1d(free, gains))
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
