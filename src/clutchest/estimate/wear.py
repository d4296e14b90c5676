"""How much is worn, how fast, and how long the pads will last, with the uncertainty of each."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np

from clutchest.estimate.initial_state import History
from clutchest.estimate.observability import covariance
from clutchest.estimate.whole_log import Belief, Compiled
from clutchest.models.declarations import Wear
from clutchest.quantity import Quantity
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import process_noise

Z = 1.96  # standard deviations of a 95 % interval
MJ = 1e6
LARGE = 0.5  # share of the standard deviation of wear: what has it is named

Interval = tuple[float | None, float | None]


def wear_trend(
    vehicle: Vehicle, compiled: Compiled, belief: Belief, history: History
) -> dict[str, Any] | None:
    """The section ``wear`` of the summary after the drive that ended in ``belief``.

    None where the model has no wear or the signals do not show it.
    """
    model, wear = compiled.model, compiled.machine.wear
    names = {state.name for state in model.states} - set(model.unobservable)
    if wear is None or not {wear.state, wear.rate_state} - {""} <= names:
        return None
    known = _estimated(vehicle, compiled, belief) if wear.rate_state else None
    if known is None:
        known = _over_drives(vehicle, compiled, belief, history)
    amount, speed, P = known
    useful = vehicle.estimation.get(wear.state, model.states[model.state(wear.state)]).useful_std
    if sqrt(P[0, 0]) > useful:  # a prior is no wear
        return None
    new, limit = vehicle.parameters[wear.nominal], vehicle.limits.get("wear")
    spent = history.slip_energy_J / MJ
    most = limit.value if limit is not None else abs(new.value)
    if speed is not None and sqrt(P[1, 1]) * spent > most:  # hardly any slip: it may be anything
        speed = None
    P[0, 0] += new.spread**2  # wear is counted from the part when new, which no drive shows
    energy = float(belief.E[0]) / MJ
    energy_std = sqrt(float(belief.E[1] + np.sum((belief.sE * compiled.spread) ** 2))) / MJ
    trend: dict[str, Any] = {
        "amount": _estimate(amount, sqrt(P[0, 0]), wear.unit),
        "new": {"value": new.value, "std": new.spread, "unit": wear.unit},
        "rate": _estimate(speed, float(np.sqrt(P[1, 1])), f"{wear.unit}/MJ"),
        "slip_energy": _estimate(energy, energy_std, "MJ"),
        "limit": None,
        "remaining": None,
    }
    if limit is not None:
        trend["limit"] = {"value": limit.value, "unit": limit.unit}
        position = model.state(wear.state)
        wandering = process_noise(vehicle, model)[len(model.states) + position] * MJ
        left = limit.value - amount
        trend["remaining"] = remaining(left, wear.unit, speed, P, wandering, history)
    trend["words"] = _words(trend, wear, history.wear_std > 0.0)
    return trend


# amount, rate, covariance of what is left and rate, where the part when new is known exactly
Wearing = tuple[float, float | None, Floats]


def _estimated(vehicle: Vehicle, compiled: Compiled, belief: Belief) -> Wearing:
    """Amount and rate as states of the model."""
    model, wear = compiled.model, compiled.machine.wear
    assert wear is not None
    position, rate = model.state(wear.state), model.state(wear.rate_state)
    P = covariance(compiled, belief)[np.ix_([position, rate], [position, rate])]
    amount = wear.sign * (float(belief.x[position]) - vehicle.parameters[wear.nominal].value)
    known = any(effect.name == wear.effect for effect in model.effects)
    of_file = vehicle.effects[wear.effect].get(wear.rate, 0.0) if known else 0.0
    if known:  # the state is what the rate is beside the file's, which may be off itself
        k = compiled.thetas.index((wear.effect, wear.rate))
        across = belief.S[[position, rate], k] * compiled.spread[k] ** 2
        P += np.array([[0.0, across[0]], [across[0], 2.0 * across[1] + compiled.spread[k] ** 2]])
    P *= np.outer([-wear.sign, 1.0], [-wear.sign, 1.0])  # of what is left, and of the rate
    return amount, float(belief.x[rate]) + of_file, P


def _over_drives(vehicle: Vehicle, compiled: Compiled, belief: Belief, history: History) -> Wearing:
    """Amount by the present drive; rate by its difference from the first one that knew it, in which
    errors of parameters cancel: None without an earlier drive."""
    model, wear = compiled.model, compiled.machine.wear
    assert wear is not None
    position = model.state(wear.state)
    value, own = float(belief.x[position]), float(belief.P[position, position])
    variance = float(covariance(compiled, belief)[position, position])
    amount = wear.sign * (value - vehicle.parameters[wear.nominal].value)
    slipped = (history.slip_energy_J - history.wear_J) / MJ
    if history.wear_std <= 0.0 or slipped <= 0.0:
        return amount, None, np.diag([variance, np.inf])
    rate = wear.sign * (value - history.wear_state) / slipped
    of_rate = (own + history.wear_std**2) / slipped**2
    return amount, rate, np.array([[variance, -own / slipped], [-own / slipped, of_rate]])


def remaining_energy(left: float, rate: float, P: Floats, wandering: float) -> Interval:
    """95 % interval of the slip energy in MJ after which the limit is reached.

    ``left`` (mm) at ``rate`` (mm/MJ), ``P`` (2, 2) covariance of both, ``wandering`` (mm²/MJ) the
    variance that slip adds to the wear.  What is left after r MJ, left − rate · r, is normal
    with variance P₀₀ − 2 r P₀₁ + r² P₁₁ + wandering · r; the interval holds the r at which it is
    not clearly on one side of zero (Fieller's theorem: two roots of a parabola).  Its upper end is
    None where the rate may be zero.
    """
    z2 = Z**2
    a = rate**2 - z2 * P[1, 1]
    b = left * rate + z2 * (wandering / 2 - P[0, 1])
    c = left**2 - z2 * P[0, 0]
    root = sqrt(max(b**2 - a * c, 0.0))
    if left <= 0.0 <= c:
        return 0.0, 0.0
    low = 0.0 if c <= 0.0 else c / (b + root) if b + root > 0.0 else None
    return low, (b + root) / a if a > 0.0 and rate > 0.0 else None


def _estimate(value: float | None, std: float, unit: str) -> dict[str, Any]:
    if value is None:
        return {"value": None, "std": None, "ci95": [None, None], "unit": unit}
    return {"value": value, "std": std, "ci95": [value - Z * std, value + Z * std], "unit": unit}


def remaining(
    left: float, unit: str, rate: float | None, P: Floats, wandering: float, history: History
) -> dict[str, Any]:
    """What is left, in the ``unit`` of wear, MJ, hours of driving and slip events as seen so
    far."""
    energy = max(left, 0.0) / rate if rate and rate > 0.0 else (0.0 if left <= 0.0 else None)
    ends: Interval = (None, None)
    if rate is not None:
        ends = remaining_energy(left, rate, P, wandering)
    spent = history.slip_energy_J / MJ
    per_MJ = {
        "MJ": 1.0,
        "h": history.driven_s / 3600.0 / spent if spent > 0.0 else None,
        "engagements": (history.engagements or None) and history.engagements / spent,
    }
    std = sqrt(P[0, 0])
    remaining: dict[str, Any] = {unit: {"value": left, "ci95": [left - Z * std, left + Z * std]}}
    for name, scale in per_MJ.items():
        value, low, high = (
            None if number is None or scale is None else number * scale
            for number in (energy, *ends)
        )
        remaining[name] = {"value": value, "ci95": [low, high]}
    return remaining


def _words(trend: Mapping[str, Any], wear: Wear, followed: bool) -> list[str]:
    """Two sentences; ``followed``: drives before this one are known."""
    rate, energy, limit = trend["rate"], trend["slip_energy"], trend["limit"]
    unit = Quantity("wear", wear.unit).shown
    of = "" if limit is None else f" of {_read(limit['value'], wear):g} {unit}"
    first = f"Worn {_plus_minus(trend['amount'], wear, 2)} {unit}{of}"
    if trend["new"]["std"] > LARGE * trend["amount"]["std"]:
        first += f", counted from {wear.nominal} = {_plus_minus(trend['new'], wear, 2)} {unit}"
    if rate["value"] is not None:
        first += f", at {_plus_minus(rate, wear, 3)} {unit}/MJ"
    first += f"; {energy['value']:.3g} MJ of slip so far."
    if limit is None:
        return [first, "Remaining life: unknown, the vehicle file has no limit ([limits] wear)."]
    if rate["value"] is None and trend["remaining"][wear.unit]["value"] > 0.0:
        takes = (
            "more slip since the first drive" if followed else "a drive before this one (--state)"
        )
        return [first, f"Remaining life: unknown, a trend takes {takes}."]
    return [first, _left(trend["remaining"], wear)]


def _plus_minus(each: Mapping[str, Any], wear: Wear, least: int) -> str:
    """Value and standard deviation as people read them, with so many decimals at ``least`` and
    those that the deviation deserves."""
    value, std = _read(each["value"], wear), _read(each["std"], wear)
    digits = max(least, -int(np.floor(np.log10(std)))) if std > 0.0 else least
    return f"{round(value, digits) + 0.0:.{digits}f} ± {std:.{digits}f}"  # no minus before a zero


def _read(value: float, wear: Wear) -> float:
    return float(Quantity("wear", wear.unit).read(np.array([value]))[0])


def _left(left: Mapping[str, Any], wear: Wear) -> str:
    low, high = left["MJ"]["ci95"]
    if left[wear.unit]["value"] <= 0.0:
        return "The limit is reached."
    if low is None:
        return f"Remaining life: unknown, by these data no wear of the {wear.part} shows."
    if high is None:
        words = f"Remaining life: at least {low:.3g} MJ"
        more = _as_driven(left, 0)
        return f"{words}{more}; not bounded from above by these data, the rate may be zero."
    words = f"Remaining life: {left['MJ']['value']:.3g} MJ (95 %: {low:.3g} to {high:.3g})"
    return f"{words}{_as_driven(left, None)}."


def _as_driven(left: Mapping[str, Any], end: int | None) -> str:
    """The same in hours and slip events: the value, or an end of the interval."""
    hours, events = (
        left[unit]["value"] if end is None else left[unit]["ci95"][end]
        for unit in ("h", "engagements")
    )
    if hours is None or events is None:
        return ""
    return f", {hours:.3g} h or {events:.3g} slip events if driven as so far"
