"""One run of the differential, from numbers and a seed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.generator.alsd.effects import EFFECTS, RANGES, numbers
from clutchest.generator.alsd.outsider import run_under
from clutchest.generator.alsd.plant import FAST, STEP, WHEELS
from clutchest.generator.alsd.scenarios import (
    ON_THE_ROAD,
    SCENARIOS,
    ActuatorScenario,
    scenarios_with,
)
from clutchest.generator.effects import Values, complete
from clutchest.generator.mismatch import Mismatch
from clutchest.generator.outsider import Law, Reading
from clutchest.generator.request import DriveRequest
from clutchest.generator.sampling import Sampled, sample
from clutchest.generator.surroundings import Disturbances, stream
from clutchest.signals import Floats, Truth

EVERY = 250  # steps per row of the truth: 200 Hz

BENCHES = ("rig", "no-pack", "output-fixed", "motor-alone", "rotor-held")  # by the plant's numbers

# Largest magnitude per name of an effect's parameter: beyond it a run is nonsense.
LARGEST: Values = {
    "change": 4.0,
    "slope": 5.0,
    "onset": 1000.0,
    "resistance": 5.0,
    "growth": 0.05,
    "rate": 1.0,
    "offset": 30.0,
    "speed": 100.0,
    "coefficient": 1e4,
}


def generate(request: DriveRequest) -> Sampled:
    """A run of a differential.

    ``deviations`` as ``effects.DEVIATIONS`` has them; disturbances and mismatches are the truck's
    alone.  Raises ClutchestError for an unknown scenario, effect, channel
    or missing parameter.
    """
    plan, duration = request.plan(_scenarios_of(request), RANGES)
    if request.mismatch != Mismatch() or request.disturbances != Disturbances():
        raise ClutchestError("disturbances and mismatches are the truck's, not the differential's")
    parameters, seed = request.parameters, request.seed
    active, without = (complete(e, EFFECTS, LARGEST) for e in (request.effects, {}))
    drawn = draw(parameters, {} if request.nominal else request.spreads, request.machine_seed)
    before, record = (
        numbers(drawn, effects, parameters["friction_coefficient"], request.deviations)
        for effects in (without, active)
    )
    profile = plan.profile(stream(seed, "course"), duration)
    row = round(request.onset / (plan.fast * STEP))
    law = request.outsider.law() if request.outsider else None
    columns = run(profile, record, plan.fast, before, row, law)
    if not all(np.isfinite(column).all() for column in columns.values()):
        raise ClutchestError(
            f"scenario '{request.scenario}', seed {seed}: these parameters and effects "
            "let the simulation diverge"
        )
    quantities = _quantities(columns, profile, active, request.onset)
    if request.outsider:
        quantities = request.outsider.readings(quantities)
    sampled = sample(request.channels, quantities, seed, duration, request.outliers)
    truth = _truth(columns, EVERY // plan.fast)
    benches = _benches(columns["time"], profile)
    return Sampled(sampled, truth, drawn, seed, request.scenario, benches)


def _scenarios_of(request: DriveRequest) -> Mapping[str, ActuatorScenario]:
    """Those of the place, car or rig, that the channels are from.

    Raises ClutchestError where a scenario of the other place is asked for.
    """
    scenario, channels = request.scenario, request.channels
    if not channels:
        return SCENARIOS
    possible = scenarios_with([channel.name for channel in channels])
    if scenario in SCENARIOS and scenario not in possible:
        where, has = ("a car", "maps no") if scenario in ON_THE_ROAD else ("the rig", "maps a")
        raise ClutchestError(
            f"scenario '{scenario}' is for {where}: this vehicle {has} wheel_speed_left"
        )
    return possible


def draw(parameters: Values, spreads: Values, seed: int) -> dict[str, float]:
    """The differential's own parameters: normal, clipped to what nature allows."""
    rng = stream(seed, "parameters")
    drawn = {}
    for key, (low, high) in RANGES.items():
        value = parameters[key] + spreads.get(key, 0.0) * rng.standard_normal()
        drawn[key] = float(np.clip(value, low, high))
    sliding = drawn["motor_coulomb_torque"]  # what sticks holds at least as much
    return drawn | {"motor_static_torque": max(drawn["motor_static_torque"], sliding)}


