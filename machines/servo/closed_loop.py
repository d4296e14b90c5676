"""The servo's runs under its own controller, as a fitted model moves the arm: records without an
error of the model, of which every finding is a false alarm.

A stationary acceleration disturbs the arm.  Its spectrum is that with which the program's
innovations of such records have the variance and the autocorrelation of its innovations of the
measured one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import coloured_noise  # noqa: E402
from convert import EVERY, SCALE, SIGN, table  # noqa: E402
from run import STEP, Bench, by_machine, controller  # noqa: E402

from clutchest.identify.fitted_machine import FittedMachine  # noqa: E402
from clutchest.signals import Signals  # noqa: E402

READING = EVERY * STEP  # s
FREQUENCIES = np.linspace(0.0, 0.5 / READING, 101)  # Hz
PASSED = 10.0  # Hz, above which little of the disturbance passes the converter's means over 40 ms
INITIAL = 1.0  # rad²/s³, the spectrum that the search begins with
TURNS = 6  # of the search, each with a record


@dataclass(frozen=True)
class Loop:
    """The ``runs`` of a record on a ``bench``, as a ``fitted`` model moves them to goals that
    arrive ``late`` steps later and are aimed at by ``rate`` rad/s at most, disturbed by an
    acceleration of a ``spectrum`` (rad/s²)²/Hz at the FREQUENCIES."""

    runs: Sequence[pd.DataFrame]
    bench: Bench
    fitted: FittedMachine
    late: int
    rate: float
    spectrum: np.ndarray

    @classmethod
    def of(cls, runs: Sequence[pd.DataFrame], fitted: FittedMachine) -> Loop:
        """Those of a record, by its own controller."""
        bench = Bench(list(runs))
        late, rate, _ = controller(bench)
        return cls(runs, bench, fitted, late, rate, np.full(len(FREQUENCIES), INITIAL))

    def disturbance(self, seed: int) -> np.ndarray:
        """rad/s² (steps, runs)."""
        rng, (steps, count) = np.random.default_rng(seed), self.bench.goal.shape
        return coloured_noise.drawn(FREQUENCIES, self.spectrum, STEP, (count, steps), rng).T

    def drawn(self, seed: int) -> list[pd.DataFrame]:
        """Tables of the runs, as the converter gives them."""
        pushed = self.disturbance(seed)
        position, duty = by_machine(self.bench, self.fitted, self.late, self.rate, pushed)
        on = np.array([self.bench.switched(k, self.late) for k in range(len(position))])
        reported = np.where(duty > 0.0, SIGN + duty / SCALE, -duty / SCALE)
        made = []
        for i, run in enumerate(self.runs):
            own = {"position_rad": position, "torque": reported, "torque_enabled": on}
            columns = {name: value[: len(run), i] for name, value in own.items()}
            made.append(table(run.reset_index(drop=True).assign(**columns)))
        return made

    def as_noisy(self, signals: Signals, read: Callable[[Sequence[pd.DataFrame]], Signals]) -> Loop:
        """One whose draws have innovations, of the model fitted anew, of the autocovariance of
        those of the ``signals``; ``read``: tables as signals."""
        loop, wanted = self, _visible(self.fitted, signals)
        for turn in range(TURNS):
            made = read(loop.drawn(1_000_000 + turn))
            own = FittedMachine.of(made, self.fitted.vehicle)
            known = loop.spectrum, wanted, _visible(own, made)
            spectrum = coloured_noise.corrected(FREQUENCIES, *known, PASSED)
            loop = replace(loop, spectrum=spectrum)
        return loop


def _visible(fitted: FittedMachine, signals: Signals) -> np.ndarray:
    """The spectrum of the innovations at the ``FREQUENCIES``."""
    return coloured_noise.visible(fitted, signals, READING, FREQUENCIES)
