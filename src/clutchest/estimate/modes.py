"""Modes of the dry clutch: which equations hold, and when, read from the signals alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from clutchest.signals import Floats


class Mode(IntEnum):
    """Modes of operation, as the output files name them."""

    open = 0
    slipping = 1
    locked = 2
    retracted = 3  # locked, and the actuator fully retracted
    unknown = 4  # no signal tells the slip


TOUCHING = 20.0  # Nm, of a measured torque: surfaces are pressed together
CREEPING = 0.01  # rad/s: at a slower slip nothing says that pressed surfaces slide
BARELY = 0.1  # of the slip that counts as locked: slower, and noise may be all there is of it
WOUND = 0.5  # of the slip: where more than this winds up the structure, surfaces may stick
FREE, SLIDING = "free_running", "sliding"  # flags that say more than which equations act
MODE_NAMES = tuple(mode.name for mode in Mode)


@dataclass(frozen=True, slots=True)
class Thresholds:
    """When a clutch counts as what.

    ``lock_slip`` rad/s and ``lock_time`` s: slip below this for this long is locked, averaged over
    ``lock_average`` s where a shuffling driveline shakes the speeds;
    ``retracted_position`` mm: motor position below which the actuator is home, for ``settle`` s;
    ``open_margin`` mm beyond the nominal kiss point: surely open, however hot;
    ``guard`` s around each transition without information from torque; ``gap`` s without a
    sample that the model needs: likewise.
    """

    lock_slip: float = 2.0
    lock_time: float = 0.3
    lock_average: float = 0.0
    open_margin: float = 2.5
    retracted_position: float = 0.3
    settle: float = 0.2
    guard: float = 0.1
    gap: float = 0.5

    @property
    def ahead(self) -> float:
        """What is known this much later, s, does not change a regime any more."""
        return self.lock_average / 2 + self.lock_time + self.guard

    @property
    def back(self) -> float:
        """Nor does what was known this much earlier, s."""
        return self.lock_average + self.lock_time + self.settle + 2 * self.guard

    @classmethod
    def of(cls, modes: Mapping[str, float]) -> Thresholds:
        """Those of a vehicle file, defaults where it is silent."""
        return cls(**modes)


@dataclass(frozen=True, slots=True)
class Regimes:
    """Per event time: ``mode`` (:class:`Mode`), and the flags of the model's equations."""

    mode: NDArray[np.uint8]
    free_running: NDArray[np.bool_]
    sliding: NDArray[np.bool_]
    engaged: NDArray[np.bool_]

    @classmethod
    def pressing(
        cls,
        time: Floats,
        torque: Floats | None,
        slip: Floats | None,
        yielding: float,
        lost: NDArray[np.bool_],
        guard: float,
    ) -> Regimes:
        """Of a clutch whose equations hold throughout, and whose state says how it stands.

        A torque sensor tells of pressed surfaces only: near the moment at which they touch or
        part, whether they slide already is more than a filter of first order can know.  Nor does
        torque tell the friction before they slide: what still winds up the structure behind
        them, ``yielding`` rad/Nm, is less than they could carry.
        """
        pressed = np.zeros(len(time), bool) if torque is None else np.abs(torque) > TOUCHING
        parted = _around(time, ~pressed, guard)
        winding = np.zeros(len(time), bool)
        if torque is not None and slip is not None and len(time) > 1:
            winding = _winding(time, torque * yielding, slip, guard)
        mode = np.where(winding, Mode.locked, Mode.slipping)
        mode = np.where(lost, Mode.unknown, np.where(parted, Mode.open, mode))
        return cls(mode.astype(np.uint8), ~lost, ~lost, ~lost)

    def flags(self, names: Sequence[str]) -> NDArray[np.bool_]:
        """The flags of these names, shape (n, len(names))."""
        columns = [getattr(self, name) for name in names]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.mode), 0), bool)