def run(
    profile: NDArray,
    record: NDArray,
    fast: int = FAST,
    before: NDArray | None = None,
    onset: int = 0,
    law: Law | None = None,
) -> dict[str, Floats]:
    """Columns of the record along ``profile``, rows ``fast`` steps apart, from rest; with the
    numbers ``before`` up to row ``onset``, and from there under the ``law`` of an unmodelled
    effect."""
    from clutchest.generator.alsd import plant

    first = record[0] if before is None or not onset else before[0]
    state = np.zeros(1, plant.STATE)
    y = state[0]
    y["temp_pack"] = y["temp_armature"] = profile["oil"][0]
    y["free_play"] = first["free_play"]
    if profile["drive"][0] == plant.SLIP:
        y["drive_speed"] = profile["driven"][0] * first["final_drive_ratio"]
    out = np.zeros((len(profile), len(plant.RECORD)))
    if onset:
        plant.run(profile[: onset + 1], fast, y, first, out[: onset + 1])
        at_onset = out[onset].copy()
        y["free_play"] += record[0]["free_play"] - first["free_play"]
    if law is None:
        plant.run(profile[onset:], fast, y, record[0], out[onset:])
    else:
        run_under(law, profile, fast, onset, y, record[0], out)
    if onset:
        out[onset] = at_onset
    return {
        "time": np.arange(len(profile), dtype=np.float64) * (fast * STEP),
        **dict(zip(plant.RECORD, out.T, strict=True)),
    }


def _benches(time: Floats, profile: NDArray) -> tuple[tuple[float, float, str], ...]:
    """(start s, end s, bench) of every part of the run."""
    cuts = np.flatnonzero(np.diff(profile["bench"])) + 1
    rows = np.concatenate([[0], cuts, [len(time) - 1]])
    on_the_road = profile["drive"][0] == WHEELS
    names = ["car" if on_the_road else BENCHES[int(profile["bench"][row])] for row in rows[:-1]]
    return tuple(zip(time[rows[:-1]].tolist(), time[rows[1:]].tolist(), names, strict=True))


def _truth(columns: Mapping[str, Floats], every: int) -> Truth:
    """One row of the truth for ``every`` rows of the record."""
    from clutchest.generator.alsd.plant import MODES

    names = (
        "current",
        "motor_speed",
        "motor_angle",
        "pack_force",
        "wind_up",
        "free_play",
        "friction",
        "temp_pack",
        "temp_armature",
        "clutch_torque",
        "slip_speed",
    )
    rows = slice(None, None, every)
    kept = {name: np.ascontiguousarray(columns[name][rows]) for name in names}
    kept["mode"] = np.array(MODES)[columns["mode"][rows].astype(int)]
    kept["slip_energy"] = np.ascontiguousarray(columns["energy"][rows])
    return Truth(columns["time"][rows], kept)


def _quantities(
    columns: Mapping[str, Floats], profile: NDArray, effects: Mapping[str, Values], onset: float
) -> Mapping[str, Reading]:
    """What each sensor reads, without noise, as a function of time; effects from ``onset`` s on."""

    def column(value: Floats, change: float = 0.0, offset: float = 0.0) -> Reading:
        def read(t: Floats) -> Floats:
            true = np.interp(t, columns["time"], value)
            return true + (t >= onset) * (offset + change * true)

        return read

    torque, mean = columns["clutch_torque"], profile["mean_wheel"]
    return {
        "armature_voltage": column(columns["voltage"]),
        "armature_current": column(columns["current"], effects["current_gain"]["change"]),
        "motor_angle": column(columns["motor_angle"], 0.0, effects["angle_offset"]["offset"]),
        "slip_speed": column(columns["slip_speed"]),
        "oil_temp": column(columns["oil"]),
        "armature_temp": column(columns["temp_armature"]),
        "clutch_torque": column(torque, effects["torque_sensor_gain"]["change"]),
        "shaft_torque": column(torque, effects["torque_sensor_gain"]["change"]),
        "motor_torque": column(columns["motor_torque"]),
        "drive_torque": column(columns["servo_torque"]),
        "drive_angle": column(columns["drive_angle"]),
        "wheel_speed_left": column(mean + columns["slip_speed"]),
        "wheel_speed_right": column(mean - columns["slip_speed"]),
    }
