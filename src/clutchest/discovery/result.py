"""What a discovery says: verdict, causes, where, what it gains, and what remains open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from clutchest.signals import Counts, Floats
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Size:
    """A number with its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect that the data ask for, ``statistic`` its gain in −2 ln(probability) over the model
    without it but with the other causes found, ``p_value`` the chance that noise alone brings as
    much to any effect of the library."""

    effect: str
    equation: str
    parameters: Mapping[str, Size]
    statistic: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Rival:
    """An effect that was fitted and lost: by how much in −2 ln(probability)."""

    effect: str
    behind: float
    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Where:
    """The equation that is wrong, and the quantities its error goes with, best first; ``peak``:
    with the highest that the first of them has been."""

    equation: str
    covariates: tuple[str, ...]
    peak: bool = False


@dataclass(frozen=True, slots=True)
class Identifiable:
    """What a log can tell of an effect before anything is fitted.

    ``detectable_size``: found in half of such logs, in the unit of the first gain (None: no size
    shows); ``plausible_size`` its largest plausible size; ``nearest`` the effect that comes
    closest to explaining that size away, and the distance left between both in standard
    deviations.
    """

    effect: str
    unit: str
    detectable_size: float | None
    plausible_size: float
    nearest: str | None
    d_prime_nearest: float | None

    @property
    def excited(self) -> bool:
        """Whether a plausible size would show."""
        return self.detectable_size is not None and self.detectable_size <= self.plausible_size


@dataclass(frozen=True, slots=True)
class Gain:
    """Before and after, on data not used to find it; ``ci95`` of nll_before − nll_after.

    ``simulation_rmse``: None where the clutch did not slip there, after a patch also: what it does
    is known to first order only.  ``other_logs``: on logs held out; else on parts of the log
    itself, each foretold by the rest.
    """

    rmse_before: float
    rmse_after: float
    nll_before: float
    nll_after: float
    simulation_rmse_before: float | None
    simulation_rmse_after: float | None
    ci95: tuple[float, float]
    other_logs: bool = True

    @property
    def total(self) -> float:
        """In −ln(likelihood)."""
        return self.nll_before - self.nll_after


@dataclass(frozen=True, slots=True)
class Experiment:
    """What would separate an ambiguous set; ``scenario`` None where no manoeuvre does."""

    words: str
    scenario: str | None


@dataclass(frozen=True, slots=True)
class Bins:
    """Mean misfit of one sensor in one mode over one quantity, in standard deviations.

    ``edges`` (b + 1), ``mean`` (b) with its standard error ``error`` (b), ``count`` (b).
    """

    sensor: str
    mode: str
    covariate: str
    edges: Floats
    mean: Floats
    error: Floats
    count: NDArray


@dataclass(frozen=True, slots=True)
class Level:
    """Of one sensor in one mode: mean square of the whitened innovations (1 if the model is
    right), their correlation from one to the next, and how many."""

    sensor: str
    mode: str
    level: float
    lag: float
    count: int


@dataclass(frozen=True, slots=True)
class Misfit:
    """Where and when the model misses.

    Per drive: ``time`` (K) s, ``sensor`` (K) index into ``sensors``; ``before`` and ``after`` (K),
    innovations over their standard deviation without and with what was found.  ``torque``:
    (time s, measured, simulated, extended) clutch torque in Nm while the clutch slips, the last
    two open loop.
    """

    sensors: tuple[str, ...]
    time: tuple[Floats, ...]
    sensor: tuple[NDArray, ...]
    before: tuple[Floats, ...]
    after: tuple[Floats, ...]
    torque: tuple[tuple[Floats, Floats, Floats, Floats], ...]
    bins: tuple[Bins, ...]
    levels: tuple[Level, ...]


@dataclass(frozen=True, slots=True)
class Discovery:
    """The answer.  ``sets`` are the names of causes that act together, the likeliest set first:
    one where they are named, several where the data cannot tell.  ``extended`` is the vehicle with
    what was identified in its model, ``curve`` the name of the curve added to it, if any;
    ``sentence`` says it in words."""

    vehicle: Vehicle
    verdict: str
    sentence: str
    causes: tuple[Cause, ...]
    sets: tuple[tuple[str, ...], ...]
    rivals: tuple[Rival, ...]
    where: Where | None
    identifiability: tuple[Identifiable, ...]
    gain: Gain | None
    experiment: Experiment | None
    misfit: Misfit
    extended: Vehicle
    curve: str | None
    counts: Counts  # of the frames of the log
    warnings: tuple[str, ...]
    provenance: Mapping[str, str]

    @property
    def unexcited(self) -> tuple[str, ...]:
        """Effects whose largest plausible size this log would not show."""
        return tuple(i.effect for i in self.identifiability if not i.excited)

    @property
    def named(self) -> bool:
        """Whether there are causes with names, which the model can be run with."""
        return bool(self.causes)

    def summary(self) -> dict[str, Any]:
        """What ``discovery.json`` holds."""
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "causes": [
                {
                    "effect": c.effect,
                    "equation": c.equation,
                    "parameters": {
                        k: {"value": f.value, "std": f.std} for k, f in c.parameters.items()
                    },
                    "statistic": c.statistic,
                    "p_value": c.p_value,
                }
                for c in self.causes
            ],
            "rivals": [
                {"effect": r.effect, "behind": r.behind, "parameters": dict(r.parameters)}
                for r in self.rivals
            ],
            "where": None
            if self.where is None
            else {"equation": self.where.equation, "drivers": list(self.where.covariates)},
            "unexcited": list(self.unexcited),
            "identifiability": {
                i.effect: {
                    "detectable_size": i.detectable_size,
                    "unit": i.unit,
                    "plausible_size": i.plausible_size,
                    "nearest": i.nearest,
                    "d_prime_nearest": i.d_prime_nearest,
                }
                for i in self.identifiability
            },
            "gain": None
            if self.gain is None
            else {
                **{
                    key: getattr(self.gain, key)
                    for key in (
                        "rmse_before",
                        "rmse_after",
                        "nll_before",
                        "nll_after",
                        "simulation_rmse_before",
                        "simulation_rmse_after",
                    )
                },
                "ci95": list(self.gain.ci95),
                "other_logs": self.gain.other_logs,
            },
            "experiment": None
            if self.experiment is None
            else {"words": self.experiment.words, "scenario": self.experiment.scenario},
            "levels": [
                {
                    "sensor": x.sensor,
                    "mode": x.mode,
                    "level": x.level,
                    "lag": x.lag,
                    "count": x.count,
                }
                for x in self.misfit.levels
            ],
            **self.counts.summary(),
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }


def either(sets: Sequence[Sequence[str]]) -> str:
    """Sets of things of which one holds, in words: "a and b"; "a and one of b, c"; "a and perhaps
    b"; "one of: a and b; c and d"."""
    common = [name for name in sets[0] if all(name in others for others in sets)]
    rest = [[name for name in own if name not in common] for own in sets]
    if len(sets) == 1:
        return " and ".join(common)
    plain = all(len(own) < 2 for own in rest)
    choice = [" and ".join(own) for own in rest if own]
    one = f"one of {', '.join(choice)}" if plain else f"one of: {'; '.join(choice)}"
    if len(choice) < len(rest):
        one = f"perhaps {choice[0] if len(choice) == 1 else one}"
    return " and ".join([*common, one])
