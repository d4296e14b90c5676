"""From logs to an answer: identify, extend, measure."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

from clutchest import __version__
from clutchest.checked import checked
from clutchest.discovery.answer import (
    causes_of,
    distorted,
    rivals_of,
    sizes_by_effect,
    sizes_of,
    strongest_of,
    where_of,
)
from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.experiment_design import experiment_for, sensor_for
from clutchest.discovery.extension import can_be_stated, corrected, extend
from clutchest.discovery.foreseen import foreseen
from clutchest.discovery.form_correction import form_correction
from clutchest.discovery.goodness_of_fit import GoodnessOfFit, goodness_of_fit
from clutchest.discovery.held_out import names_of, with_signals_of
from clutchest.discovery.holdout_curves import HeldOutCurves
from clutchest.discovery.holdout_gain import carried, cross_validated_gain, held_out_gain
from clutchest.discovery.identifiable import identifiability, not_testable, untested_effects
from clutchest.discovery.misfit import misfit
from clutchest.discovery.outcome import Outcome
from clutchest.discovery.own_noise import loud, with_noise_of_likeliest
from clutchest.discovery.result import Cause, Discovery, Experiment, Identifiable
from clutchest.discovery.search import LEVEL, UNUSUAL, Search, begin, unlike_drives
from clutchest.discovery.segmentation import segmented
from clutchest.discovery.selected_gain import given_above
from clutchest.discovery.sentences import (
    doubtful,
    implausible,
    implausible_residuals,
    not_confirmed,
    sentence,
    still_distorted,
)
from clutchest.discovery.size_bias import with_biases
from clutchest.discovery.speed_agreement import Disagreement, disagreement
from clutchest.discovery.step_length import too_long
from clutchest.discovery.user_effects import user_effects
from clutchest.discovery.user_hypotheses import hypotheses
from clutchest.discovery.verdict import (
    HeldOut,
    SearchVerdict,
    errors_without_causes,
    judge,
    least_confirmed,
)
from clutchest.discovery.where import Where
from clutchest.estimate.credible import require_credible
from clutchest.inference.cores import shared
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.problem import Problem
from clutchest.inference.sensor_ends import off_ends
from clutchest.inference.unknowns import InitialState
from clutchest.inference.white_linearisation import Linearisation
from clutchest.memory import give_back
from clutchest.models.effects import Effect
from clutchest.models.effects.effect import TIME
from clutchest.models.error_term_effects import PREFIX, error_term_effects
from clutchest.progress import Progress
from clutchest.reading import Logs, as_signals
from clutchest.shown import counted
from clutchest.signals import Counts, Signals
from clutchest.vehicle import Vehicle, load_vehicle

OnIdentifiability = Callable[[tuple[Identifiable, ...]], None]


@checked
def discover(
    signals: Signals | Logs,
    vehicle: Vehicle | str | Path,
    *,
    holdout: Signals | Logs | None = None,
    effects_files: Sequence[str | Path] = (),
    progress: Progress | None = None,
    on_identifiability: OnIdentifiability | None = None,
) -> Discovery:
    """Errors of a ``vehicle``'s model on ``signals``: causes, the extended model and its gain.

    ``signals`` as read, or what ``read_log`` takes; ``vehicle`` as loaded, or what ``load_vehicle``
    takes.  ``holdout``: drives of the same vehicle on which the gain is measured, likewise.
    ``effects_files``: the user's own hypotheses, tested beside the library's.
    ``on_identifiability``: called with the identifiability of every effect, before any is fitted.
    Raises ClutchestError where the machine
    declares no error terms, the model cannot be driven by these signals, a wrong sign or unit, a
    swap or a dead sensor makes them contradict it, held-out drives lack some of them, or an effect
    of the user's cannot be tested.
    """
    vehicle = load_vehicle(vehicle)
    machine = vehicle.machine
    machine.supports("discover")
    own = user_effects(effects_files, vehicle)
    signals = as_signals(signals, vehicle)
    none = holdout is None or (isinstance(holdout, list | tuple) and not holdout)
    held_out = () if none else as_signals(holdout, vehicle).drives
    held_out = with_signals_of(signals, held_out, machine)
    effects = (*machine.effects.values(), *own, *error_term_effects(machine))
    if (off := disagreement(signals, vehicle)) is not None:
        signals, held_out = off.corrected(signals), tuple(map(off.corrected, held_out))
    doubts: list[str] = []
    for each in (signals, *held_out):
        doubts += require_credible(each, vehicle, "discover", progress)
    files = tuple(map(Path, effects_files))
    task = _Task(signals, held_out, vehicle, effects, files, progress, off, doubts)
    return _answer(task, on_identifiability)


@dataclass(frozen=True, slots=True)
class _Task:
    """A log and held-out drives of a vehicle, the effects to test, and the user's files; by what
    two speeds disagreed, which signals are without; in words, where they contradict the
    model."""

    signals: Signals
    held_out: tuple[Signals, ...]
    vehicle: Vehicle
    effects: tuple[Effect, ...]
    files: tuple[Path, ...]
    progress: Progress | None
    off: Disagreement | None
    doubts: Sequence[str]

    @property
    def own(self) -> list[Effect]:
        """The user's effects."""
        return [e for e in self.testable if e.name not in self.vehicle.machine.effects]

    @property
    def testable(self) -> list[Effect]:
        """The library's and the user's effects, without error terms."""
        return [e for e in self.effects if not e.name.startswith(PREFIX)]

    def problem(self, signals: Signals) -> Problem:
        """Some drives, and all that is unknown of them."""
        given = segmented(signals, self.vehicle), self.vehicle, self.effects, self.progress
        problem = with_fitted_gains(Problem.of(*given, discrepant=True, input_noise=False))
        give_back()  # of an hour, preparing it took 200 MiB for a moment
        return problem

    def with_disagreement(
        self, outcome: Outcome, where: Where | None
    ) -> tuple[Outcome, Where | None]:
        """What was found and where, where no cause has a name behind the speeds' disagreement."""
        if self.off is None or outcome.named:
            return outcome, where
        return replace(outcome, name="unknown"), self.off.before(where)

    def foreseen(self, begun: float) -> _Task:
        """The same whose progress says how long it may take, by what took from ``begun`` s on."""
        return replace(self, progress=foreseen(self.progress, begun)) if self.progress else self

    def show(self, text: str) -> None:
        """Report progress."""
        if self.progress:
            self.progress(text, None)


