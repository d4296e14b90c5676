"""Discoveries made up: what the words, files and recordings of one are tested with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.discovery.goodness_of_fit import DistortionTest, GoodnessOfFit
from clutchest.discovery.residuals import Bins, Level, Misfit
from clutchest.discovery.result import Cause, Discovery, Experiment, Gain, Identifiable, Rival, Size
from clutchest.discovery.where import Where
from clutchest.models.error_curve import ErrorCurve
from clutchest.signals import Counts
from clutchest.vehicle import Vehicle, load_vehicle

VERDICTS = ("none", "named", "ambiguous", "unknown")

GAIN = Gain(1.42, 1.01, 900.0, 765.8, 48.3, 21.4, (98.1, 170.3))
NO_GAIN = Gain(1.011, 1.010, 900.0, 899.4, 21.6, 21.5, (-1.2, 2.3))

FADE = Cause(
    "friction_fade",
    "torque",
    {"slope": Size(0.1234, 0.0113), "onset": Size(160.0, 0.0)},
    81.3,
    3e-15,
)
WEAR = Cause("wear", "zero_position", {"amount": Size(0.41, 0.06)}, 44.0, 2e-9)
OFFSET = Cause("position_offset", "sensor:slave_position", {"offset": Size(-0.4, 0.06)}, 43.8, 2e-9)

LINE = "noise in engine_speed while slipping has a line at 9 Hz (amplitude 0.1 rad/s)"
FITS = GoodnessOfFit(
    0.43,
    {"engine_speed": 0.2},
    {"slipping": 0.2},
    (DistortionTest("engine_speed", "slipping", "spectrum", 0.05, LINE),),
)
NO_FIT = GoodnessOfFit(
    2e-7,
    {"engine_speed": 1e-7},
    {"slipping": 1e-7},
    (
        DistortionTest("engine_speed", "slipping", "spectrum", 1e-8, LINE),
        DistortionTest("engine_speed", "slipping", "sign", 0.3, "residuals are positive"),
    ),
)

CURVE = ErrorCurve("torque", "slip_speed", (0.0, 100.0, 200.0), (0.1, 0.2, 0.4))


def misfit(drives: int = 1) -> Misfit:
    """Two slips a drive; the second, in the last drive, is missed most.  One spike."""
    rng = np.random.default_rng(5)
    torque, time, sensor, before, after = [], [], [], [], []
    for drive in range(drives):
        t = np.concatenate([np.arange(10.0, 12.0, 0.02), np.arange(40.0, 43.0, 0.02)])
        true = 400.0 + 100.0 * np.sin(t)
        miss = np.where(t > 30.0, 60.0 + 10.0 * drive, 10.0)
        torque.append((t, true + rng.normal(0, 5, len(t)), true + miss, true + 1.0))
        when = np.arange(0.0, 60.0, 0.1)
        which = (np.arange(len(when)) % 5 == 0).astype(np.int8)
        left = rng.normal(size=len(when))
        time.append(when)
        sensor.append(which)
        before.append(left + np.where(when == when[100], 40.0, 0.3))
        after.append(left)
    edges = np.linspace(80.0, 240.0, 6)
    bins = (
        Bins(
            "engine_speed",
            "slipping",
            "temp_disc",
            edges,
            np.array([0, 0.1, 0.4, 0.9, np.nan]),
            np.array([0.1, 0.1, 0.1, 0.2, np.nan]),
            np.array([50, 40, 30, 9, 0]),
            np.array([0, 0.0, 0.1, -0.1, np.nan]),
            np.array([0.1, 0.1, 0.1, 0.2, np.nan]),
        ),
        Bins(
            "zero_position",
            "retracted",
            "temp_disc",
            edges,
            np.full(5, 0.1),
            np.full(5, 0.1),
            np.full(5, 20),
            np.full(5, 0.05),
            np.full(5, 0.1),
        ),
        Bins(
            "engine_speed",
            "slipping",
            "slip_speed",
            edges,
            np.full(5, 5.0),
            np.full(5, 0.1),
            np.full(5, 20),
            np.full(5, 0.05),
            np.full(5, 0.1),
        ),
    )
    return Misfit(
        ("engine_speed", "zero_position"),
        tuple(time),
        tuple(sensor),
        tuple(before),
        tuple(after),
        tuple(torque),
        bins,
        (Level("engine_speed", "slipping", 2.104, 0.31, 480),),
    )


def discovery(verdict: str, gain: Gain | None = GAIN, drives: int = 1) -> Discovery:
    """What a search could say, by its verdict."""
    truck = load_vehicle("truck")
    causes = {"named": (FADE,), "ambiguous": (WEAR, OFFSET)}.get(verdict, ())
    where = {
        "none": None,
        "named": Where("torque", ("temp_disc", "slip_speed")),
        "ambiguous": Where("zero_position", ("energy",)),
        "unknown": Where("timing:engine_torque", ("position_rate",)),
    }[verdict]
    effects = {c.effect: {k: f.value for k, f in c.parameters.items()} for c in causes[:1]}
    extended: Vehicle = replace(truck, effects=effects)
    if verdict == "unknown":
        extended = replace(truck, curves={"curve_1": CURVE})
    lost = (
        Rival("friction_level", 7.0, {"change": -0.1}),
        Rival("centrifugal", 61.0, {"slope": 0.03}),
    )
    steps = Experiment("Slip in steps at one position.", "slip-steps")
    return Discovery(
        vehicle=truck,
        verdict=verdict,
        sentence=f"In one sentence: {verdict}.",
        causes=causes,
        sets=tuple((cause.effect,) for cause in causes),
        rivals=() if verdict == "none" else lost,
        where=where,
        identifiability=(
            Identifiable("friction_fade", "1/(100 K)", 0.05, 0.4, "friction_temperature", 7.25),
            Identifiable("housing_airflow", "s/(20 m)", 9.0, 3.0, None, None),
            Identifiable("viscous_drag", "Nm s/(100 rad)", None, 60.0, None, None),
        ),
        gain=gain,
        experiment=steps if verdict == "ambiguous" else None,
        misfit=misfit(drives),
        fit=FITS if verdict == "none" else NO_FIT,
        fit_extended=FITS if causes else None,
        extended=extended,
        curve="curve_1" if verdict == "unknown" else None,
        counts=Counts(2000, 1800, {"not mapped": 180, "checksum": 20}),
        warnings=("parameter 'kiss_point' is a guess",),
        provenance={"clutchest": "0.1.0", "logs": "monday.log, tuesday.log", "held_out": ""},
    )
