"""Parameters of bench experiments once more, by the likelihood of the filter's innovations.

An experiment makes the errors of one equation least, of readings that were reduced to means, steps
or a path.  Beside it stands the fit that other machines' procedures make: all equations of the
machine, in the form that holds on the record's bench, against every reading.  Both rest on the same
readings; where they differ by more than their standard deviations, one of them leaves out what
matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.identify.bench_records import BenchRecords
from clutchest.identify.fit import Refit
from clutchest.identify.likelihood import Posterior, most_probable, problem_of
from clutchest.inference.unknowns import InitialState
from clutchest.progress import Progress
from clutchest.vehicle import Vehicle


def refits(
    keys: Sequence[str],
    benches: Sequence[str],
    records: BenchRecords,
    vehicle: Vehicle,
    progress: Progress,
) -> tuple[dict[str, Refit], list[str]]:
    """Each of the ``keys`` by the record that knows it best, of those on the ``benches``; and why a
    record could not be fitted."""
    found, notes = dict[str, Refit](), []
    for drive, section in records.sections:
        if section.bench not in benches:
            continue
        progress(f"fitting the record from {section.bench}", None)
        try:
            on_bench = replace(vehicle, bench=section.bench)
            part = drive.between(section.start, section.end)
            posterior = most_probable(problem_of(part, on_bench))
        except ClutchestError as problem:
            notes.append(f"refit of the record from {section.bench}: {problem}")
            continue
        for key in keys:
            of = posterior.of(key) or _start_of(posterior, key)
            if of is not None and (key not in found or of[1] < found[key].std):
                found[key] = Refit(*of, section.bench)
    return found, notes


def _start_of(posterior: Posterior, key: str) -> tuple[float, float] | None:
    """Value and standard deviation of a parameter that is where the state of its name starts."""
    problem = posterior.problem
    for i, t in enumerate(problem.thetas):
        if isinstance(t, InitialState) and t.state == key and key in problem.vehicle.parameters:
            std = float(np.sqrt(posterior.covariance[i, i]))
            nominal = problem.vehicle.parameters[key].value
            return nominal + float(posterior.theta[i] * t.unit), std * t.unit
    return None