def _answer(task: _Task, on_identifiability: OnIdentifiability | None) -> Discovery:
    """Identify causes, extend the vehicle with them, and measure the gain."""
    begun = perf_counter()
    first = [with_noise_of_likeliest(begin(task.problem(task.signals), task.progress))]
    problem = first[0].problem
    task = task.foreseen(begun)
    identifiable = (
        *identifiability(first[0].candidates, problem.units, first[0].null_scores, LEVEL),
        *not_testable(problem, task.testable),
    )
    if on_identifiability:
        on_identifiability(identifiable)
    other = _other(task, first[0])
    verdict = judge(first.pop(), other, task.progress)  # of an hour, its span is 40 MiB
    search = verdict.search
    before = search.objective.innovations_at(search.null.fit.theta).without_derivatives
    outcome = _outcome(task, verdict, other)
    after = verdict.best.fit if outcome.named else before
    task.show("testing the residuals")
    fit, fit_extended = _tested(search, [before, after] if outcome.named else [before])
    left = fit_extended or fit
    if doubted := outcome.name != "unknown" and left.outweighs(search.null.cost - after.cost):
        outcome, after, fit_extended = outcome.doubted_at(search), before, None
    verdict = with_biases(verdict, task.signals) if outcome.named else verdict
    causes = outcome.with_forms(causes_of(verdict)) if outcome.named else ()
    peaks = task.vehicle.machine.peaks
    where = where_of(outcome.name, causes, outcome.errors, verdict.others, verdict.instead, peaks)
    outcome, where = task.with_disagreement(outcome, distorted(left) if doubted else where)
    excited = any(each.excited for each in identifiable)
    above = loud(after, search.objective)
    extended, curve, refused = _extended(task, verdict, outcome, causes)
    return Discovery(
        vehicle=task.vehicle,
        verdict=outcome.name,
        sentence=sentence(outcome.name, verdict.sets, causes, where, left, above, excited),
        causes=causes,
        sets=tuple(h.effects for h in verdict.sets) if outcome.named else (),
        rivals=rivals_of(problem, verdict) if outcome.named else (),
        where=where,
        identifiability=identifiable,
        gain=outcome.gain,
        experiment=_experiment(task, verdict, outcome, where),
        misfit=misfit(search.objective, before, after),
        fit=fit,
        fit_extended=fit_extended,
        extended=extended,
        curve=curve,
        counts=sum((drive.counts for drive in task.signals.drives), Counts()),
        warnings=_warnings(task, verdict, outcome, causes, refused, above, after, fit_extended),
        provenance=_provenance(task, problem),
        hypotheses=hypotheses(verdict, outcome.name, causes, task.own),
        strongest=strongest_of(outcome.errors, peaks) if where is None or where.distorted else None,
    )


