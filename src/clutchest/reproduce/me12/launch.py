"""Fig. 11: launches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import Setup
from clutchest.reproduce.me12.model import NO_DISC, STATIC, Compared
from clutchest.signals import Floats

SEEDS = (1, 2, 3)
LENGTH = 600.0  # s
MODEST = (30e3, 80e3)  # J: the paper's warms the disc from 70 to some 100 °C
LARGEST = 104.0  # Nm
SHOWN = 83.0  # s, where the paper's launch begins
APART, LEAST = 1.0, 0.5  # s between launches, and least length of one


@dataclass(frozen=True, slots=True)
class Launches:
    """One drive and its modest launches, a run of rows each."""

    compared: Compared
    static: Floats
    launches: tuple[NDArray[np.intp], ...]

    @classmethod
    def of(cls, setup: Setup, seed: int) -> Launches:
        """Drive it and run the model along."""
        compared = Compared.of(setup.drive("launches", seed, LENGTH), setup)
        run = compared.run
        power = run.quantity("power")[0]
        rows = np.flatnonzero(compared.slipping & (run.quantity("slip_speed")[0] > 0.0))
        runs = np.split(rows, np.flatnonzero(np.diff(run.time[rows]) > APART) + 1)
        modest = tuple(
            r
            for r in runs
            if len(r)
            and run.time[r[-1]] - run.time[r[0]] > LEAST
            and MODEST[0] < np.trapezoid(power[r], run.time[r]) < MODEST[1]
        )
        return cls(compared, compared.reference(**STATIC)[1], modest)

    def errors(self, torque: Floats) -> Floats:
        """Largest error of a torque in every launch, Nm."""
        wrong = np.abs(torque - self.compared.measured)
        return np.array([wrong[rows].max() for rows in self.launches])

    def shown(self) -> NDArray[np.intp]:
        """The launch that lies nearest to the paper's time."""
        time = self.compared.run.time
        return min(self.launches, key=lambda rows: abs(time[rows[0]] - SHOWN))


def validation(setup: Setup) -> Verdict:
    """D8, in every modest launch of every drive."""
    drives = [Launches.of(setup, seed) for seed in SEEDS]
    own = np.concatenate([d.errors(d.compared.run.torque) for d in drives])
    static = np.concatenate([d.errors(d.static) for d in drives])
    return Verdict(
        f"largest error {own.max():.0f} Nm (median {np.median(own):.0f} Nm) in {len(own)} "
        f"launches; static {static.max():.0f} Nm (median {np.median(static):.0f} Nm), worse in "
        f"{np.sum(static > own)}",
        bool(own.max() < LARGEST and np.all(static > own)),
        {
            "largest_Nm": float(own.max()),
            "static_largest_Nm": float(static.max()),
            "launches": len(own),
            "median_Nm": float(np.median(own)),
            "static_median_Nm": float(np.median(static)),
        },
        drives[0],
    )


CLAIMS = (
    Claim(
        "D8",
        f"launches of {MODEST[0] / 1e3:.0f}–{MODEST[1] / 1e3:.0f} kJ, open loop from 0 s "
        f"(all of {len(SEEDS)} drives)",
        "Fig. 11",
        "error always below 104 Nm, better than static",
        validation,
        {
            "static curve": lambda s: s.modelled(**STATIC),
            "no disc term": lambda s: s.modelled(**NO_DISC),
        },
        ("torque_delay", "torque_error", "parameter_error"),
    ),
)
