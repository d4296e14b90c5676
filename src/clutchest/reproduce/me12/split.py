"""§ V-C: it does not matter how the heat is split between disc and body, if C_d and k_d2b are
fitted to the same data with it."""

from __future__ import annotations

from dataclasses import replace

from clutchest.identify.likelihood import along, most_probable, problem_of
from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import NONE, Setup, changed
from clutchest.reproduce.me12.model import rms
from clutchest.vehicle import Vehicle

SPLIT = 0.5  # k_P, the paper's other value
WIDE = 0.3  # relative spread of what is refitted
WORSE = 1.25  # times the error: no longer the same
HALVED = ("heat_capacity_disc", "conductance_disc_body")


def _fitted(setup: Setup, k_p: float) -> tuple[float, tuple[float, float]]:
    """Root mean square error of the torque along the ramps, Nm, and C_d, k_d2b."""
    vehicle = changed(setup.vehicle, heat_fraction_body=k_p)
    if setup.refitted:
        begin = {key: (1 - k_p) * vehicle.parameters[key].value for key in HALVED}
        vehicle = _loose(changed(vehicle, **begin))
    problem = problem_of(setup.drive("ramps", 1), vehicle)
    if not setup.refitted:
        problem = problem.holding(*HALVED)
    posterior = most_probable(problem)
    _, (measured, modelled) = along(posterior, 0, ("measured_torque", "clutch_torque"))
    halves = [posterior.of(key) for key in HALVED]
    numbers = [
        vehicle.parameters[k].value if f is None else f[0]
        for k, f in zip(HALVED, halves, strict=True)
    ]
    return rms(modelled - measured), (numbers[0], numbers[1])


def _loose(vehicle: Vehicle) -> Vehicle:
    wide = {
        key: replace(vehicle.parameters[key], spread=WIDE * vehicle.parameters[key].value)
        for key in HALVED
    }
    return replace(vehicle, parameters={**vehicle.parameters, **wide})


def insensitive(setup: Setup) -> Verdict:
    """Both splits, on data without imperfections."""
    setup = replace(setup, imperfections=NONE)
    none, (capacity, conductance) = _fitted(setup, 0.0)
    half, (less, lower) = _fitted(setup, SPLIT)
    ratios = capacity / less, conductance / lower
    return Verdict(
        f"torque error {half:.1f} Nm with k_P = {SPLIT:g}, {none:.1f} Nm with 0; C_d and k_d2b are "
        f"{ratios[0]:.2f} and {ratios[1]:.2f} times as large with 0",
        half < WORSE * none and all(1.8 <= ratio <= 2.2 for ratio in ratios),
        {
            "error_half_Nm": half,
            "error_none_Nm": none,
            "capacity_ratio": ratios[0],
            "conductance_ratio": ratios[1],
        },
    )


CLAIMS = (
    Claim(
        "k_P",
        "share of the heat that enters the body, C_d and k_d2b fitted with it",
        "§ V-C",
        "not sensitive: C_d and k_d2b double from k_P = 0.5 to 0 (accepted: 1.8–2.2), torque as "
        "good",
        insensitive,
        {"C_d and k_d2b not refitted": lambda s: replace(s, refitted=False)},
    ),
)
