"""What a machine declares of its test benches: which there are, and experiments on them.

An experiment reduces the record of a bench to *equation errors*: what is left over of the
equations that an estimator rests on, as a function of the parameters.  The identification makes
them least, every other uncertain parameter within its prior.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import nearest
from clutchest.models.model import Model
from clutchest.signals import Floats, Signal

Parameters = Mapping[str, float]  # key → value


@dataclass(frozen=True, slots=True)
class BenchRecord:
    """A stretch of a log on one ``bench``.

    ``signals``: name → valid samples, delays removed; ``noise``: name → standard deviation of one
    sample, ``noise_ar`` its AR(1) coefficient; ``parameters`` as the vehicle file has them.
    """

    bench: str
    signals: Mapping[str, Signal]
    noise: Mapping[str, float]
    noise_ar: Mapping[str, float]
    parameters: Parameters

    def std_of_mean(self, name: str, count: int) -> float:
        """Standard deviation of the mean of ``count`` consecutive samples of a signal."""
        ar = self.noise_ar[name]
        return self.noise[name] * float(np.sqrt((1 + ar) / (1 - ar) / max(count, 1)))

    def lacks(self, names: Sequence[str]) -> list[str]:
        """Those of the signals that it does not have."""
        return [name for name in names if not len(self.signals.get(name, ()))]

    def between(self, start: float, end: float) -> BenchRecord:
        """What lies in ``start`` ≤ time < ``end``, s."""
        signals = {
            name: s.take(slice(*np.searchsorted(s.time, (start, end))))
            for name, s in self.signals.items()
        }
        return BenchRecord(self.bench, signals, self.noise, self.noise_ar, self.parameters)


@dataclass(frozen=True, slots=True)
class BenchSection:
    """``bench`` of a log from ``start`` to ``end``, s."""

    start: float
    end: float
    bench: str


@dataclass(frozen=True, slots=True)
class Benches:
    """The benches of a machine: ``names`` to what each is, in words; ``guess`` makes the sections
    of a record whose bench is not known; ``out_of_place`` those in which the equations of the whole
    machine certainly do not hold; ``fitted`` (bench → signals → model) the form of the equations on
    each, for fits to whole records."""

    names: Mapping[str, str]
    guess: Callable[[BenchRecord], tuple[BenchSection, ...]]
    out_of_place: Callable[[BenchRecord], tuple[BenchSection, ...]] = lambda record: ()
    fitted: Mapping[str, Callable[[Container[str]], Model]] = field(
        default_factory=lambda: MappingProxyType({})
    )


@dataclass(frozen=True, slots=True)
class ExperimentCurve:
    """A picture of an experiment, a PNG named ``file``: ``points`` as measured and the ``model``'s
    curve, (x, y) each, by parameters and own numbers; ``labels`` of both axes; ``left_out``: points
    that the estimator does not use."""

    file: str
    labels: tuple[str, str]
    points: Callable[[Parameters, Floats], tuple[Floats, Floats]]
    model: Callable[[Parameters, Floats], tuple[Floats, Floats]]
    left_out: Callable[[Parameters, Floats], tuple[Floats, Floats]] | None = None


@dataclass(frozen=True, slots=True)
class EquationErrors:
    """What a record shows of the parameters.

    ``errors``: (parameters, own numbers (m,)) → equation errors (k,), each over its standard
    deviation and independent of the others.  ``own``: numbers of this record alone, their value and
    standard deviation (m, 2).  ``figures``: what was measured, in words, by the parameters.
    """

    errors: Callable[[Parameters, Floats], Floats]
    own: Floats
    figures: Callable[[Parameters], tuple[str, ...]] = lambda p: ()
    curves: tuple[ExperimentCurve, ...] = ()


NO_OWN: NDArray[np.float64] = np.zeros((0, 2))


@dataclass(frozen=True, slots=True)
class BenchExperiment:
    """An experiment that determines ``parameters`` (keys) on one of the ``benches``.

    ``what`` it determines, in a few words; ``signals`` that it needs; ``reduce`` gives the equation
    errors of a record, or says in words what the record lacks.
    """

    name: str
    what: str
    parameters: tuple[str, ...]
    benches: tuple[str, ...]
    signals: tuple[str, ...]
    reduce: Callable[[BenchRecord], EquationErrors | str]

    def unknown_names(
        self, parameters: Iterable[str], benches: Iterable[str], columns: Iterable[str]
    ) -> Iterator[tuple[str, str]]:
        """(piece, what is wrong) for every name in it that the machine does not declare."""
        for what, names, known in (
            ("parameter", self.parameters, list(parameters)),
            ("bench", self.benches, list(benches)),
            ("column", self.signals, list(columns)),
        ):
            for name in (name for name in names if name not in known):
                yield f"experiment '{self.name}'", f"has no {what} '{name}'" + nearest(name, known)
