"""Steps of the requested current: delay, overshoot, settling, release (Figs. 11 and 12)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.id08.rig import Columns, Rig
from clutchest.signals import Floats

ON = 0.5  # s
# request, A → (release s, end s, ends of the torque axis Nm), as the plots of Fig. 11 have them
PLOTS: Mapping[float, tuple[float, float, float, float]] = {
    12.0: (1.4, 2.1, -500.0, 3000.0),
    7.0: (1.4, 2.1, -500.0, 2500.0),
    2.5: (1.6, 2.6, -200.0, 1200.0),
}
SLOW_OFF, SLOW_END = 2.4, 3.6  # s, Fig. 12
ONSET = 20.0  # Nm: torque that counts as some
HOME = 2.0  # rad
FAST, SLOW = 25.0, 0.5  # rpm


@dataclass(frozen=True, slots=True)
class Response:
    """One engagement and its release."""

    amps: float
    columns: Columns
    off: float

    @classmethod
    def of(cls, rig: Rig, amps: float, rpm: float = FAST) -> Response:
        """As plotted in Fig. 11, or in Fig. 12 where the clutch turns slowly."""
        off, end = (SLOW_OFF, SLOW_END) if rpm == SLOW else PLOTS[amps][:2]
        return cls(amps, rig.step(amps, rpm, ON, off, end), off)

    @property
    def torque(self) -> Floats:
        """Clutch torque, Nm."""
        return self.columns["clutch_torque"]

    @property
    def engaged(self) -> Floats:
        """Clutch torque from request to release, Nm."""
        time = self.columns["time"]
        return self.torque[(time >= ON) & (time < self.off)]

    @property
    def settled(self) -> float:
        """Torque at the end of the engagement, Nm."""
        return float(self.engaged[-20:].mean())

    @property
    def delay(self) -> float:
        """From the request to any torque, s; infinite where there is none."""
        risen = self.engaged > ONSET
        return float(np.argmax(risen)) * 1e-3 if risen.any() else np.inf

    def on_the_way(self) -> float:
        """Mean current from 20 ms after the request to the first torque, A."""
        start, end = round((ON + 0.02) * 1e3), round((ON + self.delay) * 1e3)
        return float(self.columns["current"][start : max(end, start + 1)].mean())

    def rise(self) -> float:
        """Time from 10 to 90 % of the settled torque, s."""
        share = self.engaged / max(self.settled, 1e-9)
        return float(np.argmax(share > 0.9) - np.argmax(share > 0.1)) * 1e-3

    def swings(self) -> tuple[float, float]:
        """Overshoot over the settled torque, and the next swing below it, relative."""
        share = self.engaged / max(self.settled, 1e-9) - 1.0
        top = int(np.argmax(share))
        return float(share[top]), float(max(-share[top:].min(), 0.0))


def _responses(rig: Rig) -> dict[float, Response]:
    return {amps: Response.of(rig, amps) for amps in PLOTS}


def a1(rig: Rig) -> Verdict:
    """Torques within the plots' axes, the largest near 2500 Nm; released, all goes home."""
    responses = _responses(rig)
    words, good = [], True
    for amps, response in responses.items():
        _, _, low, high = PLOTS[amps]
        torque, angle = response.torque, response.columns["motor_angle"]
        home = abs(angle[-1]) < HOME and abs(torque[-1]) < ONSET
        good &= low < torque.min() and 0.25 * high < torque.max() < high and home
        words.append(
            f"{amps:g} A: peak {torque.max():.0f}, settled {response.settled:.0f} Nm, "
            f"motor back at {angle[-1]:.2f} rad"
        )
    good &= 2000.0 < responses[12.0].settled < 2600.0
    numbers = {f"settled_{amps:g}A_Nm": r.settled for amps, r in responses.items()}
    return Verdict("; ".join(words), bool(good), numbers, responses)


