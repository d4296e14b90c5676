"""The dry clutch's modes, open, slipping, locked and retracted, by speeds and positions."""

from __future__ import annotations

from collections.abc import Container

import numpy as np
from numpy.typing import NDArray

from clutchest.models.regimes import (
    MODE_NAMES,
    Mode,
    Observed,
    Outputs,
    RegimeRules,
    Regimes,
    around,
    average,
    lasting,
    since,
)
from clutchest.models.thresholds import Thresholds
from clutchest.native import compiled
from clutchest.signals import Floats

BARELY = 0.1  # of the slip that counts as locked: below, it may be noise alone
TORQUE_FLOOR = 5.0  # Nm; a clutch that passes less counts as open
RESTS = 1.0  # rad/s, of a shaft that does not turn
SLOWING, SLOWING_S = 1.0, 0.5  # rad/s², of a shaft that nothing drives, and s over which it shows


def judge(observed: Observed) -> Regimes:
    """See :class:`~clutchest.models.regimes.RegimeRules`."""
    p = observed.parameters
    speed, shaft = observed.at("engine_speed"), observed.at("input_shaft_speed")
    position = observed.at("slave_position")
    assert speed is not None
    return classify(
        observed.time,
        None if shaft is None else speed - shaft,
        shaft,
        None if position is None else position - p["position_origin"] - p["kiss_point"],
        observed.at("motor_position"),
        observed.missing,
        observed.thresholds,
        observed.lost,
    )


def refine(mode: NDArray[np.uint8], outputs: Outputs, inputs: Container[str]) -> NDArray[np.uint8]:
    """Open or slipping, by the estimated torque: the kiss point moves with heat and wear."""
    if "slave_position" not in inputs:
        return mode
    mode, idle = mode.copy(), np.abs(outputs["transmitted_torque"]) < TORQUE_FLOOR
    apart = mode <= Mode.slipping
    mode[apart] = np.where(idle[apart], Mode.open, Mode.slipping)
    return mode


def classify(
    time: Floats,
    slip: Floats | None,
    shaft: Floats | None,
    beyond: Floats | None,
    motor: Floats | None,
    blind: NDArray[np.bool_],
    thresholds: Thresholds,
    lost: NDArray[np.bool_] | None = None,
) -> Regimes:
    """Regimes over ``time`` (s, shape (n,)).

    ``slip`` and ``shaft`` rad/s, ``beyond`` the kiss point and ``motor`` position mm, None where
    there is no such signal; ``blind`` marks times at which a needed signal is missing, ``lost``
    those at which it has been for so long that the state of the clutch is unknown.
    """
    if lost is None:
        lost = np.zeros(len(time), bool)
    if slip is None or shaft is None:
        no = np.zeros(len(time), bool)
        return Regimes(np.full(len(time), Mode.unknown, np.uint8), no, no, no)
    slip = average(time, slip, thresholds.lock_average)
    still = np.abs(slip) < thresholds.lock_slip
    locked = lasting(time, still, thresholds.lock_time)
    home = np.zeros(len(time), bool)
    if motor is not None:
        retracted = locked & (motor < thresholds.retracted_position)
        # a motor that starts to move carries the piston before its position exceeds the threshold
        leaving = around(time, ~retracted, thresholds.guard)
        home = (since(time, retracted) >= thresholds.settle) & ~leaving
    apart = np.zeros(len(time), bool)
    if beyond is not None:
        apart = beyond > thresholds.open_margin
    elif thresholds.longest_engagement > 0.0:
        apart = _disengaged(time, slip, shaft, locked, thresholds)
    mode = np.where(
        home,
        Mode.retracted,
        np.where(locked, Mode.locked, np.where(apart, Mode.open, Mode.slipping)),
    )
    longest, least = thresholds.lock_time, BARELY * thresholds.lock_slip
    slides = ~locked | _ending(time, slip, locked, longest, least)
    slides |= _ending(-time[::-1], slip[::-1], locked[::-1], longest, least)[::-1]
    # near lock-up and break-away, and where slip passes zero, the sign of the torque is unknown
    near = around(time, locked | still, thresholds.guard)
    return Regimes(
        np.where(lost, Mode.unknown, mode).astype(np.uint8),
        free_running=~(near & ~apart) & ~locked & ~blind,
        sliding=slides & ~lost,
        engaged=slides & ~apart & ~lost,
    )


def _disengaged(
    time: Floats,
    slip: Floats,
    shaft: Floats,
    locked: NDArray[np.bool_],
    thresholds: Thresholds,
) -> NDArray[np.bool_]:
    """Where speeds alone tell that no torque passes, without an engagement that ends soon:
    standing, rolling with the engine slower than the shaft, or slowing down beside a faster engine,
    which a clutch that slips would drive."""
    rests = np.abs(shaft) < RESTS
    averaged = average(time, shaft, SLOWING_S)
    before, after = (
        np.interp(time + shift, time, averaged) for shift in (-SLOWING_S / 2, SLOWING_S / 2)
    )
    slows = after - before < -SLOWING * SLOWING_S
    idle = ~locked & (rests | (slip < -thresholds.lock_slip) | slows)
    longest = thresholds.longest_engagement
    engages = (_until(time, locked) <= longest) | (rests & (_until(time, ~rests) <= longest))
    return np.asarray(idle & ~engages)


def _until(time: Floats, flag: NDArray[np.bool_]) -> Floats:
    """s until ``flag`` holds next; infinite where it never does."""
    when = np.append(time[flag], np.inf)
    return np.asarray(when[np.searchsorted(when, time)] - time)


@compiled
def _ending(time, slip, locked, longest, least):  # type: ignore[no-untyped-def]
    """Where a clutch that counts as ``locked`` still slides, for ``longest`` s at most: until the
    slip first falls below ``least``.  The rest of it makes a thousandth of the heat."""
    sliding, start = np.zeros(len(locked), np.bool_), -1
    for k in range(1, len(locked)):
        if not locked[k]:
            start = -1
        elif not locked[k - 1]:
            start = k
        if start >= 0:
            along = slip[k] if slip[start] > 0.0 else -slip[k]
            sliding[k] = along > least and time[k] - time[start] < longest
            start = start if sliding[k] else -1
    return sliding


RULES = RegimeRules(
    MODE_NAMES,
    ("engine_speed", "input_shaft_speed", "slave_position", "motor_position"),
    judge,
    refine,
    "slipping",
    (
        "lock_slip",
        "lock_time",
        "lock_average",
        "open_margin",
        "retracted_position",
        "settle",
        "guard",
        "longest_engagement",
    ),
)
