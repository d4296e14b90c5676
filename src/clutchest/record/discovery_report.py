"""A discovery in words: the page of Markdown, and the sentences and rows of other outputs."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Mapping, Sequence
from math import exp, isfinite, log, sqrt

from clutchest.discovery.goodness_of_fit import REJECTED, DistortionTest, GoodnessOfFit
from clutchest.discovery.result import Cause, Discovery, Form, Gain, Size, either
from clutchest.discovery.where import place_words, places_words
from clutchest.models.declarations import Comparison
from clutchest.models.effects import Effect
from clutchest.quantity import Quantity
from clutchest.record.error_curve import error_curve_words
from clutchest.record.report import LIMITS, heading, table
from clutchest.shipped import shipped
from clutchest.shown import raised, rounded, with_unit
from clutchest.signals import Counts
from clutchest.vehicle import Vehicle

HYPOTHESES_HEAD = ("effect", "fitted ± 1σ", "z", "nearest rival", "verdict")
CAUSES_HEAD = ("effect", "fitted ± 1σ", "2 Δ ln L", "p-value", "form")


def title(discovery: Discovery) -> str:
    """The verdict in a few words."""
    if discovery.verdict == "none":
        excited = any(i.excited for i in discovery.identifiability)
        return "the model explains the data" if excited else "the data are not informative"
    if discovery.where is not None and discovery.where.distorted:
        return "the equations explain the data, but not their noise"
    if discovery.named:
        return f"identified {either(discovery.sets)}"
    return "an error that no known effect explains"


def whereabouts(discovery: Discovery) -> str | None:
    """Which equation is wrong and what its error correlates with, as a sentence."""
    where = discovery.where
    if where is None or where.distorted:
        return None
    others = [place_words(other.equation) for other in where.others]
    beside = f"  Beside it there is an error in {' and in '.join(others)}." if others else ""
    if where.instead:
        return f"There is an error in {places_words(where)}.{beside}"
    words = [Quantity(name, "1").words for name in where.covariates[:3]]
    if where.peak:
        words[0] = f"the highest {words[0]} so far"
    covariates = ", then with ".join(words)
    more = f" and correlates with {covariates}." if covariates else "."
    return f"The error is in {place_words(where.equation)}{more}{beside}"


def strongest_words(discovery: Discovery) -> str | None:
    """The most likely error where none is established, as a sentence."""
    strongest = discovery.strongest
    if strongest is None or not strongest.covariates or strongest.p_value is None:
        return None
    place, driver = place_words(strongest.equation), Quantity(strongest.covariates[0], "1").words
    highest = "the highest " if strongest.peak else ""
    return (
        f"No correlation of the residuals is established.  The strongest one is that of an error "
        f"in {place} with {highest}{driver} (p = {strongest.p_value:.2g}, all curves)."
    )


def fit_words(discovery: Discovery) -> str:
    """Whether the model fits at all, as a sentence or two."""
    fit = discovery.fit
    if fit.p_value is None:
        return "There are too few residuals to test whether they are noise."
    if not fit.rejects:
        return f"The residuals are consistent with noise (p = {fit.p_value:.2g}, all tests)."
    where = ", ".join(
        f"{sensor} while {mode}"
        for sensor, mode in dict.fromkeys((t.sensor, t.regime) for t in _significant(fit))
    )
    p = f"p = {fit.p_value:.2g}" if fit.p_value > 0.0 else "p < 1e-300"
    return f"The residuals are not noise ({p}, all tests): {where}."


def _significant(fit: GoodnessOfFit) -> list[DistortionTest]:
    return [test for test in fit.tests if test.p_value < REJECTED] or list(fit.tests[:1])


def causes_rows(discovery: Discovery) -> list[tuple[str, ...]]:
    """Per cause its name, numbers with ±, improvement of the fit (2 Δ ln L), p-value, and whether
    its form holds."""
    return [
        (
            c.effect,
            _fitted(c, _units(discovery, c.effect)),
            f"{c.statistic:.1f}",
            f"{c.p_value:.2g}" if c.p_value > 0.0 else "< 1e-300",
            _form(c.form),
        )
        for c in discovery.causes
    ]


def _form(form: Form) -> str:
    """Whether a form holds, in a few words."""
    if form.p_value is None:
        return f"not tested: {form.reason}"
    return f"{form.state} (p = {form.p_value:.2g})"


def rivals_rows(discovery: Discovery) -> list[tuple[str, str, str]]:
    """Per rejected effect, best first, its name, fitted numbers, and how much less likely it is."""
    rows = []
    for rival in discovery.rivals:
        units = _units(discovery, rival.effect)
        numbers = ", ".join(
            with_unit(f"{key} {value:.3g}", units.get(key, ""))
            for key, value in rival.parameters.items()
        )
        rows.append((rival.effect, numbers, f"{_times(rival.behind)} less likely"))
    return rows


def hypotheses_rows(discovery: Discovery) -> list[tuple[str, str, str, str, str]]:
    """Per effect of the user's own: name, value ± σ, z, nearest rival with its separability d′,
    and "named" or why not."""
    rows = []
    for h in discovery.hypotheses:
        units = _units(discovery, h.effect)
        numbers = [
            with_unit(f"{key} {_number(size)}", units.get(key, ""))
            for key, size in h.parameters.items()
        ]
        rival = "" if h.nearest is None else f"{h.nearest}, d′ {h.d_prime_nearest:.1f}"
        z = "" if h.z is None else f"{h.z:.1f}"
        rows.append((h.effect, ", ".join(numbers), z, rival, h.why_not or "named"))
    return rows


def gain_words(gain: Gain, compared: Comparison | None) -> str:
    """What the extension gains on data not used to identify it, with its interval; ``compared``:
    the pair whose open-loop error is reported."""
    on = "On held-out data" if gain.other_logs else "Cross-validated over quarters of the log,"
    low, high = gain.ci95
    value, before, after = gain.total, gain.simulation_rmse_before, gain.simulation_rmse_after
    digits = 1 if high - low < 100 else 0
    verdict = "" if low > 0 else "  The interval includes 0: the improvement is not significant."
    verdict = verdict if high > 0 else "  The extension makes the prediction worse."
    rise = f"rises by {value:.{digits}f} [95 %: {low:.{digits}f} to {high:.{digits}f}]"
    if value < 0:
        rise = f"falls by {-value:.{digits}f} [95 %: {-high:.{digits}f} to {-low:.{digits}f}]"
    open_loop = ""
    if compared is not None and before is not None and after is not None:
        decimals = 1 if min(before, after) >= 0.1 else 4
        change = _changed(f"{before:.{decimals}f}", f"{after:.{decimals}f}")
        open_loop = f", the open-loop {compared.what} error {change} {compared.unit}"
    rms = _changed(f"{gain.rmse_before:.3f}", f"{gain.rmse_after:.3f}")
    return (
        f"{on} ln L {rise}, the rms innovation over its predicted standard deviation {rms}"
        f"{open_loop}.{verdict}"
    )


def _changed(before: str, after: str) -> str:
    """From one number to the other, or that it does not change."""
    return f"changes from {before} to {after}" if before != after else f"stays at {before}"


def unmeasured_words(discovery: Discovery) -> str:
    """Why no gain was measured."""
    if discovery.verdict == "none":
        return "No cause was identified, so there is no gain to measure."
    if discovery.provenance["held_out"]:
        return "The error could not be added to the model as a curve: there is no gain to measure."
    return "Not measured: no held-out data (`--holdout LOG`)."


def unexcited_words(discovery: Discovery) -> str:
    """The effects that this log cannot reveal, in one line."""
    if not discovery.unexcited:
        return "This log would reveal every effect of plausible size."
    names = ", ".join(discovery.unexcited)
    return f"Not detectable in this log even at the largest plausible size: {names}."


def capitalised(words: str) -> str:
    """As a sentence of its own."""
    return f"{words[:1].upper()}{words[1:].rstrip('.')}."


def next_commands(discovery: Discovery) -> list[str]:
    """The next manoeuvre as commands to run; empty where there is none to drive."""
    if discovery.experiment is None or discovery.experiment.scenario is None:
        return []
    vehicle = _argument(discovery.vehicle)
    scenario = shlex.quote(discovery.experiment.scenario)
    hidden = "".join(
        f" --effect {name}:" + ",".join(f"{key}={value:.4g}" for key, value in numbers.items())
        for name, numbers in discovery.added_effects.items()
    )
    return [
        f"clutchest simulate --vehicle {vehicle} --scenario {scenario} --seed 1{hidden} -o next.log"
    ]


def report(
    discovery: Discovery,
    picture: str | None = None,
    forms: str | None = None,
    curve: str | None = None,
) -> str:
    """One page of Markdown; ``picture`` is the file name of the misfit's, ``forms`` that of the
    causes' forms, ``curve`` that of an error without a name, if they stand beside."""
    made = discovery.provenance
    logs = heading(discovery.vehicle, made.get("logs", ""), made.get("begun", ""))
    parts = [f"# {discovery.vehicle.name}: {title(discovery)}", logs, *_fit(discovery)]
    parts.append(f"**{discovery.sentence}**")
    parts += [words] if (words := whereabouts(discovery)) else []
    if picture:
        parts.append(f"![Residuals of the model, and what they correlate with]({picture})")
    parts += [words] if (words := strongest_words(discovery)) else []
    parts += [words] if (words := error_curve_words(discovery)) else []
    parts += [f"![The error over what it correlates with]({curve})"] if curve else []
    parts += _results(discovery, forms)
    if discovery.experiment:
        parts += ["## Next manoeuvre", capitalised(discovery.experiment.words)]
        if commands := next_commands(discovery):
            parts.append("To try it in simulation:\n\n" + _code(commands))
    parts += ["## Not detectable in this log", unexcited_words(discovery)]
    parts += (
        ["## Detection limits", LIMITS, _limits(discovery)] if discovery.identifiability else []
    )
    if discovery.misfit.levels:
        parts += ["## Residuals of the original model", _levels(discovery)]
    if discovery.warnings:
        parts += ["## Warnings", "\n".join(f"- {text}" for text in discovery.warnings)]
    if made.get("logs"):
        held_out = f", held-out data {made['held_out']}," if made["held_out"] else ""
        parts.append(
            f"From {made['logs']}{_lost(discovery.counts)}{held_out} "
            f"by clutchest {made['clutchest']}."
        )
    return "\n\n".join(parts) + "\n"