def _warnings(
    task: _Task,
    verdict: SearchVerdict,
    outcome: Outcome,
    causes: Sequence[Cause],
    refused: Sequence[str],
    above: Mapping[str, float],
    after: Linearisation,
    fit_extended: GoodnessOfFit | None,
) -> tuple[str, ...]:
    """What is to be said beside the answer; ``after``: the fit with the causes that are named,
    whose residuals are so far ``above`` the noise, as :func:`loud` has it."""
    search, machine = verdict.search, task.vehicle.machine
    acts = verdict.best if outcome.named else search.null
    return (
        *task.doubts,
        *(unlike_drives(search, acts) if task.signals.later else ()),
        *_untested(task, search, verdict.best),
        *map(not_confirmed, verdict.dropped),
        *outcome.warnings,
        *implausible_residuals(above, machine.sensors),
        *([] if machine.template else too_long(search.problem, after)),
        *(words for c in causes for words in implausible(c, task.effects)),
        *refused,
        *([still_distorted(fit_extended)] if fit_extended and fit_extended.rejects else []),
    )


def _tested(
    search: Search, fits: Sequence[Linearisation]
) -> tuple[GoodnessOfFit, GoodnessOfFit | None]:
    """Whether the model fits without a cause, and with causes where there is a second fit."""
    rest = [search.objective.less_scatter(fit) for fit in fits]
    first, *second = shared(lambda each: goodness_of_fit(search.problem, each), rest)
    return first, second[0] if second else None


def _outcome(task: _Task, verdict: SearchVerdict, other: HeldOut | None) -> Outcome:
    """The verdict, measured on held-out drives, which may reject it."""
    outcome = Outcome(verdict.name, verdict.errors, None, None)
    if verdict.name == "none":
        return outcome if other else replace(outcome, warnings=doubtful(verdict.errors))
    task.show("measuring the gain on held-out data")
    if verdict.name == "unknown":
        outcome = _unnamed(task, verdict, other)
    elif other is None:
        outcome = replace(outcome, gain=cross_validated_gain(verdict.search, verdict.best))
    else:
        outcome = replace(outcome, gain=held_out_gain(verdict.search, verdict.best, other()))
    gain = outcome.gain
    if gain is not None and gain.other_logs:
        least = least_confirmed(verdict)
        if gain.total < least:
            return _rejected(verdict, outcome)
        outcome = replace(outcome, gain=given_above(gain, least))
    if not outcome.named:
        return outcome
    curve, added = form_correction(verdict, other)
    return replace(outcome, curve=curve, added=added)


def _rejected(verdict: SearchVerdict, outcome: Outcome) -> Outcome:
    """What held-out drives have rejected."""
    what = " and ".join(sorted(verdict.best.names))
    if verdict.unnamed:
        what = f"an error in '{outcome.errors[0].equation}'"
    errors = outcome.errors if verdict.unnamed else errors_without_causes(verdict.search)
    return Outcome("none", errors, None, None, (not_confirmed(what),))


