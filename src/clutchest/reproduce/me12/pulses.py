"""Figs. 9 and 10: torque pulses, open loop from 0 s on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import medfilt

from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import Setup
from clutchest.reproduce.me12.model import NO_DISC, STATIC, Compared, rms
from clutchest.signals import Floats

SEEDS = (1, 2, 3)  # drives, all of which must show what the paper shows
SHOWN = (950.0, 1350.0)  # s, the paper's axis
LENGTH = 1360.0  # s
MEDIAN = 5  # samples of the paper's filter
LARGEST, MOSTLY, MOST = 200.0, 100.0, 0.9  # Nm, Nm, share that counts as most of the time
BETTER = 0.5  # of the static model's error: significantly better
RAISED, GROUP = 200.0, 12.0  # Nm that make a pulse; s between pulses of one group
PULSES = 6  # of a group
DECAYS = 0.005  # of the torque from one pulse to the next: significantly more is a decay
STEADY = 0.5  # of the other's decay: less is none


@dataclass(frozen=True, slots=True)
class Pulses:
    """One drive along which the model ran in three ways.

    ``own``: P as the setup has it; ``modelled``: P modelled; ``static`` torque Nm.
    """

    own: Compared
    modelled: Compared
    static: Floats

    @classmethod
    def of(cls, setup: Setup, seed: int) -> Pulses:
        """Drive it and run the models along."""
        drive = setup.drive("pulses", seed, LENGTH)
        own = Compared.of(drive, setup)
        modelled = Compared.of(drive, setup, power_measured=False) if setup.power_measured else own
        return cls(own, modelled, own.reference(**STATIC)[1])

    @property
    def shown(self) -> NDArray[np.bool_]:
        """Where the clutch slips on the paper's time axis (m,)."""
        time = self.own.run.time
        return self.own.slipping & (time > SHOWN[0]) & (time < SHOWN[1])

    def residual(self, torque: Floats) -> Floats:
        """Modelled less measured torque on that axis, filtered as in the paper."""
        return np.asarray(medfilt(torque - self.own.measured, MEDIAN))[self.shown]

    def decay(self, compared: Compared) -> tuple[float, float]:
        """Relative change of modelled over measured torque from one pulse of a group to the next,
        and its standard deviation, over all groups."""
        ratio, place = [], []
        for group in self._groups():
            for k, rows in enumerate(group):
                level = compared.run.torque[rows].mean() / compared.measured[rows].mean()
                ratio.append(level)
                place.append(float(k))
        y, x = np.array(ratio), np.array(place) - np.mean(place)
        each = x @ y / (x @ x)
        left = y - y.mean() - each * x
        return float(each), float(np.sqrt(left @ left / (len(y) - 2) / (x @ x)))

    def _groups(self) -> Sequence[Sequence[NDArray[np.intp]]]:
        """Rows of every pulse of every whole group."""
        time, up = self.own.run.time, self.own.slipping & (self.own.measured > RAISED)
        rows = np.flatnonzero(up)
        pulses = np.split(rows, np.flatnonzero(np.diff(time[rows]) > 1.0) + 1)
        pulses = [pulse for pulse in pulses if len(pulse) > 20]
        starts = np.array([time[pulse[0]] for pulse in pulses])
        cuts = np.flatnonzero(np.diff(starts) > GROUP) + 1
        edges = [0, *map(int, cuts), len(pulses)]
        groups = [pulses[a:b] for a, b in pairwise(edges)]
        return [group for group in groups if len(group) == PULSES]


def validation(setup: Setup) -> Verdict:
    """D7, in every one of ``SEEDS``."""
    drives = [Pulses.of(setup, seed) for seed in SEEDS]
    passed, worst = True, dict[str, float]()
    torque_max = setup.vehicle.parameters["engine_torque_max"].value
    for drive in drives:
        own, static = drive.residual(drive.own.run.torque), drive.residual(drive.static)
        modelled = drive.residual(drive.modelled.run.torque)
        (fall, std), (steady, _) = (drive.decay(c) for c in (drive.modelled, drive.own))
        run = drive.own.run
        temps = np.array([run.state(f"temp_{n}")[drive.shown] for n in ("body", "housing", "disc")])
        largest, below = float(np.abs(own).max()), float(np.mean(np.abs(own) < MOSTLY))
        passed &= largest < LARGEST and below > MOST and rms(own) < 0.03 * torque_max
        passed &= fall + 2 * std < -DECAYS and steady > STEADY * fall
        passed &= max(rms(own), rms(modelled)) < BETTER * rms(static)
        passed &= temps.min() > 40.0 and temps.max() < 225.0
        for key, value in (
            ("largest_Nm", largest),
            ("above_100_share", 1 - below),
            ("rms_Nm", rms(own)),
            ("rms_modelled_Nm", rms(modelled)),
            ("decay_modelled", -fall),
            ("decay_own", -steady),
            ("temp_max", float(temps.max())),
        ):
            worst[key] = max(worst.get(key, -np.inf), value)
        worst["rms_static_Nm"] = min(worst.get("rms_static_Nm", np.inf), rms(static))
    return Verdict(
        f"largest {worst['largest_Nm']:.0f} Nm, {100 * worst['above_100_share']:.1f} % above "
        f"100 Nm, rms {worst['rms_Nm']:.0f} Nm ({100 * worst['rms_Nm'] / torque_max:.1f} %); "
        f"P modelled {worst['rms_modelled_Nm']:.0f} Nm, static {worst['rms_static_Nm']:.0f} Nm; "
        f"from pulse to pulse −{100 * worst['decay_modelled']:.1f} % with P modelled, "
        f"−{100 * worst['decay_own']:.1f} % otherwise; up to {worst['temp_max']:.0f} °C",
        bool(passed),
        worst,
        drives[0],
    )


STRAINED = ("torque_delay", "torque_error", "parameter_error", "hot_gain")
CLAIMS = (
    Claim(
        "D7",
        f"torque pulses, open loop from 0 s, t = 950–1350 s (worst of {len(SEEDS)} drives)",
        "Figs. 9, 10",
        "residuals below 200 Nm, mostly (accepted: 90 %) below 100 Nm, under 3 %; P modelled "
        "decays, P measured does not; both significantly better than static (accepted: half the "
        "error)",
        validation,
        {
            "P modelled": lambda s: replace(s, power_measured=False),
            "static curve": lambda s: s.modelled(**STATIC),
            "no disc term": lambda s: s.modelled(**NO_DISC),
        },
        STRAINED,
    ),
)