def _fit(discovery: Discovery) -> list[str]:
    """Whether the model fits at all, and the distortions that are significant."""
    parts = [f"Does the model fit? {fit_words(discovery)}"]
    if discovery.fit.rejects:
        rows = [
            (test.sensor, test.regime, test.kind, f"{test.p_value:.2g}", test.words)
            for test in _significant(discovery.fit)
        ]
        parts.append(table(("sensor", "regime", "test", "p-value", "largest distortion"), rows))
    if discovery.fit_extended and discovery.fit_extended.p_value is not None:
        p = discovery.fit_extended.p_value
        parts.append(f"The same test of the extended model: p = {p:.2g}.")
    return parts


def _limits(discovery: Discovery) -> str:
    """From which size on each effect would have been detected."""
    rows = [
        (
            i.effect,
            "no size"
            if i.detectable_size is None
            else with_unit(f"{i.detectable_size:.3g}", i.unit),
            with_unit(f"{i.plausible_size:.3g}", i.unit),
            "yes" if i.excited else "no",
        )
        for i in discovery.identifiability
    ]
    return table(("effect", "detectable from (50 %)", "largest plausible", "detectable"), rows)


def _results(discovery: Discovery, forms: str | None) -> list[str]:
    """Causes, rivals, and what the extended model gains."""
    parts = []
    if discovery.causes:
        heading = "Candidates" if discovery.verdict == "ambiguous" else "Causes"
        parts += [f"## {heading}", _causes(discovery)]
        if forms:
            parts.append(f"![What each cause does over its driver: effect and data]({forms})")
        parts += [f"{c.effect}: {c.form.added}." for c in discovery.causes if c.form.added]
    if discovery.rivals:
        rows = rivals_rows(discovery)
        parts += ["## Rejected alternatives", table(("effect", "fitted", "likelihood"), rows)]
    if own := hypotheses_rows(discovery):
        parts += ["## Your own hypotheses", table(HYPOTHESES_HEAD, own)]
    compared = discovery.vehicle.machine.compared
    gain = gain_words(discovery.gain, compared) if discovery.gain else unmeasured_words(discovery)
    return [*parts, "## The extended model", _extension(discovery), gain]


