"""The result of a discovery: verdict, causes, where, gain, and what is not identifiable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from clutchest.discovery.goodness_of_fit import GoodnessOfFit
from clutchest.discovery.residuals import Misfit
from clutchest.discovery.where import Where
from clutchest.shown import Shown, Tabulated, plain, plus_minus
from clutchest.signals import Counts, Floats
from clutchest.vehicle import Vehicle

if TYPE_CHECKING:
    from clutchest.pictures import Picture


@dataclass(frozen=True, slots=True)
class Size:
    """A number with its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class FormCurve:
    """What a cause does over its ``covariate``, at values ``at`` (n) of it: as the ``effect`` has
    it, and as the ``data`` have it with standard deviations ``std`` (n each).

    Of the error term ``of``, in its unit; or (``of_gain``) of a gain of the effect, which
    the effect has constant.
    """

    covariate: str
    of: str
    unit: str
    at: Floats
    effect: Floats
    data: Floats
    std: Floats
    of_gain: bool = False

    def summary(self) -> dict[str, Any]:
        """As ``discovery.json`` has it."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in asdict(self).items()
        }


@dataclass(frozen=True, slots=True)
class Form:
    """Whether the form of a cause holds, beside its presence.

    ``state``: "held", "refuted" or None where it could not be tested, then with a ``reason``;
    ``p_value`` of the ``curve`` over a driver of the cause by which the data deviate most from the
    effect.  ``added``: in words, whether that curve stands in the extended model, and why.
    """

    state: str | None
    reason: str = ""
    p_value: float | None = None
    curve: FormCurve | None = None
    added: str = ""

    @property
    def refuted(self) -> bool:
        """Whether the cause acts otherwise than the effect says."""
        return self.state == REFUTED

    def summary(self) -> dict[str, Any]:
        """As ``discovery.json`` has it."""
        test = {"p_value": self.p_value, "reason": self.reason, "added": self.added}
        curve = self.curve and self.curve.summary()
        return {"form": self.state, "form_test": test, "curve": curve}


HELD, REFUTED = "held", "refuted"
UNTESTED = Form(None, "no test was made")


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect that the data require: ``statistic`` by how much it improves the fit beside the
    other causes, 2 Δ ln L, ``p_value`` family-wise, over all effects of the library; ``form``:
    whether it acts as the effect says; ``drivers``: covariates that the effect itself reads."""

    effect: str
    equation: str
    parameters: Mapping[str, Size]
    statistic: float
    p_value: float
    form: Form = UNTESTED
    drivers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Rival:
    """An effect that was fitted and rejected: ``behind`` the best in 2 Δ ln L."""

    effect: str
    behind: float
    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What a log says of an effect of the user's own.

    ``parameters``: as named, else as fitted without any other cause (none where it cannot be
    tested); ``z`` its score in standard deviations beside no other cause; ``nearest``: the effect
    that resembles it most, and the separability ``d_prime_nearest`` of both in standard deviations
    at this value, at least at one that is detected in half of such logs.  ``why_not``: why it was
    not named, "" where it was.
    """

    effect: str
    parameters: Mapping[str, Size]
    z: float | None
    nearest: str | None
    d_prime_nearest: float | None
    why_not: str


@dataclass(frozen=True, slots=True)
class Identifiable:
    """Identifiability of an effect in a log, before anything is fitted.

    ``detectable_size``: detected in half of such logs, in the ``unit`` of its gain that shows
    soonest (None: no size is); ``plausible_size`` the largest plausible one of this gain;
    ``nearest`` the effect that resembles it most, and the separability of both in standard
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
        """Whether a plausible size is detectable."""
        return self.detectable_size is not None and self.detectable_size <= self.plausible_size


