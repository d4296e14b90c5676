"""Fig. 5: heat moves the zero position, and cooling moves it back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import curve_fit

from clutchest.models.regimes import Mode
from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import NONE, Setup
from clutchest.reproduce.me12.model import Compared, rms
from clutchest.signals import Floats

SETTLED = 4.0  # τ_d after a slip, when its disc term is gone
BETWEEN = 60.0  # s: a pause between readings that is longer is a heating
ALIKE = 0.02  # mm: the model's zero position lies so close to the measured one
CERTAIN = 30.0  # of χ²: a second exponential that takes three numbers is there


@dataclass(frozen=True, slots=True)
class ZeroPosition:
    """Readings of x0 while the actuator is retracted, the disc as warm as the body: ``time`` s,
    ``measured`` and ``modelled`` mm, shape (m,)."""

    compared: Compared
    time: Floats
    measured: Floats
    modelled: Floats

    @classmethod
    def of(cls, setup: Setup, scenario: str) -> ZeroPosition:
        """Drive a scenario and run the model along."""
        compared = Compared.of(setup.drive(scenario, 1), setup)
        run, p = compared.run, setup.vehicle.parameters
        settle = SETTLED * p["heat_capacity_disc"].value / p["conductance_disc_body"].value
        slips = run.mode == Mode.slipping
        since = run.time - np.maximum.accumulate(np.where(slips, run.time, -np.inf))
        rows = np.flatnonzero((run.mode == Mode.retracted) & (since > settle))
        slave, expansion = run.quantity("slave_position", "expansion")
        modelled = p["zero_position_ref"].value + expansion
        return cls(compared, run.time[rows], slave[rows], modelled[rows])

    def rests(self) -> list[slice]:
        """The stretches between heatings."""
        cuts = np.flatnonzero(np.diff(self.time) > BETWEEN) + 1
        edges = [0, *map(int, cuts), len(self.time)]
        return [slice(a, b) for a, b in pairwise(edges)]

    def energy(self, begin: float, end: float) -> float:
        """Slip energy between two times, J."""
        run = self.compared.run
        rows = (run.time >= begin) & (run.time <= end)
        return float(np.trapezoid(run.quantity("power")[0][rows], run.time[rows]))

    def decay(self, noise: float) -> tuple[float, float, float]:
        """Two time constants (s) of the last rest, and by how much the second lowers χ²."""
        rows = self.rests()[-1]
        t, x = self.time[rows] - self.time[rows][0], self.measured[rows]
        one, _ = curve_fit(_one, t, x, (x[-1], x[0] - x[-1], 800.0))
        start, limits = (x[-1], (x[0] - x[-1]) / 2, 1500.0, (x[0] - x[-1]) / 2, 300.0), 1e5
        two, _ = curve_fit(
            _two, t, x, start, bounds=([30, -5, 10, -5, 10], [50, 5, limits, 5, limits])
        )
        gained = rms(x - _one(t, *one)) ** 2 - rms(x - _two(t, *two)) ** 2
        fast, slow = sorted((float(two[2]), float(two[4])))
        return fast, slow, float(gained * len(t) / noise**2)


def _one(t: Floats, end: float, size: float, tau: float) -> Floats:
    return np.asarray(end + size * np.exp(-t / tau))


def _two(t: Floats, end: float, size: float, tau: float, more: float, fast: float) -> Floats:
    return _one(t, end, size, tau) + more * np.exp(-t / fast)


def zero_position(setup: Setup) -> Verdict:
    """D4, on data without imperfections: it is the parameter set that is judged."""
    setup = replace(setup, imperfections=NONE)
    heated, cooled = ZeroPosition.of(setup, "heating"), ZeroPosition.of(setup, "cooldown")
    before, after, *_ = heated.rests()
    rise = float(heated.measured[after][:10].mean() - heated.measured[before].mean())
    energy = heated.energy(heated.time[before][-1], heated.time[after][0])
    left = rms(heated.measured - heated.modelled)
    low, high = heated.measured.min(), heated.measured.max()
    fast, slow, gained = cooled.decay(setup.vehicle.signals["slave_position"].noise)
    return Verdict(
        f"{rise:.2f} mm for {energy / 1e6:.2f} MJ; {low:.2f}–{high:.2f} mm; the model is "
        f"{1e3 * left:.0f} µm off; it decays with {fast:.0f} and {slow:.0f} s, the second of them "
        f"worth {gained:.0f} of χ²",
        0.27 <= rise * 1.5e6 / energy <= 0.33
        and low > 38.3
        and high < 39.3
        and left < ALIKE
        and gained > CERTAIN,
        {
            "rise_mm": rise,
            "energy_J": energy,
            "lowest_mm": low,
            "highest_mm": high,
            "model_off_mm": left,
            "fast_s": fast,
            "slow_s": slow,
            "second_worth": gained,
        },
        heated,
    )


CLAIMS = (
    Claim(
        "D4",
        "zero position while heated and left closed",
        "Fig. 5",
        "+0.3 mm for the first 1.5 MJ (accepted 0.27–0.33), 38.4–39.2 mm in 2500 s, two "
        "exponentials",
        zero_position,
        {
            "no expansion of the body": lambda s: s.both(expansion_body=0.0),
            "no housing": lambda s: s.both(conductance_body_housing=0.0),
        },
    ),
)
