"""Does the model fit at all?  One calibrated p-value, and what it is made of.

Residuals of a model that is right are noise: of any level, colour and tails, but the same
everywhere and without lines in its spectrum.  Each sensor in each regime is tested for what would
be otherwise; the smallest of all p-values is compared with the smallest of data that have the
fitted noise and nothing else, so that the number of tests and their correlations are allowed for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.discovery.noise_contrasts import (
    LATE,
    REGIME,
    WINDOW,
    Contrasts,
    TwoSides,
    contrasts,
)
from clutchest.discovery.residual_series import ResidualSeries, residual_series
from clutchest.discovery.spectral_lines import lines
from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import family_wise
from clutchest.signals import Floats

DRAWS = 1000  # of data with nothing but noise
REJECTED = 0.001  # p-value below which the model does not fit
LEAST = 1e-300  # p-value of which a logarithm is taken
COLOUR = ("colour", "runs", "spectrum")  # kinds of contrast that are about autocorrelation


@dataclass(frozen=True, slots=True)
class DistortionTest:
    """One kind of distortion of a ``sensor``'s residuals in a ``regime``: ``kind`` is "level",
    "tails", "colour", "mean", "sign", "runs" or "spectrum"; ``words`` the largest of it."""

    sensor: str
    regime: str
    kind: str
    p_value: float
    words: str


@dataclass(frozen=True, slots=True)
class GoodnessOfFit:
    """Whether residuals are noise: ``p_value`` of all tests together, of those of each of the
    ``sensors`` and ``regimes``, and the ``tests``, the most significant first.  None where there
    are too few residuals."""

    p_value: float | None
    sensors: Mapping[str, float]
    regimes: Mapping[str, float]
    tests: tuple[DistortionTest, ...]

    @property
    def rejects(self) -> bool:
        """Whether the residuals are more than noise."""
        return self.p_value is not None and self.p_value < REJECTED

    def outweighs(self, explained: float) -> bool:
        """Whether residuals are not noise, more surely than that is which causes ``explained``, 2 Δ
        ln L: these do not name what is wrong, whatever they are."""
        return self.rejects and -2.0 * np.log(max(self.tests[0].p_value, LEAST)) > explained


@dataclass(frozen=True, slots=True)
class _Distortion:
    """The logarithm ``log_p`` of the smallest p-value of some tests of one kind, that of every draw
    of the ``null`` (draws), and what it says in ``words``."""

    sensor: str
    regime: str
    kind: str
    log_p: float
    null: Floats
    words: str


def goodness_of_fit(
    problem: Problem, raw: Sequence[NormalisedInnovations], seed: int = 4
) -> GoodnessOfFit:
    """Of a linearisation of every drive, ``raw``, as the problem gives it."""
    modes = problem.compiled.machine.regimes.modes
    return of_series(residual_series(problem, raw), modes, np.random.default_rng(seed))


def of_series(
    every: Sequence[ResidualSeries],
    modes: Sequence[str],
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> GoodnessOfFit:
    """Of the residuals of every sensor; ``modes``: names of the machine's."""
    found = [d for series in every for d in _distortions(series, modes, draws, rng)]
    groups: dict[tuple[str, str, str], list[_Distortion]] = {}
    for d in found:
        groups.setdefault((d.sensor, d.regime, d.kind), []).append(d)
    tests = []
    for (sensor, regime, kind), own in groups.items():
        strongest = min(own, key=lambda d: d.log_p)
        test = DistortionTest(sensor, regime, kind, _together(own), strongest.words)
        tests.append((strongest.log_p, test))
    return GoodnessOfFit(
        _together(found) if found else None,
        _by(found, lambda d: d.sensor),
        _by(found, lambda d: d.regime),
        tuple(test for _, test in sorted(tests, key=lambda pair: pair[0])),
    )


def _by(found: Sequence[_Distortion], key: Callable[[_Distortion], str]) -> dict[str, float]:
    names = dict.fromkeys(map(key, found))
    return {name: _together([d for d in found if key(d) == name]) for name in names}


def _together(some: Sequence[_Distortion]) -> float:
    """The p-value of the smallest of several."""
    least = np.sort(np.exp(np.min([d.null for d in some], axis=0)))
    return float(family_wise(least, float(np.exp(min(d.log_p for d in some)))))


def _distortions(
    series: ResidualSeries, modes: Sequence[str], draws: int, rng: np.random.Generator
) -> Iterator[_Distortion]:
    compared = contrasts(series, draws, rng)
    if compared is not None:
        yield from _of_contrasts(series, compared, modes)
    for mode in np.unique(series.mode):
        for table in lines(*series.of_mode(mode), draws, rng):
            best = int(np.argmin(table.log_p))
            hertz = table.frequency[best] / series.period
            size = table.amplitude[best] * series.std
            yield _Distortion(
                series.sensor,
                modes[mode],
                "spectrum",
                float(table.log_p[best]),
                table.null,
                f"noise in {series.sensor} while {modes[mode]} has a line at {hertz:.2g} Hz "
                f"(amplitude {size:.2g} {series.unit})",
            )


def _of_contrasts(
    series: ResidualSeries, compared: Contrasts, modes: Sequence[str]
) -> Iterator[_Distortion]:
    kinds = np.array(compared.measures.kinds)
    every = dict.fromkeys(compared.measures.kinds)
    for p, part in enumerate(compared.parts):
        # a filter's innovations are as coloured as its gain, and the share of noise that comes by
        # way of inputs, make them: both are others from regime to regime
        left_out = COLOUR if series.followed and part.what == REGIME else ()
        for kind in (kind for kind in every if kind not in left_out):
            columns = np.flatnonzero(kinds == kind)
            best = columns[np.argmin(compared.log_p[p, columns])]
            yield _Distortion(
                series.sensor,
                modes[part.mode],
                kind,
                float(compared.log_p[p, best]),
                compared.null[:, p, columns].min(axis=1),
                _in_words(series, compared, p, int(best), modes),
            )


def _in_words(
    series: ResidualSeries, compared: Contrasts, p: int, column: int, modes: Sequence[str]
) -> str:
    """How one side of a contrast differs from the other."""
    part, measures = compared.parts[p], compared.measures
    more = compared.difference[p, column] > 0.0
    where, than = _sides(part, modes[part.mode])
    noise, residuals = f"noise in {series.sensor} {where}", f"residuals of {series.sensor} {where}"
    match measures.kinds[column]:
        case "level":
            ratio = np.exp(compared.difference[p, column] / 2.0)
            return f"{noise} is {ratio:.2f} times as large as {than}"
        case "tails":
            return f"{noise} has {'larger' if more else 'smaller'} outliers than {than}"
        case "colour":
            return f"{noise} is {'more' if more else 'less'} autocorrelated than {than}"
        case "mean":
            return f"{residuals} are {'higher' if more else 'lower'} than {than}"
        case "sign":
            return f"{residuals} are {'more' if more else 'less'} often positive than {than}"
        case "runs":
            return f"{residuals} change sign {'less' if more else 'more'} often than {than}"
        case _:
            hertz = measures.bin[column] / WINDOW / series.period
            return (
                f"{noise} is {'stronger' if more else 'weaker'} around {hertz:.2g} Hz than {than}"
            )


def _sides(part: TwoSides, mode: str) -> tuple[str, str]:
    """Both sides of a contrast in words."""
    if part.what == REGIME:
        return f"while {mode}", "otherwise"
    if part.what == LATE:
        return f"late while {mode}", "early"
    return f"while {mode}, in the second half of the data,", "in the first"
