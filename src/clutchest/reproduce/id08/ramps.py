"""Slow ramps: hysteresis of the actuator, with and without the pack (Figs. 9, 10, 13), and the
reset spring (Fig. 5b)."""

from __future__ import annotations

from functools import partial

import numpy as np

from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.id08.rig import Columns, Rig
from clutchest.reproduce.id08.steps import no_ball_ramp_friction, no_free_play
from clutchest.signals import Floats

RATES = (1.0, 5.0, 10.0, 15.0, 20.0)  # A/s
MOST = 20.0  # A
DEGREES = 180.0 / np.pi


def branches(o: Columns, key: str) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """(``key``, angle in °) on the way up and on the way down, angle as it goes on, sorted."""
    angle = o["motor_angle"] * DEGREES
    turn = int(np.argmax(angle))
    branches = []
    for rows in (slice(0, turn + 1), slice(turn, None)):
        order = np.argsort(angle[rows], kind="stable")
        branches.append((o[key][rows][order], angle[rows][order]))
    return branches[0], branches[1]


def width(o: Columns, key: str, at: float) -> tuple[float, float]:
    """(up, down): ``key`` on both branches at the angle ``at``, °."""
    up, down = branches(o, key)
    return float(np.interp(at, up[1], up[0])), float(np.interp(at, down[1], down[0]))


def a5(rig: Rig) -> Verdict:
    """Loops of current over angle at every rate, that reach 20 A within 1600°."""
    runs = {rate: rig.ramp(rate) for rate in RATES}
    words, good = [], True
    numbers: dict[str, float] = {}
    for rate, o in runs.items():
        reach = float(o["motor_angle"].max() * DEGREES)
        up, down = width(o, "request", 0.85 * reach)
        good &= 1200.0 < reach < 1600.0 and up - down > 2.0
        words.append(f"{rate:g} A/s: {reach:.0f}°, {up - down:.1f} A wide")
        numbers |= {f"reach_{rate:g}_deg": reach, f"width_{rate:g}_A": up - down}
    return Verdict("; ".join(words), bool(good), numbers, runs)


def a6(rig: Rig) -> Verdict:
    """Free-play section, then compression with a loop that widens."""
    o = rig.ramp(5.0)
    up, _ = branches(o, "motor_torque")
    reach, most = float(up[1].max()), float(up[0].max())
    begins = float(np.interp(0.15, np.maximum.accumulate(up[0]), up[1]))
    steep = (most - 0.15) / (reach - begins)
    angles = np.linspace(0.5 * begins, reach, 40)
    loop = [float(np.subtract(*width(o, "motor_torque", at))) for at in angles]
    narrow, wide = loop[0], max(loop)
    return Verdict(
        f"free play up to {begins:.0f}°, then {1e3 * steep:.2f} mNm/°, {most:.2f} Nm at "
        f"{reach:.0f}°; loop {narrow:.3f} Nm wide in the free play, up to {wide:.3f} Nm beyond",
        begins > 300.0 and 0.7 < most < 0.82 and reach < 1600.0 and 0.0 < 2.0 * narrow < wide,
        {"free_play_deg": begins, "most_Nm": most, "narrow_Nm": narrow, "wide_Nm": wide},
        o,
    )


def a7(rig: Rig) -> Verdict:
    """Without the pack: a loop within 0.08 Nm, shifted up by the pre-tensioned spring."""
    o = rig.bare_ramp()
    inside = [width(o, "motor_torque", at) for at in np.linspace(300.0, 1600.0, 14)]
    lowest, highest = min(down for _, down in inside), max(up for up, _ in inside)
    middle = float(np.mean(inside[0]))
    return Verdict(
        f"loop between {lowest:.4f} and {highest:.4f} Nm, its middle at {middle:.4f} Nm at 300°",
        lowest > 0.0 and highest < 0.08 and highest - lowest > 0.02 and middle > 0.02,
        {"lowest_Nm": lowest, "highest_Nm": highest, "middle_Nm": middle},
        o,
    )


def a8(rig: Rig) -> Verdict:
    """The reset spring (10): nonlinear, within 3 mm and 2500 N."""
    import casadi as ca

    from clutchest.models.alsd.belleville import force
    from clutchest.models.model import Quantities

    q = Quantities({})
    for key, value in rig.parameters.items():
        setattr(q, key, value)
    s = ca.SX.sym("s")
    displacement = np.linspace(0.0, 3e-3, 121)
    spring = np.array(ca.Function("F", [s], [force(q, s)])(displacement[None])).ravel()
    slope = np.diff(spring) / np.diff(displacement)
    top = int(np.argmax(spring))
    return Verdict(
        f"{spring[top]:.0f} N at {1e3 * displacement[top]:.2f} mm, {spring[-1]:.0f} N at 3 mm; "
        f"slope from {slope[0] / 1e6:.2f} down to {slope.min() / 1e6:.2f} N/µm",
        1000.0 < spring.max() < 2500.0 and slope.min() < 0.2 * slope[0] and spring.min() >= 0.0,
        {"top_N": float(spring[top]), "top_m": float(displacement[top])},
        (displacement, spring, rig.parameters["spring_preload"]),
    )


CLAIMS = (
    Claim(
        "A5",
        "current ramps of 1 to 20 A/s, up and down",
        "Fig. 13",
        "hysteresis loops within 20 A and 1600°",
        a5,
        {"no ball-ramp friction": no_ball_ramp_friction},
    ),
    Claim(
        "A6",
        "a current ramp with the pack",
        "Fig. 10",
        "free-play section, then compression with a loop that widens; within 0.8 Nm and 1600°",
        a6,
        {"no free play": no_free_play, "no ball-ramp friction": no_ball_ramp_friction},
    ),
    Claim(
        "A7",
        "pack removed, motor angle ramped",
        "Fig. 9",
        "a loop shifted up by the pre-tensioned spring; within 0.08 Nm and 2000°",
        a7,
        {
            "no pre-tension": partial(Rig.lacking, spring_preload=0.0),
            "no friction": partial(
                Rig.lacking,
                ball_ramp_friction=0.0,
                motor_coulomb_torque=1e-5,
                motor_static_torque=1e-5,
                motor_viscous=0.0,
            ),
        },
    ),
    Claim(
        "A8",
        "the reset spring",
        "Fig. 5b",
        "nonlinear; within 3 mm and 2500 N",
        a8,
        {"no cone": partial(Rig.lacking, spring_cone_height=0.0)},
    ),
)