@dataclass(frozen=True, slots=True)
class Gain:
    """Before and after, on data not used to identify it; ``ci95`` of nll_before − nll_after.

    ``simulation_rmse``: None where the clutch did not slip, and after a curve, whose effect is
    known to first order only.  ``other_logs``: on held-out logs; else cross-validated on parts of
    the log.
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
    """What would separate an ambiguous set, or equations in one of which an error is; ``scenario``
    None where no manoeuvre does."""

    words: str
    scenario: str | None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Discovery(Tabulated):
    """The answer.  ``sets`` are the names of causes that act together, the most likely first: one
    where they are named, several where the data do not separate them.  ``extended`` is the vehicle
    with what was identified in its model, ``curve`` the name of the curve added to it, if any;
    ``sentence`` says it in words.  ``fit``: whether residuals of the model are noise,
    ``fit_extended`` those of the model with the causes, None without any.  ``strongest``: where no
    error with a driver is established, the most likely one."""

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
    fit: GoodnessOfFit
    fit_extended: GoodnessOfFit | None
    extended: Vehicle
    curve: str | None
    counts: Counts  # of the frames of the log
    warnings: tuple[str, ...]
    provenance: Mapping[str, str]
    hypotheses: tuple[Hypothesis, ...] = ()  # of the user's own
    strongest: Where | None = None

    COLUMNS: ClassVar[tuple[str, ...]] = (
        *("effect", "equation", "parameter", "value", "std", "statistic", "p_value", "form"),
    )

    @property
    def unexcited(self) -> tuple[str, ...]:
        """Effects that are not detectable in this log even at their largest plausible size."""
        return tuple(i.effect for i in self.identifiability if not i.excited)

    @property
    def named(self) -> bool:
        """Whether causes have names: the model can then be run with them."""
        return bool(self.causes)

    @property
    def by_name(self) -> Mapping[str, Cause]:
        """The causes."""
        return {cause.effect: cause for cause in self.causes}

    @property
    def added_effects(self) -> dict[str, Mapping[str, float]]:
        """The effects that act in the extended vehicle and not so in the given one, with their
        numbers."""
        before, after = self.vehicle.effects, self.extended.effects
        return {
            name: numbers
            for name, numbers in after.items()
            if before.get(name) != numbers and any(numbers.values())
        }

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the effects, curves and delays that are in the extended model and not so in the
        given one; empty where ``extended`` is the vehicle as it was."""
        before, after = self.vehicle.curves, self.extended.curves
        curves = [name for name, curve in after.items() if before.get(name) != curve]
        signals = self.vehicle.signals
        late = [n for n, own in self.extended.signals.items() if own.delay != signals[n].delay]
        return (*self.added_effects, *curves, *(f"the delay of {name}" for name in late))

    def shown(self) -> Shown:
        """The causes with their sizes."""
        library = self.extended.library
        of = {(e.name, n.key): n.unit for e in library.values() for n in e.parameters}
        rows = [
            (
                cause.effect,
                ", ".join(
                    f"{key} = {plus_minus(size.value, size.std, of.get((cause.effect, key), ''))}"
                    for key, size in cause.parameters.items()
                ),
                f"{cause.statistic:.1f}",
                f"{cause.p_value:.1g}",
            )
            for cause in self.causes
        ]
        header = ("cause", "value", "2 Δ ln L", "p-value")
        return Shown(f"{self.verdict}. {self.sentence}", header, rows)

    def rows(self) -> list[dict[str, Any]]:
        """A row a number of a cause."""
        return [
            {
                "effect": cause.effect,
                "equation": cause.equation,
                "parameter": key,
                "value": size.value,
                "std": size.std,
                "statistic": cause.statistic,
                "p_value": cause.p_value,
                "form": cause.form.state,
            }
            for cause in self.causes
            for key, size in cause.parameters.items()
        ]

    def column_units(self) -> dict[str, str]:
        """None: every number has a unit of its own."""
        return {}

    def plot(self) -> Picture:
        """Torque, measured and simulated, over the slip with the largest error; residuals over the
        driver that they correlate with most, which is said where that is not established."""
        from clutchest.discovery.misfit_picture import draw_misfit

        where = self.strongest or self.where
        drivers = where.covariates if where else ()
        unproven = self.strongest.p_value if self.strongest else None
        return draw_misfit(self.misfit, self.vehicle.machine, drivers, self.named, unproven)

    def summary(self) -> dict[str, Any]:
        """What ``discovery.json`` holds."""
        where, gain, experiment = self.where, self.gain, self.experiment
        contents = {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "fit": {
                **asdict(self.fit),
                "extended": self.fit_extended and asdict(self.fit_extended),
            },
            "causes": [_of_cause(c) for c in self.causes],
            "added": list(self.added),
            "rivals": [asdict(r) for r in self.rivals],
            "hypotheses": [asdict(h) for h in self.hypotheses],
            "where": where and where.summary(),
            "errors": where.errors if where else [],
            "strongest": self.strongest and self.strongest.errors[0],
            "unexcited": list(self.unexcited),
            "identifiability": {i.effect: _without_name(i) for i in self.identifiability},
            "gain": gain and {**asdict(gain), "ci95": list(gain.ci95)},
            "experiment": experiment and asdict(experiment),
            "levels": [asdict(level) for level in self.misfit.levels],
            **self.counts.summary(),
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }
        return dict(plain(contents))


def _of_cause(cause: Cause) -> dict[str, Any]:
    return {**asdict(cause), **cause.form.summary()}


def _without_name(i: Identifiable) -> dict[str, Any]:
    return {key: value for key, value in asdict(i).items() if key != "effect"}


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
