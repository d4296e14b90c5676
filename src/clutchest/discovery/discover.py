"""From logs to an answer: show, name, extend, measure."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from clutchest import __version__
from clutchest.discovery.error_term_effects import PREFIX, error_term_effects
from clutchest.discovery.experiment_design import propose
from clutchest.discovery.extension import can_be_stated, corrected, extend
from clutchest.discovery.holdout_curves import Transfer
from clutchest.discovery.holdout_gain import in_turns, on_another
from clutchest.discovery.identifiable import identifiability, untried
from clutchest.discovery.misfit import misfit
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import (
    Cause,
    Discovery,
    Experiment,
    Found,
    Gain,
    Identifiable,
    Rival,
    Where,
    either,
)
from clutchest.discovery.search import LEVEL, ODD, Hypothesis, Search
from clutchest.discovery.segmentation import segmented
from clutchest.discovery.user_effects import user_effects
from clutchest.discovery.verdict import HeldOut, Judged, judge, rejected_by_holdout
from clutchest.errors import ClutchestError
from clutchest.inference.map_fit import covariance
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import InitialState
from clutchest.models.effects import Effect
from clutchest.models.machine import Machine
from clutchest.progress import Progress
from clutchest.signals import Counts, Signals
from clutchest.vehicle import Vehicle, load_vehicle

MOST_RIVALS = 6
Tells = Callable[[tuple[Identifiable, ...]], None]
Told = Mapping[tuple[str, str], Found]  # (effect, key) → number


def discover(
    signals: Signals,
    vehicle: Vehicle | str | Path,
    *,
    holdout: Sequence[Signals] | Signals | None = None,
    effects_files: Sequence[Path] = (),
    progress: Progress | None = None,
    told: Tells | None = None,
) -> Discovery:
    """What the model of ``vehicle`` gets wrong on ``signals``, why, what to add and what it gains.

    ``holdout``: drives of the same vehicle on which the gain is measured.  ``effects_files``: the
    user's own causes, tried beside the library's.  ``told``: called with what these data can tell
    of every cause, before any is fitted.  Raises ClutchestError where the model cannot be driven by
    these signals, for drives held out that lack some of them, or for an effect of the user's that
    cannot be looked for.
    """
    vehicle = load_vehicle(vehicle)
    machine = vehicle.machine
    machine.supports("discover")
    own = user_effects(effects_files, vehicle)
    drives = [] if holdout is None else [holdout] if isinstance(holdout, Signals) else holdout
    other = _alike(signals, [drive for each in drives for drive in each.drives], machine)
    effects = (*machine.effects.values(), *own, *error_term_effects(machine))
    finding = _Finding(signals, other, vehicle, effects, tuple(effects_files), progress, told)
    return finding.answer()


@dataclass
class _Finding:
    signals: Signals
    held_out: tuple[Signals, ...]
    vehicle: Vehicle
    effects: tuple[Effect, ...]
    files: tuple[Path, ...]
    progress: Progress | None
    told: Tells | None

    def problem(self, signals: Signals) -> Problem:
        drives = segmented(signals, self.vehicle)
        return Problem.of(drives, self.vehicle, self.effects, self.progress)

    def answer(self) -> Discovery:
        """The four questions in order."""
        search = Search.begin(self.problem(self.signals), self.progress)
        problem = search.problem
        tells = (
            *identifiability(search.all, problem.units, search.first, LEVEL),
            *self._untold(problem),
        )
        if self.told:
            self.told(tells)
        other = self._other()
        judged = judge(search, other, self.progress)
        verdict, errors, curve, gained = judged.verdict, judged.errors, None, None
        warnings = [
            *self.vehicle.notes,
            *self._unseen(search, judged.best),
            *map(_not_borne_out, judged.dropped),
        ]
        if verdict == "unknown":
            errors, curve, gained = self._borne_out(search, errors, other)
        elif verdict != "none":
            gained = self._gain(search, other)
        if gained is not None and gained.other_logs and rejected_by_holdout(search, judged, gained):
            what = (
                f"an error in '{errors[0].equation}'"
                if judged.unnamed
                else " and ".join(sorted(judged.best.names))
            )
            warnings.append(_not_borne_out(what))
            verdict, curve, gained = "none", None, None
        named = verdict in ("named", "ambiguous")
        causes = self._causes(search, judged) if named else ()
        warnings += [words for c in causes for words in _implausible(c, self.effects)]
        where = _where(verdict, judged.best, errors, self.vehicle.machine.peaks)
        told = {(c.effect, key): f for c in causes for key, f in c.parameters.items()}
        acts = judged.best if named else search.null  # of an ambiguous answer, the likeliest set
        beside = corrected(search, acts) if named or curve is not None else {}
        sizes = {**beside, **_sizes(acts, told)}
        extended, added = extend(problem, sizes, curve, self.files)
        if gained is not None and gained.total < 0.0:
            warnings.append(
                "the extension makes the prediction of held-out data worse: extended.toml is the "
                "original vehicle"
            )
            extended, added = self.vehicle, None
        before = search.objective.linearise_at(search.null.fit.theta)
        return Discovery(
            vehicle=self.vehicle,
            verdict=verdict,
            sentence=_sentence(verdict, judged, told, where, any(t.excited for t in tells)),
            causes=causes,
            sets=tuple(_names_of(h) for h in judged.sets) if named else (),
            rivals=_rivals(problem, judged) if named else (),
            where=where,
            identifiability=tells,
            gain=gained,
            experiment=self._experiment(judged) if verdict == "ambiguous" else None,
            misfit=misfit(search.objective, before, judged.best.fit if named else before),
            extended=extended,
            curve=added,
            counts=sum((drive.counts for drive in self.signals.drives), Counts()),
            warnings=tuple(warnings),
            provenance=self._provenance(problem),
        )

    @property
    def _known(self) -> list[Effect]:
        """The library's and the user's."""
        return [e for e in self.effects if not e.name.startswith(PREFIX)]

    def _untold(self, problem: Problem) -> list[Identifiable]:
        """The same of effects that the equations of these signals cannot have: nothing shows."""
        there = {*problem.effects, *self.vehicle.effects}
        return [
            Identifiable(e.name, e.gains[0].unit, None, e.gains[0].upper, None, None)
            for e in self._known
            if e.name not in there
        ]

    def _unseen(self, search: Search, best: Hypothesis) -> list[str]:
        """In words, what of the log and of the effects could not be looked at; where a log begins,
        as the ``best`` has it."""
        problem = search.problem
        words = [*self.signals.warnings, *untried(problem, self._known)]
        if more := len(problem.drives) - len(self.signals.drives):
            words.append(
                f"{more} gap(s) in which the clutch may have slipped unobserved: "
                "the data after each are treated as a separate drive"
            )
        # without a cause, a start may stand in for it
        for i in (i for i in search.running if abs(best.fit.theta[i]) > ODD):
            start, off = problem.thetas[i], best.fit.theta[i] * problem.units[i]
            assert isinstance(start, InitialState)
            words.append(
                f"{start.state} starts {off:+.0f} K from that of a clutch at rest: the log "
                "does not begin at the start of a drive"
            )
        return words

    def _other(self) -> HeldOut | None:
        if not self.held_out:
            return None
        first, *later = self.held_out
        return cache(lambda: self.problem(replace(first, later=tuple(later))))

    def _causes(self, search: Search, judged: Judged) -> tuple[Cause, ...]:
        """Those of the likeliest set first; of an effect in several sets, each number as it is in
        the first that has it."""
        found: dict[str, Cause] = {}
        for h in judged.sets:
            spread = judged.spreads[h.names]
            fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes)
            # of a signal that is late, the tolerance is part of what was found
            within = search.problem.tolerances(c.index for c in h.chosen)
            free = np.setdiff1d(search.free(h.chosen), within)
            std = np.sqrt(np.diag(covariance(search.objective, fit, free)) + spread.variance[free])
            for c in h.chosen:
                unit = search.problem.units[c.index]
                of_noise, clock = std[free == c.index][0] * unit, search.problem.clock(c.index)
                numbers = {
                    c.gain.key: Found(
                        float(fit.theta[c.index] * unit), float(np.hypot(of_noise, clock))
                    )
                }
                numbers |= {
                    key: Found(value, spread.std.get((c.name, key), 0.0)) for key, value in c.shapes
                }
                if c.name in found:
                    numbers |= found[c.name].parameters
                    found[c.name] = replace(found[c.name], parameters=numbers)
                else:
                    brings = search.established(c, h)
                    found[c.name] = Cause(c.name, c.effect.equation, numbers, *brings)
        return tuple(found.values())

    def _gain(self, search: Search, other: HeldOut | None) -> Gain:
        """What is gained by the causes; on parts of the log where no other is held out."""
        if self.progress:
            self.progress("measuring the gain on data held out", None)
        if other is None:
            return in_turns(search, search.best)
        return on_another(search, search.best, other())

    def _borne_out(
        self, search: Search, errors: list[Curve], other: HeldOut | None
    ) -> tuple[list[Curve], Curve | None, Gain | None]:
        """The curves, those of the equation in question as the drives held out bear them out; the
        one that stands for a cause without a name, and what it gains there."""
        model = search.problem.compiled.model
        first = {c.covariate: c for c in reversed(errors) if c.equation == errors[0].equation}
        leading = list(first.values())
        followed = [can_be_stated(c, self.vehicle.machine, model) for c in leading]
        if other is None:
            mean_the_same = [
                c for c, can in zip(leading, followed, strict=True) if can and c.covariate != "time"
            ]
            return errors, max(mean_the_same, key=lambda c: c.evidence, default=None), None
        if self.progress:
            self.progress("measuring the gain on data held out", None)
        transfer = Transfer.of(search, leading, other())
        curve, gained = transfer.patch(followed)
        return [*transfer.ranked(), *errors], curve, gained

    def _experiment(self, judged: Judged) -> Experiment:
        from clutchest.generator import SCENARIOS
        from clutchest.simulated import simulate

        common = set.intersection(*({c.index for c in h.chosen} for h in judged.sets))
        sized = [[(c, float(h.fit.theta[c.index])) for c in h.chosen] for h in judged.sets]
        rivals = [
            next((one for one in each if one[0].index not in common), each[0]) for each in sized
        ]
        beside = [one for one in sized[0] if one[0].index in common and one not in rivals]
        return propose(
            rivals,
            beside,
            self.vehicle,
            tuple(SCENARIOS),
            lambda name, effects: simulate(self.vehicle, name, 1, effects, nominal=True),
            self.problem,
            self.progress,
        )

    def _provenance(self, problem: Problem) -> dict[str, str]:
        return {
            "logs": _names(self.signals.drives),
            "clutchest": __version__,
            "python": platform.python_version(),
            "numba": version("numba"),
            "vehicle": self.vehicle.name,
            "vehicle_hash": self.vehicle.hash,
            "held_out": _names(self.held_out),
            "model_hash": problem.compiled.digest,
        }


def _alike(signals: Signals, other: Sequence[Signals], machine: Machine) -> tuple[Signals, ...]:
    """The drives held out with the signals of the log, no others.  Raises ClutchestError where one
    is a drive of the log, or lacks such a signal that its equations would be others."""
    used = frozenset.intersection(*(drive.available for drive in signals.drives))
    for drive in other:
        name = _names([drive]) or "a drive held out"
        if any(drive.has_samples_of(own) for own in signals.drives):
            raise ClutchestError(f"{name}: has the readings of the log, expected another drive")
        left = used & drive.available
        if machine.equations(left) is not machine.equations(used):
            raise ClutchestError(
                f"{name}: no valid sample of {', '.join(sorted(used - left))}, "
                "expected the signals of the log in what is held out"
            )
    return tuple(
        replace(drive, signals={name: drive[name] for name in used if name in drive})
        for drive in other
    )


def _not_borne_out(what: str) -> str:
    return (
        f"{what}: significant in the log, but not confirmed on held-out drives; attributed to noise"
    )


def _implausible(cause: Cause, effects: Sequence[Effect]) -> list[str]:
    """In words, sizes of which the data say that they are larger than is plausible."""
    effect = next(effect for effect in effects if effect.name == cause.effect)
    said = []
    for n in effect.gains:
        if (size := cause.parameters.get(n.key)) is None:
            continue
        nearest = min(max(size.value, n.lower), n.upper)
        if abs(size.value - nearest) > 2.0 * size.std:
            said.append(
                f"{cause.effect}: {n.key} = {size.value:.3g} ± {size.std:.2g} {n.unit} "
                f"is larger than plausible ({nearest:.3g})"
            )
    return said


def _names(drives: Sequence[Signals]) -> str:
    return ", ".join(Path(name).name for drive in drives for name in drive.sources)


def _rivals(problem: Problem, judged: Judged) -> tuple[Rival, ...]:
    """Those that lost, the likeliest first; one of whose causes nothing is left is none."""
    lost = [h for h in judged.lost if all(h.fit.theta[c.index] != 0.0 for c in h.chosen)]
    return tuple(
        Rival(
            " and ".join(_names_of(h)),
            h.cost - judged.limit,
            {
                f"{c.name}.{key}" if len(h.chosen) > 1 else key: value
                for c in h.chosen
                for key, value in (
                    (c.gain.key, float(h.fit.theta[c.index] * problem.units[c.index])),
                    *c.shapes,
                )
            },
        )
        for h in sorted(lost, key=lambda h: h.cost)[:MOST_RIVALS]
    )


def _where(
    verdict: str, best: Hypothesis, errors: Sequence[Curve], peaks: Mapping[str, str]
) -> Where | None:
    """The equation, and covariates ranked by how likely an error is that goes with them; a state
    stands for its ``peaks`` as well."""
    if verdict == "none":
        return None
    equation = errors[0].equation if verdict == "unknown" else best.chosen[0].effect.equation
    ranked = [c.covariate for c in errors if c.equation == equation]
    names = dict.fromkeys(peaks.get(covariate, covariate) for covariate in ranked)
    return Where(equation, tuple(names), peak=bool(ranked) and ranked[0] in peaks)


def _sentence(verdict: str, judged: Judged, told: Told, where: Where | None, excited: bool) -> str:
    """The answer in words, with the numbers ``told``; ``excited``: whether the data could show any
    cause at all."""
    if verdict == "none" and not excited:
        return "These data excite no known cause: they neither confirm nor refute the model."
    if verdict == "none":
        return "The model explains these data: no error is detectable in them."
    if verdict == "unknown":
        assert where is not None
        first = where.covariates[0] if where.covariates else ""
        first = f"the highest {first} so far" if where.peak else first
        correlates = f" that correlates with {first}" if first else ""
        return (
            f"The equation '{where.equation}' has an error{correlates}, and no known cause "
            "explains it."
        )
    required = either([_with_sizes(h, told) for h in judged.sets])
    which = "; they do not separate these" if verdict == "ambiguous" else ""
    return f"The data require {required}{which}."


def _names_of(h: Hypothesis) -> tuple[str, ...]:
    return tuple(dict.fromkeys(c.name for c in h.chosen))


def _sizes(h: Hypothesis, told: Told) -> dict[str, dict[str, Found]]:
    """Effect → key → number of a hypothesis' effects."""
    found: dict[str, dict[str, Found]] = {}
    for c in h.chosen:
        for key in (c.gain.key, *(key for key, _ in c.shapes)):
            found.setdefault(c.name, {})[key] = told[c.name, key]
    return found


def _with_sizes(h: Hypothesis, told: Told) -> list[str]:
    """Names of a hypothesis' effects with their numbers."""
    effects = {c.name: c.effect for c in h.chosen}
    words = []
    for name, sizes in _sizes(h, told).items():
        units = {n.key: n.unit for n in effects[name].parameters}
        numbers = [
            f"{key} = {f.value:.3g} ± {f.std:.2g} {units[key]}".removesuffix(" 1")
            for key, f in sizes.items()
        ]
        meanings = [
            w.of(sizes[key].value) for key, w in effects[name].wording.items() if key in sizes
        ]
        words.append(f"{name} ({'; '.join([', '.join(numbers), *meanings])})")
    return words