def _lost(counts: Counts) -> str:
    """In words, what of the mapped frames could not be used, and why."""
    lost = {why: n for why, n in counts.rejected.items() if why != "not mapped"}
    reasons = ", ".join(f"{n} {why}" for why, n in lost.items())
    return f" (not used of {counts.frames} frames: {reasons})" if lost else ""


def _causes(discovery: Discovery) -> str:
    known = discovery.extended.library
    rows = [(name, _meaning(known.get(name)), *rest) for name, *rest in causes_rows(discovery)]
    return table((CAUSES_HEAD[0], "definition", *CAUSES_HEAD[1:]), rows)


def _extension(discovery: Discovery) -> str:
    """What the extended vehicle has in its model that the given one has not."""
    added = discovery.added
    if not added:
        return f"Nothing was added: `extended.toml` is {discovery.vehicle.path.name} as it was."
    how = "replay LOG --vehicle extended.toml"
    empirical = (
        f"  {discovery.curve} is an empirical correction: it reproduces these data and names no "
        "cause."
        if discovery.curve
        else ""
    )
    return f"`extended.toml` has {' and '.join(added)} in its model: `clutchest {how}`.{empirical}"


def _levels(discovery: Discovery) -> str:
    rows = [
        (x.sensor, x.mode, f"{sqrt(x.level):.3f}", f"{x.lag:+.3f}", str(x.count))
        for x in discovery.misfit.levels
    ]
    head = (
        "sensor",
        "mode",
        "rms whitened innovation (1 if the model is right)",
        "autocorrelation at lag 1 (0 if white)",
        "readings",
    )
    return table(head, rows)


