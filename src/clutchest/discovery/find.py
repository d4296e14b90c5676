"""From logs to an answer: show, name, extend, measure."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from math import exp
from pathlib import Path

import numpy as np

from clutchest import __version__
from clutchest.discovery import patch
from clutchest.discovery.beyond import cause_beyond, model_beyond
from clutchest.discovery.candidates import Candidate
from clutchest.discovery.experiment import propose
from clutchest.discovery.gain import in_turns, on_another
from clutchest.discovery.holes import without_holes
from clutchest.discovery.identifiable import identifiability, untried
from clutchest.discovery.leftover import Curve, curves
from clutchest.discovery.misfit import misfit
from clutchest.discovery.probes import PREFIX, probes
from clutchest.discovery.result import (
    Cause,
    Discovery,
    Experiment,
    Found,
    Gain,
    Identifiable,
    Rival,
    Where,
)
from clutchest.discovery.search import LEVEL, MOST, Hypothesis, Search
from clutchest.discovery.shapes import Spread, refine
from clutchest.discovery.transfer import Transfer
from clutchest.errors import ClutchestError
from clutchest.estimate.whole_log import Progress
from clutchest.identify.maximum import Look
from clutchest.identify.problem import Problem
from clutchest.models import only_for, peaks_of
from clutchest.models.effects import Effect, effects_of_file, library
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle

# Family-wise chance that noise is taken for a cause without a name; several times as much in truth,
# as curves follow small errors of integration and of time stamps too (of 93 drives in which nothing
# is hidden, three came out below 0.001).
UNNAMED = 0.0001
MOST_RIVALS = 6
# Chance of noise from which on other drives may take a finding back.  Below, it is there in this
# log, whatever they say: a drive may have been spoilt by what passes.
SURE = 1e-5

Told = Callable[[tuple[Identifiable, ...]], None]


def discover(
    signals: Signals,
    vehicle: Vehicle | str | Path,
    *,
    holdout: Sequence[Signals] | Signals | None = None,
    effects_files: Sequence[Path] = (),
    progress: Progress | None = None,
    told: Told | None = None,
) -> Discovery:
    """What the model of ``vehicle`` gets wrong on ``signals``, why, what to add and what it gains.

    ``holdout``: drives of the same vehicle on which the gain is measured.  ``effects_files``: the
    user's own causes, tried beside the library's.  ``told``: called with what these data can tell
    of every cause, before any is fitted.  Raises ClutchestError where the model cannot be driven by
    these signals, or for an effect whose delay varies.
    """
    vehicle = load_vehicle(vehicle)
    only_for("dry_clutch", vehicle.model, "discover")
    own = [effect for path in effects_files for effect in effects_of_file(path).values()]
    if turning := [effect.name for effect in own if effect.lateness]:
        raise ClutchestError(f"'{turning[0]}' is late by more at one time than at another: nothing "
                             "to look for, but to be stated in the vehicle file")  # fmt: skip
    effects = (*library(vehicle.model).values(), *own, *probes(vehicle.model))
    finding = _Finding(signals, vehicle, effects, tuple(effects_files), progress, told)
    return finding.answer(holdout)


@dataclass
class _Finding:
    signals: Signals
    vehicle: Vehicle
    effects: tuple[Effect, ...]
    files: tuple[Path, ...]
    progress: Progress | None
    told: Told | None

    def problem(self, signals: Signals) -> Problem:
        return Problem(without_holes(signals, self.vehicle), self.vehicle, self.effects,
                       self.progress)  # fmt: skip

    def answer(self, holdout: Sequence[Signals] | Signals | None) -> Discovery:
        """The four questions in order."""
        search = Search.begin(self.problem(self.signals), self.progress)
        problem, before = search.problem, search.null.look
        tells = identifiability(search.all, problem.units, search.first, LEVEL)
        if self.told:
            self.told(tells)
        errors = self._left_over(search, before)
        if errors and _least(errors).p_value < UNNAMED and model_beyond(search):
            before = search.null.look
            errors = self._left_over(search, before)
        search.run(self.progress)
        for _ in range(MOST):  # a place that was left must not be come back to for ever
            if not cause_beyond(search):
                break
            search.run(self.progress)
            before = search.null.look
            errors = self._left_over(search, before)
        other = self._other(holdout)
        dropped = self._weeded(search, other)
        left = errors
        spreads, tied, best = refine(search), search.tied(), search.best
        if best.chosen:
            tied = [search.released(h).bare for h in tied]
            search.best = best = search.released(best)
            left = self._left_over(search, best.look, best.chosen)
            before = search.null.look
        unnamed = bool(left) and _least(left).p_value < UNNAMED
        if len(best.chosen) > 1:  # one curve may do as much as several causes
            before = search.fitter.arrive(before.theta)
            errors = self._left_over(search, before)
            most = max((curve.worth for curve in errors), default=0.0)
            unnamed |= most > search.null.cost - best.cost
        verdict = ("unknown" if unnamed else "none" if not best.chosen
                   else "ambiguous" if tied else "named")  # fmt: skip
        known = [e for e in self.effects if not e.name.startswith(PREFIX)]
        warnings = [*self.signals.warnings, *untried(problem, known)]
        if more := len(problem.drives) - len(self.signals.drives):
            warnings.append(f"{more} hole(s) through which the clutch may have slipped unseen: "
                            "what comes after one is taken for a drive of its own")  # fmt: skip
        warnings += map(_not_borne_out, dropped)
        curve, gained = None, None
        if verdict == "unknown":
            errors, curve, gained = self._borne_out(search, errors, other)
        elif verdict != "none":
            gained = self._gain(search, other)
        error = _least(errors) if unnamed else None
        if gained is not None and gained.other_logs and _gainsaid(search, error, gained):
            named = " and ".join(sorted(best.names))
            what = f"an error in '{errors[0].equation}'" if unnamed else named
            warnings.append(_not_borne_out(what))
            verdict, curve, gained = "none", None, None
        causes = (
            () if verdict in ("none", "unknown") else self._causes(search, [best, *tied], spreads)
        )
        warnings += [words for c in causes for words in _implausible(c, self.effects)]
        where = _where(verdict, best, errors, peaks_of(problem.compiled.model.name))
        extended, text = self._extended(problem, verdict, causes, curve)
        if gained is not None and gained.total <= 0.0:
            warnings.append("what was found does not pay on data held out: extended.toml is the "
                            "vehicle as it was")  # fmt: skip
            extended, text = self.vehicle, None
        experiment = None
        if verdict == "ambiguous":
            experiment = self._experiment(search, [best, *tied])
        rivals = [] if verdict in ("none", "unknown") else search.rivals
        shown = tuple(where.drivers[:2]) if where else ()
        over = tuple(dict.fromkeys((*shown, "temp_disc", "slip_speed", "slave_position", "time")))
        after = best.look if verdict in ("named", "ambiguous") else before
        return Discovery(
            vehicle=self.vehicle,
            verdict=verdict,
            sentence=_sentence(verdict, causes, where, any(tell.excited for tell in tells)),
            causes=causes,
            rivals=tuple(
                Rival(", ".join(sorted(h.names)), h.cost - best.cost,
                      {f"{c.name}.{c.gain.key}" if len(h.chosen) > 1 else c.gain.key:
                       float(h.look.theta[c.index] * problem.units[c.index]) for c in h.chosen})
                for h in rivals[:MOST_RIVALS]
            ),
            where=where,
            identifiability=tells,
            gain=gained,
            experiment=experiment,
            misfit=misfit(problem, search.fitter, before, after, over),
            extended=extended,
            patch=text,
            warnings=tuple(warnings),
            provenance=self._provenance(problem),
        )  # fmt: skip

    def _left_over(
        self, search: Search, look: Look, chosen: Sequence[Candidate] = ()
    ) -> list[Curve]:
        """What neither the nuisances nor the ``chosen`` causes explain at ``look``."""
        return curves(search.problem, search.fitter, look, search.free(chosen), seed=3)

    def _other(self, holdout: Sequence[Signals] | Signals | None) -> Callable[[], Problem] | None:
        """The drives held out, linearised when they are asked for."""
        if holdout is None:
            return None
        drives = holdout.drives if isinstance(holdout, Signals) else tuple(holdout)
        return cache(lambda: self.problem(replace(drives[0], later=tuple(drives[1:]))))

    def _weeded(self, search: Search, other: Callable[[], Problem] | None) -> list[str]:
        """Take back causes that might be noise beside others, and that the drives held out do not
        bear out: names."""
        dropped: list[str] = []
        if other is None:
            return dropped
        for cause in sorted(search.best.chosen, key=lambda c: -search.p_of.get(c.name, 0.0)):
            if len(search.best.chosen) == 1 or search.p_of.get(cause.name, 0.0) <= SURE:
                break
            fewer = search.without(cause)
            gained = on_another(search, search.best, other(), fewer)
            if gained.total <= 0.0 or not search.stays(2.0 * gained.total, fewer):
                search.settle_for(fewer)
                dropped.append(cause.name)
        return dropped

    def _causes(
        self, search: Search, hypotheses: Sequence[Hypothesis],
        spreads: Mapping[frozenset[str], Spread],
    ) -> tuple[Cause, ...]:  # fmt: skip
        found: dict[str, Cause] = {}
        for h in hypotheses:
            look, spread = search.fitter.arrive(h.look.theta, h.look.shapes), spreads[h.names]
            # of a signal that is late, the tolerance is part of what was found
            within = search.problem.tolerances(c.index for c in h.chosen)
            free = np.setdiff1d(search.free(h.chosen), within)
            std = np.sqrt(np.diag(search.fitter.covariance(look, free)) + spread.variance[free])
            for c in h.chosen:
                unit = search.problem.units[c.index]
                of_noise, clock = std[free == c.index][0] * unit, search.problem.clock(c.index)
                numbers = {c.gain.key: Found(float(look.theta[c.index] * unit),
                                             float(np.hypot(of_noise, clock)))}  # fmt: skip
                numbers |= {key: Found(value, spread.std.get((c.name, key), 0.0))
                            for key, value in c.shapes}  # fmt: skip
                found.setdefault(c.name, Cause(
                    c.name, c.effect.equation, numbers,
                    search.null.cost - h.cost, search.p_of.get(c.name, 0.0),
                ))  # fmt: skip
        return tuple(found.values())

    def _gain(self, search: Search, other: Callable[[], Problem] | None) -> Gain:
        """What is gained by the causes; on parts of the log where no other is held out."""
        if self.progress:
            self.progress("measuring the gain on data held out", None)
        if other is None:
            return in_turns(search, search.best)
        return on_another(search, search.best, other())

    def _borne_out(
        self, search: Search, errors: list[Curve], other: Callable[[], Problem] | None
    ) -> tuple[list[Curve], Curve | None, Gain | None]:
        """The curves, those of the equation in question as the drives held out bear them out; the
        one that stands for a cause without a name, and what it gains there."""
        model = search.problem.compiled.model
        first = {c.driver: c for c in reversed(errors) if c.equation == errors[0].equation}
        leading = list(first.values())
        followed = [patch.text(c, model) is not None for c in leading]
        if other is None:
            mean_the_same = [c for c, can in zip(leading, followed, strict=True)
                             if can and c.driver != "time"]  # fmt: skip
            return errors, max(mean_the_same, key=lambda c: c.evidence, default=None), None
        if self.progress:
            self.progress("measuring the gain on data held out", None)
        transfer = Transfer.of(search, leading, other())
        curve, gained = transfer.patch(followed)
        return [*transfer.ranked(), *errors], curve, gained

    def _extended(
        self, problem: Problem, verdict: str, causes: Sequence[Cause], curve: Curve | None
    ) -> tuple[Vehicle, str | None]:
        effects, files, text = dict(self.vehicle.effects), list(self.vehicle.effects_files), None
        if curve is not None:
            text = patch.text(curve, problem.compiled.model)
            if text is not None:
                effects[patch.NAME] = {"size": 1.0}
                files.append(Path(patch.FILE))
        # of an ambiguous set the likeliest one stands in the model
        for cause in causes[: 1 if verdict == "ambiguous" else None]:
            effects[cause.effect] = {key: f.value for key, f in cause.parameters.items()}
        used = {effect for effect in effects if effect not in library(self.vehicle.model)}
        for path in self.files:
            if used & set(effects_of_file(path)):
                files.append(path.resolve())
        return replace(self.vehicle, effects=effects, effects_files=tuple(files)), text

    def _experiment(self, search: Search, hypotheses: Sequence[Hypothesis]) -> Experiment:
        from clutchest.generator import SCENARIOS
        from clutchest.simulated import simulate

        common = frozenset.intersection(*(h.names for h in hypotheses))
        rivals = [
            next(((c, float(h.look.theta[c.index])) for c in h.chosen if c.name not in common),
                 (h.chosen[0], float(h.look.theta[h.chosen[0].index])))
            for h in hypotheses
        ]  # fmt: skip
        return propose(
            rivals, self.vehicle, tuple(SCENARIOS),
            lambda name, effects: simulate(self.vehicle, name, 1, effects, nominal=True),
            self.problem, self.progress,
        )  # fmt: skip

    def _provenance(self, problem: Problem) -> dict[str, str]:
        logs = (Path(name).name for drive in self.signals.drives for name in drive.sources)
        return {
            "logs": ", ".join(logs),
            "clutchest": __version__,
            "python": platform.python_version(),
            "numba": version("numba"),
            "vehicle": self.vehicle.name,
            "vehicle_hash": self.vehicle.hash,
            "model_hash": problem.compiled.digest,
        }


def _not_borne_out(what: str) -> str:
    return (f"{what}: seemed to be there, and the drives held out do not bear it out; "
            "taken for noise")  # fmt: skip


def _implausible(cause: Cause, effects: Sequence[Effect]) -> list[str]:
    """In words, sizes of which the data say that they are larger than is plausible."""
    effect = next(effect for effect in effects if effect.name == cause.effect)
    said = []
    for n in effect.gains:
        if (size := cause.parameters.get(n.key)) is None:
            continue
        nearest = min(max(size.value, n.lower), n.upper)
        if abs(size.value - nearest) > 2.0 * size.std:
            said.append(f"{cause.effect}: {n.key} = {size.value:.3g} ± {size.std:.2g} {n.unit} "
                        f"is more than is plausible ({nearest:.3g})")  # fmt: skip
    return said


def _least(errors: Sequence[Curve]) -> Curve:
    return min(errors, key=lambda c: c.p_value)


def _gainsaid(search: Search, error: Curve | None, gained: Gain) -> bool:
    """Whether a finding, an ``error`` where it has no name, might be noise and is none when what
    other drives ``gained`` counts as well."""
    more = 2.0 * gained.total
    if error is not None:
        likelier = exp(min(-more / 2.0, 700.0))
        return error.p_value > SURE and error.p_value * likelier > UNNAMED
    p = max(search.p_of.get(name, 0.0) for name in search.best.names)
    return p > SURE and not search.stays(more)


def _where(
    verdict: str, best: Hypothesis, errors: Sequence[Curve], peaks: Mapping[str, str]
) -> Where | None:
    """The equation, and drivers ranked by how likely an error is that goes with them; a state
    stands for its ``peaks`` as well."""
    if verdict == "none":
        return None
    equation = errors[0].equation if verdict == "unknown" else best.chosen[0].effect.equation
    ranked = [c.driver for c in errors if c.equation == equation]
    names = dict.fromkeys(peaks.get(driver, driver) for driver in ranked)
    return Where(equation, tuple(names), peak=bool(ranked) and ranked[0] in peaks)


def _sentence(verdict: str, causes: Sequence[Cause], where: Where | None, excited: bool) -> str:
    """The answer in words; ``excited``: whether the data could show any cause at all."""
    if verdict == "none" and not excited:
        return "These data cannot show any known cause: they say nothing for or against the model."
    if verdict == "none":
        return "The model explains these data: nothing is missing that they could show."
    if verdict == "unknown":
        assert where is not None
        with_ = f" and goes with {where.drivers[0]}" if where.drivers else ""
        with_ += ", the highest it has been" if where.peak else ""
        return (f"Something is wrong in the equation '{where.equation}'{with_}, "
                "and no known cause explains it.")  # fmt: skip
    words = []
    for c in causes:
        numbers = [f"{key} = {f.value:.3g} ± {f.std:.2g}" for key, f in c.parameters.items()]
        words.append(f"{c.effect} ({', '.join(numbers)})")
    if verdict == "named":
        return f"The model lacks {' and '.join(words)}."
    return f"The model lacks one of {', '.join(words)}; these data cannot tell which."