def classify(
    time: Floats,
    slip: Floats | None,
    position: Floats | None,
    motor: Floats | None,
    blind: NDArray[np.bool_],
    kiss_point: float,
    thresholds: Thresholds,
    lost: NDArray[np.bool_] | None = None,
) -> Regimes:
    """Regimes over ``time`` (s, shape (n,)).

    ``slip`` rad/s, ``position`` x and ``motor`` mm, None where there is no such signal; ``blind``
    marks times at which a needed signal is missing, ``lost`` those at which it has been for so
    long that nothing is known of the clutch.
    """
    if lost is None:
        lost = np.zeros(len(time), bool)
    if slip is None:
        no = np.zeros(len(time), bool)
        return Regimes(np.full(len(time), Mode.unknown, np.uint8), no, no, no)
    slip = _average(time, slip, thresholds.lock_average)
    still = np.abs(slip) < thresholds.lock_slip
    locked = _lasting(time, still, thresholds.lock_time)
    home = np.zeros(len(time), bool)
    if motor is not None:
        retracted = locked & (motor < thresholds.retracted_position)
        # a motor about to leave moves the piston before it is seen to be away
        leaving = _around(time, ~retracted, thresholds.guard)
        home = (_since(time, retracted) >= thresholds.settle) & ~leaving
    apart = np.zeros(len(time), bool)
    if position is not None:
        apart = position > kiss_point + thresholds.open_margin
    mode = np.where(
        home,
        Mode.retracted,
        np.where(locked, Mode.locked, np.where(apart, Mode.open, Mode.slipping)),
    )
    longest, least = thresholds.lock_time, BARELY * thresholds.lock_slip
    slides = ~locked | _ending(time, slip, locked, longest, least)
    slides |= _ending(-time[::-1], slip[::-1], locked[::-1], longest, least)[::-1]
    # near lock-up and break-away, and where slip passes zero, the sign of the torque is open
    near = _around(time, locked | still, thresholds.guard)
    return Regimes(
        np.where(lost, Mode.unknown, mode).astype(np.uint8),
        free_running=~(near & ~apart) & ~locked & ~blind,
        sliding=slides & ~lost,
        engaged=slides & ~apart & ~lost,
    )


def _average(time: Floats, value: Floats, window: float) -> Floats:
    """Mean of ``value`` over ``window`` s around each time, straight between the times."""
    if window <= 0.0 or len(time) < 2:
        return value
    area = np.concatenate([[0.0], np.cumsum(np.diff(time) * (value[1:] + value[:-1]) / 2)])
    a = np.clip(time - window / 2, time[0], time[-1])
    b = np.clip(time + window / 2, time[0], time[-1])
    return (np.interp(b, time, area) - np.interp(a, time, area)) / (b - a)


def _winding(time: Floats, twist: Floats, slip: Floats, over: float) -> NDArray[np.bool_]:
    """Whether the last ``over`` s of slip (rad/s) went into the structure's twist (rad) rather
    than into sliding, or were too little to tell."""
    path = np.concatenate([[0.0], np.cumsum(np.diff(time) * (slip[1:] + slip[:-1]) / 2)])
    before = time - over
    slipped = path - np.interp(before, time, path)
    wound = twist - np.interp(before, time, twist)
    return (wound * np.sign(slipped) > WOUND * np.abs(slipped)) | (
        np.abs(slipped) < CREEPING * over
    )


@njit(cache=True)
def _lasting(time, flag, least):  # type: ignore[no-untyped-def]
    """``flag`` where it holds for at least ``least`` s on end."""
    kept, start = np.zeros(len(flag), np.bool_), 0
    for k in range(len(flag)):
        if not flag[k]:
            continue
        if k == 0 or not flag[k - 1]:
            start = k
        if (k + 1 == len(flag) or not flag[k + 1]) and time[k] - time[start] >= least:
            kept[start : k + 1] = True
    return kept


@njit(cache=True)
def _ending(time, slip, locked, longest, least):  # type: ignore[no-untyped-def]
    """Where a clutch that counts as ``locked`` still slides, for ``longest`` s at most: until the
    slip first falls below ``least``.  What is left of it then makes a thousandth of the heat."""
    found, start = np.zeros(len(locked), np.bool_), -1
    for k in range(1, len(locked)):
        if not locked[k]:
            start = -1
        elif not locked[k - 1]:
            start = k
        if start >= 0:
            along = slip[k] if slip[start] > 0.0 else -slip[k]
            found[k] = along > least and time[k] - time[start] < longest
            start = start if found[k] else -1
    return found


@njit(cache=True)
def _since(time, flag):  # type: ignore[no-untyped-def]
    """For how long ``flag`` has held, s; −1 where it does not."""
    since, start = np.full(len(flag), -1.0), 0
    for k in range(len(flag)):
        if flag[k]:
            if k == 0 or not flag[k - 1]:
                start = k
            since[k] = time[k] - time[start]
    return since


@njit(cache=True)
def _around(time, flag, guard):  # type: ignore[no-untyped-def]
    """``flag``, widened by ``guard`` s on both sides."""
    found, last, following = flag.copy(), -1, -1
    for k in range(len(flag)):
        last = k if flag[k] else last
        found[k] |= last >= 0 and time[k] - time[last] < guard
    for k in range(len(flag) - 1, -1, -1):
        following = k if flag[k] else following
        found[k] |= following >= 0 and time[following] - time[k] < guard
    return found


def runs(flag: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Starts and ends (exclusive) of the runs of True."""
    edges = np.diff(np.concatenate([[0], flag.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
