"""The servo's runs under its own controller, as a fitted model moves the arm: records without an
error of the model, of which every finding is a false alarm.

What the model leaves of the record is drawn in blocks as an acceleration that disturbs the arm, as
large as gives innovations of the record's size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from convert import EVERY, SCALE, SIGN, table
from run import STEP, Bench, by_machine, controller

from clutchest.identify.fitted_machine import FittedMachine
from clutchest.signals import Signals

BLOCK = 64  # readings
READING = EVERY * STEP  # s
TURNS = 2  # of the search for the size


@dataclass(frozen=True)
class Loop:
    """The ``runs`` of a record on a ``bench``, as a ``fitted`` model moves them to goals that
    arrive ``late`` steps later and are aimed at by ``rate`` rad/s at most; ``rest`` (k) rad/s² at
    the record's readings is drawn, times ``size``."""

    runs: Sequence[pd.DataFrame]
    bench: Bench
    fitted: FittedMachine
    late: int
    rate: float
    rest: np.ndarray
    size: float = 1.0

    @classmethod
    def of(cls, runs: Sequence[pd.DataFrame], fitted: FittedMachine, signals: Signals) -> Loop:
        """Those of a record, as ``signals`` too, by its own controller."""
        bench = Bench(list(runs))
        late, rate, _ = controller(bench)
        rest = innovations(fitted, signals) / READING
        return cls(runs, bench, fitted, late, rate, rest - rest.mean())

    def disturbance(self, seed: int) -> np.ndarray:
        """rad/s² (steps, runs): blocks that begin anywhere, on a circle."""
        rng, (steps, count) = np.random.default_rng(seed), self.bench.goal.shape
        blocks = -(-(steps // EVERY + 2) // BLOCK)
        begins = rng.integers(len(self.rest), size=(count, blocks))
        rows = (begins[..., None] + np.arange(BLOCK)).reshape(count, -1) % len(self.rest)
        at, known = np.arange(steps) / EVERY, np.arange(rows.shape[1])
        return self.size * np.array([np.interp(at, known, self.rest[own]) for own in rows]).T

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

    def as_loud(self, read: Callable[[Sequence[pd.DataFrame]], Signals]) -> Loop:
        """One whose draws have innovations of the record's size; ``read``: tables as signals."""
        loop, wanted = self, READING * np.std(self.rest)
        for turn in range(TURNS):
            made = read(loop.drawn(1_000_000 + turn))
            shown = innovations(FittedMachine.of(made, self.fitted.vehicle), made)
            loop = replace(loop, size=loop.size * float(wanted / np.std(shown)))
        return loop


def innovations(fitted: FittedMachine, signals: Signals) -> np.ndarray:
    """Errors (k) rad/s of the speed one reading ahead, of all runs."""
    return np.concatenate([each.error for each in fitted.predicted(signals, "speed")])