def _unnamed(task: _Task, verdict: SearchVerdict, other: HeldOut | None) -> Outcome:
    """The errors as curves, those of the leading equation as held-out drives rank them; the one
    that stands for a cause without a name, and what it gains there."""
    errors, search = verdict.errors, verdict.search
    machine, model = task.vehicle.machine, search.problem.compiled.model
    first = {c.covariate: c for c in reversed(errors) if c.equation == errors[0].equation}
    leading = list(first.values())
    usable = [can_be_stated(c, machine, model) for c in leading]
    if other is None:
        lasting = [c for c, can in zip(leading, usable, strict=True) if can and c.covariate != TIME]
        curve = max(lasting, key=lambda c: c.evidence, default=None)
        return Outcome("unknown", errors, curve, None)
    held_out = HeldOutCurves.of(search, leading, other())
    curve, gain = held_out.best(usable)
    return Outcome("unknown", [*held_out.ranked(), *errors], curve, gain)


def _extended(
    task: _Task, verdict: SearchVerdict, outcome: Outcome, causes: Sequence[Cause]
) -> tuple[Vehicle, str | None, list[str]]:
    """The extended vehicle, the name of its curve, and why it was refused where it was."""
    if outcome.gain is not None and outcome.gain.total < 0.0:
        return (
            task.vehicle,
            None,
            [
                "the extension makes the prediction of held-out data worse: extended.toml is the "
                "original vehicle"
            ],
        )
    search = verdict.search
    acts = verdict.best if outcome.named else search.null  # if ambiguous, the most likely set
    extends = outcome.named or outcome.curve is not None
    beside = corrected(search, acts, acts.fit.theta - verdict.bias(acts)[0]) if extends else {}
    sizes = {**beside, **sizes_by_effect(acts, sizes_of(causes))}
    extended, curve = extend(search.problem, sizes, outcome.curve, task.files)
    return task.off.stated(extended) if task.off else extended, curve, []


def _untested(task: _Task, search: Search, best: CauseSet) -> list[str]:
    """In words, what the vehicle file says of itself, which parts of the log and which effects
    could not be tested; and where a drive starts unlike one at rest, as the ``best`` has it."""
    problem = search.problem
    words = [
        *task.vehicle.machine.reserved("discover"),
        *task.vehicle.notes,
        *task.signals.warnings,
        *(task.off.words if task.off else ()),
        *untested_effects(problem, task.testable),
    ]
    if more := len(problem.drives) - len(task.signals.drives):
        words.append(
            f"{counted(more, 'gap')} in which heat may have been generated unobserved: "
            "the data after each are treated as a separate drive"
        )
    # without a cause, a start may stand in for it
    for i in (i for i in search.unusual_starts if abs(best.fit.theta[i]) > UNUSUAL):
        start, off = problem.thetas[i], best.fit.theta[i] * problem.units[i]
        assert isinstance(start, InitialState)
        words.append(
            f"{start.state} starts {off:+.0f} K from its value at rest: the log "
            "does not begin at the start of a drive"
        )
    return words


def _other(task: _Task, search: Search) -> HeldOut | None:
    if not task.held_out:
        return None
    first, *later = task.held_out
    drives, own, fit = replace(first, later=tuple(later)), search.problem, search.null.fit

    def other() -> Problem:
        """Held-out drives, whose fits begin where the one without a cause has the vehicle."""
        problem = task.problem(drives)
        return off_ends(problem, carried(own, fit, problem))

    return cache(other)


def _experiment(
    task: _Task, verdict: SearchVerdict, outcome: Outcome, where: Where | None
) -> Experiment | None:
    """What would separate the causes, where they are ambiguous, or equations in one of which the
    error is."""
    if outcome.name == "ambiguous":
        return experiment_for(verdict, task.vehicle, task.progress)
    if where is None or not where.instead:
        return None
    return sensor_for(where.equation, where.instead[0].equation, task.vehicle.machine)


def _provenance(task: _Task, problem: Problem) -> dict[str, str]:
    return {
        "logs": names_of(task.signals.drives),
        "begun": task.signals.begun,
        "clutchest": __version__,
        "python": platform.python_version(),
        "numba": version("numba"),
        "vehicle": task.vehicle.name,
        "vehicle_hash": task.vehicle.hash,
        "held_out": names_of(task.held_out),
        "model_hash": problem.compiled.digest,
    }
