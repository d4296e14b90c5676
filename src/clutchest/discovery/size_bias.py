"""Sizes without what noise of the readings shifts them by."""

from __future__ import annotations

from dataclasses import replace

from clutchest.discovery.segmentation import segmented
from clutchest.discovery.verdict import SearchVerdict
from clutchest.inference.noise_bias import noise_bias, with_noise_again
from clutchest.signals import Signals


def with_biases(verdict: SearchVerdict, signals: Signals) -> SearchVerdict:
    """A verdict on the drives of ``signals`` with the bias of its sets' numbers, where tracked
    states take noise of the inputs in throughout."""
    search = verdict.search
    problem = search.problem
    if not problem.compiled.model.tracked:
        return verdict
    again, biases = with_noise_again(problem, segmented(signals, problem.vehicle)), {}
    for h in verdict.sets:
        free = search.free(h.causes)
        fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes, free)
        biases[h.names] = noise_bias(search.objective, again, fit, free)
    return replace(verdict, biases=biases)
