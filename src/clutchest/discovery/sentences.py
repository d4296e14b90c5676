"""The answer in one sentence, and warnings beside it."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence

import numpy as np

from clutchest.discovery.answer import Sizes, sizes_by_effect, sizes_of
from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.goodness_of_fit import GoodnessOfFit
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import Cause, FormCurve, either
from clutchest.discovery.verdict import UNNAMED, significant
from clutchest.discovery.where import Where, place_and_driver, place_words, places_words
from clutchest.estimate.consistency import SHARES
from clutchest.models.effects import Effect
from clutchest.models.symbols import Sensor
from clutchest.quantity import Quantity
from clutchest.shown import plus_minus


def sentence(
    verdict: str,
    sets: Sequence[CauseSet],
    causes: Sequence[Cause],
    where: Where | None,
    fit: GoodnessOfFit,
    loud: Mapping[str, float],
    excited: bool,
) -> str:
    """The answer in words, with the sizes of the ``causes``; ``fit`` of the model without a cause,
    or with those that were found where residuals are not noise even so; ``loud``: sensors whose
    residuals are so many times their stated noise, in which an error may be; ``excited``: whether
    the data could show any cause at all."""
    if verdict == "none" and not excited:
        return "These data excite no known cause: they neither confirm nor refute the model."
    if verdict == "none" and loud:
        each = " and ".join(f"{name} {times:.1f} times" for name, times in loud.items())
        return (
            f"No error is detectable, but an error may pass for noise: the residuals of {each} "
            "the noise that the vehicle file states."
        )
    if verdict == "none":
        return "The model explains these data: no error is detectable in them."
    if verdict == "unknown":
        assert where is not None
        if where.distorted:
            return (
                "No error of the equations is established, but the residuals are not noise: "
                f"{fit.tests[0].words}."
            )
        errors = [f"an error in {places_words(w)}" for w in (where, *where.others)]
        explains = f"no known cause explains {'these' if where.others else 'it'}"
        return f"There is {', and '.join(errors)}; {explains}."
    sizes = sizes_of(causes)
    required = either([_with_sizes(h, sizes) for h in sets])
    which = "; they do not separate these" if verdict == "ambiguous" else ""
    effects = {c.name: c.effect for h in sets for c in h.causes}
    forms = [refuted(c, effects[c.effect]) for c in causes if c.form.refuted]
    if where is not None and where.instead:
        each = " or in ".join(place_and_driver(w) for w in where.instead)
        forms.append(f"An error without a name explains as much: one in {each}.")
    return " ".join([f"The data require {required}{which}.", *forms])


def refuted(cause: Cause, effect: Effect) -> str:
    """That a cause acts otherwise than its ``effect`` has it, and how, as a sentence."""
    curve, p_value = cause.form.curve, cause.form.p_value
    assert curve is not None and p_value is not None
    doc = inspect.cleandoc(type(effect).__doc__ or "").split("\n\n")[0]
    formula = " ".join(doc.replace("``", "").split()).rstrip(".")
    how = f"{trend(curve)} with {Quantity(curve.covariate, '1').words}"
    what = f"the error in {place_words(curve.of)} {how}"
    stated = f"but not as {effect.name} has it ({formula})"
    if curve.of_gain:
        what, stated = f"{curve.of} {how}", "and is not constant"
    return f"The form of {effect.name} is refuted (p = {p_value:.1g}): {what}, {stated}."


def trend(curve: FormCurve) -> str:
    """Which way the data go over the driver, where they say so beyond their noise."""
    change = float(curve.data[-1] - curve.data[0])
    spread = float(np.ptp(curve.data))
    if abs(change) < max(0.5 * spread, 2.0 * float(np.hypot(curve.std[0], curve.std[-1]))):
        return "varies"
    return "rises" if change > 0.0 else "falls"


def still_distorted(fit: GoodnessOfFit) -> str:
    """A warning where residuals of the model with the causes are not noise."""
    return (
        f"the residuals of the extended model are not noise (p-value {fit.p_value:.2g}): "
        f"{fit.tests[0].words}"
    )


def _with_sizes(h: CauseSet, sizes: Sizes) -> list[str]:
    """Names of the effects of a cause set with their sizes."""
    effects = {c.name: c.effect for c in h.causes}
    words = []
    for name, own in sizes_by_effect(h, sizes).items():
        units = {n.key: n.unit for n in effects[name].parameters}
        numbers = [
            f"{key} = {plus_minus(size.value, size.std, units[key])}" for key, size in own.items()
        ]
        meanings = [w.of(own[key].value) for key, w in effects[name].wording.items() if key in own]
        words.append(f"{name} ({'; '.join([', '.join(numbers), *meanings])})")
    return words


def not_confirmed(what: str) -> str:
    """A warning where held-out drives reject what the log suggests."""
    return (
        f"{what}: significant in the log, but not confirmed on held-out drives; attributed to noise"
    )


def implausible_residuals(loud: Mapping[str, float], sensors: Sequence[Sensor]) -> list[str]:
    """A warning where residuals, so many times the stated noise, are larger than plausible errors
    of the equations make them; ``loud`` as :func:`sentence` has it."""
    most = {s.name: max(SHARES) * s.tolerance for s in sensors}
    far = [f"{n} are {times:.0f} times" for n, times in loud.items() if times > most[n]]
    if not far:
        return []
    return [
        f"the residuals of {' and '.join(far)} the noise that the vehicle file states, more than "
        "errors of the equations make them: a sign, a unit, signals that are swapped? `clutchest "
        "replay` tries each"
    ]


def doubtful(errors: Sequence[Curve]) -> tuple[str, ...]:
    """A warning where the likeliest of the ``errors`` would be significant if drives held out did
    not reject it, and there are none."""
    if not significant(errors, UNNAMED):
        return ()
    return (
        f"an error in '{errors[0].equation}' has p = {errors[0].p_value:.2g}: it may be noise or a "
        "small error of structure; another drive of the same vehicle, held out, would decide",
    )


def implausible(cause: Cause, effects: Sequence[Effect]) -> list[str]:
    """Warnings where the data require a size that is larger than plausible."""
    effect = next(effect for effect in effects if effect.name == cause.effect)
    warnings = []
    for n in effect.gains:
        if (size := cause.parameters.get(n.key)) is None:
            continue
        nearest = min(max(size.value, n.lower), n.upper)
        if abs(size.value - nearest) > 2.0 * size.std:
            warnings.append(
                f"{cause.effect}: {n.key} = "
                f"{plus_minus(size.value, size.std, n.unit)} "
                f"is larger than plausible ({nearest:.3g})"
            )
    return warnings