def _units(discovery: Discovery, effect: str) -> Mapping[str, str]:
    """Number → unit of an effect; of a user's own that is not in the extended model, that of its
    size."""
    if (known := discovery.extended.library.get(effect)) is not None:
        return {number.key: number.unit for number in known.parameters}
    own = next((i.unit for i in discovery.identifiability if i.effect == effect), "")
    sizes = [h.parameters for h in discovery.hypotheses if h.effect == effect]
    return {key: own for parameters in sizes for key in list(parameters)[:1]}


def _fitted(cause: Cause, units: Mapping[str, str]) -> str:
    return ", ".join(
        with_unit(f"{key} {_number(number)}", units.get(key, ""))
        for key, number in cause.parameters.items()
    )


def _number(number: Size) -> str:
    known = isfinite(number.std) and number.std > 0
    return rounded(number.value, number.std) if known else f"{number.value:.4g}"


def _times(behind: float) -> str:
    """``behind`` in 2 Δ ln L as a ratio of likelihoods."""
    decades = behind / 2 / log(10)
    return f"{exp(behind / 2):.2g} times" if decades < 4 else raised(f"10^{decades:.0f} times")


def _meaning(effect: Effect | None) -> str:
    if effect is None:
        return ""
    first = inspect.cleandoc(type(effect).__doc__ or "").split("\n\n")[0]
    return " ".join(first.split()).replace("``", "`").replace("|", "\\|")


def _argument(vehicle: Vehicle) -> str:
    """What ``--vehicle`` takes for this vehicle."""
    for name, path in shipped("vehicles").items():
        if path.resolve() == vehicle.path.resolve():
            return name
    return shlex.quote(str(vehicle.path))


def _code(commands: Sequence[str]) -> str:
    return "\n".join(["```sh", *commands, "```"])
