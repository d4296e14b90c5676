"""What becomes of the curve that the data want beside a cause whose form is refuted: it joins the
effect in the extended model, unless held-out drives deny it."""

from __future__ import annotations

from collections.abc import Mapping

from clutchest.discovery.extension import can_be_stated
from clutchest.discovery.holdout_curves import HeldOutCurves
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.verdict import HeldOut, SearchVerdict


def form_correction(
    verdict: SearchVerdict, other: HeldOut | None
) -> tuple[Curve | None, Mapping[str, str]]:
    """The curve that is added beside the causes of the best set, None where none is; and by effect
    whose form is refuted, in words, what is added and why."""
    problem, best = verdict.search.problem, verdict.best
    machine, model = problem.vehicle.machine, problem.compiled.model
    words: dict[str, str] = {}
    curves: dict[str, Curve] = {}
    for name in best.effects:
        tested = verdict.forms[name]
        if not tested.form.refuted:
            continue
        if tested.curve is None or not can_be_stated(tested.curve, machine, model):
            words[name] = "no curve that a vehicle file can state stands for it: the effect alone"
        else:
            curves[name] = tested.curve
    if not curves:
        return None, words
    if other is None:
        first = max(curves, key=lambda name: verdict.forms[name].worth)
        words |= dict.fromkeys(curves, "the effect alone: one curve at a time is added")
        words[first] = "the effect and its curve; no held-out drives have confirmed it"
        return curves[first], words
    held_out = HeldOutCurves.of(verdict.search, list(curves.values()), other(), best)
    chosen, gain = held_out.best([True] * len(curves))
    for name, curve in curves.items():
        words[name] = "the curve of another form gains more: the effect alone"
        if curve is chosen and gain is not None:
            low, high = gain.ci95
            change = f"ln L by {gain.total:+.1f} [95 %: {low:.1f} to {high:.1f}]"
            added = "the effect and its curve" if gain.total > 0.0 else "the effect alone"
            words[name] = f"on held-out drives its curve changes {change}: {added}"
    return (chosen if gain is not None and gain.total > 0.0 else None), words