def a2(rig: Rig) -> Verdict:
    """A pure delay; shorter for larger requests, but the current falls short of the largest."""
    responses = _responses(rig)
    delays = {amps: response.delay for amps, response in responses.items()}
    reached = {amps: r.on_the_way() / amps for amps, r in responses.items()}
    falling = delays[12.0] < delays[7.0] < delays[2.5]
    pure = delays[12.0] > 0.03
    saved = (delays[2.5] / delays[12.0]) / (12.0 / 2.5)  # 1 if in proportion
    limited = reached[12.0] < 0.85 and reached[2.5] > 0.95
    words = ", ".join(f"{1e3 * d:.0f} ms at {amps:g} A" for amps, d in delays.items())
    numbers = {f"delay_{amps:g}A_s": d for amps, d in delays.items()} | {"share": saved}
    return Verdict(
        f"{words}; {100 * saved:.0f} % of what proportion would save; on the way "
        f"{100 * reached[12.0]:.0f} % of 12 A, {100 * reached[2.5]:.0f} % of 2.5 A flow",
        bool(pure and falling and limited and saved < 0.7),
        numbers,
    )


def a3(rig: Rig) -> Verdict:
    """A relatively large overshoot, then well-damped settling."""
    over, under = Response.of(rig, 12.0).swings()
    return Verdict(
        f"12 A: overshoot {100 * over:.0f} %, then {100 * under:.1f} % below",
        over > 0.15 and under < 0.5 * over,
        {"overshoot": over, "undershoot": under},
    )


def a4(rig: Rig) -> Verdict:
    """At 0.5 rpm the torque takes about a second, the actuator what it takes at 25 rpm."""
    slow, fast = Response.of(rig, 12.0, SLOW), Response.of(rig, 12.0)
    end = min(len(slow.engaged), len(fast.engaged))
    start = round(ON * 1e3)
    angles = [r.columns["motor_angle"][start : start + end] for r in (slow, fast)]
    apart = float(np.abs(angles[0] - angles[1]).max() / angles[1].max())
    rises = slow.rise(), fast.rise()
    return Verdict(
        f"rise (10 to 90 %) {rises[0]:.2f} s instead of {rises[1]:.3f} s; "
        f"motor angles {100 * apart:.2f} % apart",
        0.5 < rises[0] < 1.5 and rises[1] < 0.1 and apart < 0.01,
        {"rise_slow_s": rises[0], "rise_fast_s": rises[1], "apart": apart},
        slow,
    )


no_free_play = partial(Rig.lacking, free_play=0.0, gear_backlash=0.0)
no_ball_ramp_friction = partial(Rig.lacking, ball_ramp_friction=0.0)
no_compliance = partial(Rig.lacking, torsional_stiffness=4e6)
no_reset_spring = partial(Rig.lacking, spring_young=1.0)
no_limit = partial(Rig.lacking, supply_voltage=1000.0, back_emf_constant=1e-6)

CLAIMS = (
    Claim(
        "A1",
        "current steps of 12, 7 and 2.5 A at 25 rpm, engaged and released",
        "Fig. 11",
        "torque within −500…3000, −500…2500, −200…1200 Nm; at most about 2500 Nm held; on release "
        "the spring opens the clutch and brings the motor home",
        a1,
        {"no reset spring": no_reset_spring},
    ),
    Claim(
        "A2",
        "the same steps",
        "Fig. 11",
        "a pure delay before any torque, shorter for larger requests, not in proportion: 12 V and "
        "back-EMF limit the current",
        a2,
        {"no free play": no_free_play, "no voltage limit": no_limit},
    ),
    Claim(
        "A3",
        "the same steps",
        "Fig. 11",
        "a relatively large overshoot, then well-damped settling by ball-ramp friction",
        a3,
        {"no ball-ramp friction": no_ball_ramp_friction},
    ),
    Claim(
        "A4",
        "12 A at 0.5 rpm",
        "Fig. 12",
        "torque significantly slower, about a second; the actuator's transient is the same",
        a4,
        {"no compliance": no_compliance},
    ),
)
