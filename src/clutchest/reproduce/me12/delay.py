"""§ VI: the modelled torque drops before the measured one, and what discovery makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import Setup
from clutchest.reproduce.me12.model import Compared
from clutchest.signals import Floats

LENGTH = 120.0  # s: two groups of pulses
FINE = 100.0  # Hz
OPENS, FALL = 0.3, 120.0  # s in which the clutch is opened, Nm of the level crossed
RIGHT = 0.01  # s beyond the stated uncertainty
CAUSE = "torque_delay"


@dataclass(frozen=True, slots=True)
class Ends:
    """By how much the measured torque falls later than the modelled one at each end of a pulse,
    s (e,)."""

    compared: Compared
    later: Floats

    @classmethod
    def of(cls, setup: Setup) -> Ends:
        """Drive the pulses and run the model along."""
        compared = Compared.of(setup.drive("pulses", 1, LENGTH), setup, rate=FINE)
        time = compared.run.time
        falls = _falls(time, compared.run.torque)
        measured = _falls(time, compared.measured)
        later = []
        for fall in falls:
            near = measured[np.abs(measured - fall) < OPENS]
            if len(near):
                later.append(float(near[np.argmin(np.abs(near - fall))] - fall))
        return cls(compared, np.array(later))


def _falls(time: Floats, torque: Floats) -> Floats:
    """Times at which a torque falls through ``FALL``."""
    at = np.flatnonzero((torque[:-1] >= FALL) & (torque[1:] < FALL))
    share = (torque[at] - FALL) / (torque[at] - torque[at + 1])
    return np.asarray(time[at] + share * (time[at + 1] - time[at]))


def judged(setup: Setup) -> Verdict:
    """D9: the measured torque drops later, and discovery names the delay of the right size."""
    from clutchest.discovery.discover import discover

    ends = Ends.of(setup)
    later = float(np.median(ends.later))
    answer = discover(setup.drive("pulses", 1, LENGTH), setup.vehicle)
    causes = {cause.effect: cause for cause in answer.causes}
    true = setup.imperfections.torque_delay
    words = f"measured drops {1e3 * later:.0f} ms after modelled; discover: {answer.sentence}"
    if answer.verdict != "named" or CAUSE not in causes:
        return Verdict(words, False, {"later_s": later}, ends)
    delay = causes[CAUSE].parameters["delay"]
    return Verdict(
        words,
        later > 0.0 and abs(delay.value - true) < 2.0 * delay.std + RIGHT,
        {"later_s": later, "delay_s": delay.value, "delay_std_s": delay.std, "true_s": true},
        ends,
    )


CLAIMS = (
    Claim(
        "D9",
        "end of torque pulses, clutch opened in 0.3 s",
        "§ VI",
        "modelled torque drops faster than measured, for a delay of the reported torque",
        judged,
        {"no delay": lambda s: s.wrong(torque_delay=0.0)},
        ("torque_delay", "torque_error", "parameter_error"),
    ),
)
