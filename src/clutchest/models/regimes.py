"""Regimes of a machine: which of its equations hold, and when, judged from the signals alone."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from clutchest.models.thresholds import EVERYWHERE, THRESHOLD_UNITS, Thresholds
from clutchest.native import compiled
from clutchest.signals import Floats

FREE, SLIDING = "free_running", "sliding"  # flags that the timeline and the kernel use as well


class Mode(IntEnum):
    """Modes of a clutch, as the output files name them: the code is the place in its machine's
    ``modes``."""

    open = 0
    slipping = 1
    locked = 2
    retracted = 3  # locked, and the actuator fully retracted
    unknown = 4  # no signal gives the slip


MODE_NAMES = tuple(mode.name for mode in Mode)


@dataclass(frozen=True, slots=True)
class Regimes:
    """Per time (n): ``mode``, the place of its name among the machine's modes, and the flags that
    equations can use.

    ``free_running``: the equations of states that are a random walk otherwise
    (:attr:`~clutchest.models.model.Model.renewed`) hold; ``sliding``: power is dissipated, so that
    bends of the inputs between readings matter; ``engaged``: power could be dissipated unseen;
    ``moving``: what a fit tracks does not stand still, ``fast``: nor does it creep; both hold where
    a machine does not tell.
    """

    mode: NDArray[np.uint8]
    free_running: NDArray[np.bool_]
    sliding: NDArray[np.bool_]
    engaged: NDArray[np.bool_]
    moving: NDArray[np.bool_] | None = None
    fast: NDArray[np.bool_] | None = None

    def flags(self, names: Sequence[str]) -> NDArray[np.bool_]:
        """The flags of these names, shape (n, len(names))."""
        everywhere = np.ones(len(self.mode), bool)
        flags = (getattr(self, name) for name in names)
        columns = [everywhere if flag is None else flag for flag in flags]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.mode), 0), bool)


@dataclass(frozen=True)
class Observed:
    """What regimes are judged by, at every ``time`` (n,) s.

    ``at`` gives a signal's values (n,), None where there is no such signal; ``missing`` (n,) times
    at which a signal that the equations need is missing, ``lost`` those at which it has been for so
    long that the state of the machine is unknown; ``parameters`` of the vehicle file by key.
    """

    time: Floats
    at: Callable[[str], Floats | None]
    missing: NDArray[np.bool_]
    lost: NDArray[np.bool_]
    parameters: Mapping[str, float]
    thresholds: Thresholds


def always(observed: Observed) -> Regimes:
    """One regime throughout, of a machine whose equations always hold."""
    known = ~observed.lost
    return Regimes(observed.lost.astype(np.uint8), known, known, known)


Outputs = Mapping[str, Floats]
Refinement = Callable[[NDArray[np.uint8], Outputs, Container[str]], NDArray[np.uint8]]


def as_judged(
    mode: NDArray[np.uint8], outputs: Outputs, inputs: Container[str]
) -> NDArray[np.uint8]:
    """The modes as judged from the signals alone."""
    return mode


@dataclass(frozen=True)
class RegimeRules:
    """How a machine's regimes are known.

    ``modes``: names as the output files have them, the last one "unknown"; ``signals``: canonical
    columns that ``judge`` uses; ``refine``: mode (r,) by what is estimated, from the modes that
    the signals give, the model's outputs by name, (r,) each, and the names of its inputs;
    ``event``: the mode whose intervals are reported as events, "" for none; ``thresholds`` that
    ``judge`` compares with, which a vehicle file may set in ``[modes]``.
    """

    modes: tuple[str, ...] = ("running", "unknown")
    signals: tuple[str, ...] = ()
    judge: Callable[[Observed], Regimes] = always
    refine: Refinement = as_judged
    event: str = ""
    thresholds: tuple[str, ...] = ()

    @property
    def threshold_units(self) -> dict[str, str]:
        """Threshold → unit, of all that a vehicle file may set."""
        return {name: THRESHOLD_UNITS[name] for name in (*self.thresholds, *EVERYWHERE)}


def average(time: Floats, value: Floats, window: float) -> Floats:
    """Mean of ``value`` over ``window`` s around each time, straight between the times."""
    if window <= 0.0 or len(time) < 2:
        return value
    area = np.concatenate([[0.0], np.cumsum(np.diff(time) * (value[1:] + value[:-1]) / 2)])
    a = np.clip(time - window / 2, time[0], time[-1])
    b = np.clip(time + window / 2, time[0], time[-1])
    return (np.interp(b, time, area) - np.interp(a, time, area)) / (b - a)


@compiled
def lasting(time, flag, least):  # type: ignore[no-untyped-def]
    """``flag`` where it holds for at least ``least`` s without a break."""
    kept, start = np.zeros(len(flag), np.bool_), 0
    for k in range(len(flag)):
        if not flag[k]:
            continue
        if k == 0 or not flag[k - 1]:
            start = k
        if (k + 1 == len(flag) or not flag[k + 1]) and time[k] - time[start] >= least:
            kept[start : k + 1] = True
    return kept


@compiled
def since(time, flag):  # type: ignore[no-untyped-def]
    """For how long ``flag`` has held, s; −1 where it does not."""
    since, start = np.full(len(flag), -1.0), 0
    for k in range(len(flag)):
        if flag[k]:
            if k == 0 or not flag[k - 1]:
                start = k
            since[k] = time[k] - time[start]
    return since


@compiled
def around(time, flag, guard):  # type: ignore[no-untyped-def]
    """``flag``, widened by ``guard`` s on both sides."""
    widened, last, following = flag.copy(), -1, -1
    for k in range(len(flag)):
        last = k if flag[k] else last
        widened[k] |= last >= 0 and time[k] - time[last] < guard
    for k in range(len(flag) - 1, -1, -1):
        following = k if flag[k] else following
        widened[k] |= following >= 0 and time[following] - time[k] < guard
    return widened


def runs(flag: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Starts and ends (exclusive) of the runs of True."""
    edges = np.diff(np.concatenate([[0], flag.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
