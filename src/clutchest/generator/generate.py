"""One drive, from numbers and a seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.generator.effects import RANGES, Values, complete, numbers
from clutchest.generator.outsider import SLICE, Reading, run_under
from clutchest.generator.population import NORMAL, Population
from clutchest.generator.request import DriveRequest
from clutchest.generator.sampling import Sampled, sample
from clutchest.generator.scenarios import PER_METRE, SCENARIOS, TruckScenario
from clutchest.generator.situation import FAST, STEP
from clutchest.generator.surroundings import (
    GEARBOX_TEMP,
    Surroundings,
    stream,
    surroundings,
)
from clutchest.signals import Floats, Truth

SPACING = STEP * FAST  # s between rows of the fast record
LONG = 1000.0  # s: from here on the truth is kept at 50 Hz instead of 100 Hz


@dataclass(frozen=True)
class Driven:
    """A drive before any bus has sampled it: what each sensor ``shows``, without noise, as a
    function of time in s up to ``duration``; parameters as drawn, before any effect; ``locked``
    every SPACING s from 0 on."""

    shows: Mapping[str, Reading]
    locked: NDArray[np.bool_]
    truth: Truth
    parameters: Mapping[str, float]
    duration: float


def generate(request: DriveRequest) -> Sampled:
    """A drive with a truck.

    ``zero_position_ref`` itself is never drawn: its spread is that of the truth's x0_ref.
    Raises ClutchestError for an unknown scenario, effect, channel or missing parameter.
    """
    driven = drive(request)
    channels = request.mismatch.sensing.channels(request.channels)
    signals = sample(channels, driven.shows, request.seed, driven.duration, request.outliers)
    return Sampled(signals, driven.truth, driven.parameters, request.seed, request.scenario)


def drive(request: DriveRequest) -> Driven:
    """The same drive as exact sensors follow it; its channels are not asked for."""
    asked, duration = request.plan(SCENARIOS, RANGES)
    request.from_the_start()
    mismatch = request.mismatch
    plan = mismatch.plan(asked)
    seed, parameters = request.seed, request.parameters
    active = complete(request.effects)
    for name in ("torque_delay", "position_delay"):
        if active[name]["delay"] >= duration:
            raise ClutchestError(
                f"effect '{name}': delay = {active[name]['delay']:g} s, "
                f"expected less than the drive's {duration:g} s"
            )
    spreads = {} if request.nominal else request.spreads
    drawn, zero_position = draw(parameters, spreads, request.machine_seed, mismatch.population)
    around = surroundings(
        seed,
        duration,
        mismatch.disturbed(request.disturbances),
        active["friction_level"]["change"],
        active["torque_bias"]["bias"],
        plan.cold,
    )
    road = stream(seed, "road")
    mass = road.uniform(*plan.mass)
    truck = numbers(drawn, parameters, active, zero_position, mass, mismatch.structure)
    legs = plan.timetable(road, duration, mass, parameters["kiss_point"])
    fast, truth = _simulate(plan, duration, legs, truck, around, request)
    quantities = _quantities(mismatch.sensing.lagging(fast, SPACING), around, drawn, active)
    if request.outsider:
        quantities = request.outsider.readings(quantities)
    return Driven(quantities, fast[:, 0] == fast[:, 1], truth, drawn, duration)


def draw(
    parameters: Values, spreads: Values, seed: int, population: Population = NORMAL
) -> tuple[dict[str, float], float]:
    """The truck's own parameters, and its x0_ref (mm), clipped to what nature allows."""
    rng = stream(seed, "parameters")
    drawn = {}
    for key, (low, high) in RANGES.items():
        value = parameters[key] + spreads.get(key, 0.0) * population.deviate(rng)
        drawn[key] = float(np.clip(value, low, high))
    zero_position = drawn["zero_position_ref"]
    return {**drawn, "zero_position_ref": parameters["zero_position_ref"]}, zero_position


def at_rest(p: NDArray, coolant: float, ambient: float) -> tuple[float, float]:
    """Body and housing of a clutch that has not slipped for long, °C."""
    inward, outward = p["conductance_body_housing"], p["conductance_housing_ambient"]
    through = inward * outward / (inward + outward) if inward + outward > 0 else 0.0
    weights = np.array([p["conductance_engine_body"], through, p["gearbox_conductance"]])
    if not weights.sum() > 0:
        return coolant, ambient
    body = float(weights @ [coolant, ambient, GEARBOX_TEMP] / weights.sum())
    share = float(through / outward) if outward > 0 else 1.0
    return body, ambient + (body - ambient) * share


def _simulate(
    plan: TruckScenario,
    duration: float,
    legs: NDArray,
    truck: NDArray,
    around: Surroundings,
    request: DriveRequest,
) -> tuple[Floats, Truth]:
    """The fast record (n, 6) of ``plant.run``, every FAST·STEP s, and the truth."""
    from clutchest.generator import plant

    steps = round(duration / plant.STEP)
    every = 20 if duration > LONG else 10
    state, situation = _start(plan, truck, around, request)
    fast = np.empty((steps // plant.FAST + 1, 6))
    slow = np.empty((steps // every + 1, 8))
    grid = np.column_stack((around.friction, around.coolant, around.ambient))
    drive = plant.TruckDrive(legs, grid, truck, situation, state)
    record = plant.TruckRecord(every, fast, slow)
    outsider = request.outsider
    if outsider and (law := outsider.law()):
        run_under(law, getattr(outsider, "pace", SLICE), steps, drive, record)
    else:
        plant.run(0, steps + 1, 1, drive, record)
    if not (np.isfinite(fast).all() and np.isfinite(slow).all()):
        raise ClutchestError(
            f"scenario '{plan.name}', seed {request.seed}: these parameters and effects "
            "let the simulation diverge"
        )
    time = np.arange(len(slow), dtype=np.float64) * (every * plant.STEP)
    engine, shaft, slave, _, torque, speed = fast[:: every // plant.FAST].T
    columns = {
        "temp_body": slow[:, 0],
        "temp_housing": slow[:, 1],
        "temp_disc": slow[:, 2],
        "zero_position": slow[:, 3],
        "friction": slow[:, 4],
        "engine_speed": engine,
        "torque_bias": np.interp(time, around.time, around.torque_bias),
        "clutch_torque": slow[:, 5],
        "mode": np.array(plant.MODES)[slow[:, 7].astype(int)],
        "slip_speed": engine - shaft,
        "slip_energy": slow[:, 6],
        "engine_torque": torque,
        "input_shaft_speed": shaft,
        "slave_position": truck[0]["position_origin"] + slave,
        "vehicle_speed": speed,
        "wear_rate": np.full(len(time), float(truck[0]["wear_rate"])),
    }
    return fast, Truth(time, {name: np.ascontiguousarray(v) for name, v in columns.items()})


def _start(
    plan: TruckScenario, truck: NDArray, around: Surroundings, request: DriveRequest
) -> tuple[Floats, NDArray]:
    """Integrated state and situation at t = 0: standing in neutral, or cruising in top gear."""
    from clutchest.generator import plant

    p = truck[0]
    rng, mismatch = stream(request.seed, "start"), request.mismatch
    body, housing = at_rest(p, around.coolant[0], around.ambient[0])
    if plan.start_temp is not None:
        body = plan.start_temp
    state = np.zeros(plant.STATES if mismatch.structure.plain else plant.STATES_IN_PARTS)
    state[plant.BODY] = body + plan.start_spread * rng.standard_normal()
    state[plant.HOUSING] = housing + plan.start_spread * rng.standard_normal()
    state[plant.DISC] = state[plant.BODY] + plan.start_spread * 0.2 * rng.standard_normal()
    state[plant.BODY] += mismatch.hotter
    state[plant.HOUSING] += mismatch.hotter / 2.0
    state[plant.DISC] += mismatch.hotter + mismatch.disc_hotter
    ratio = PER_METRE[-1] if plan.cruising else 0.0
    state[plant.SPEED] = plan.cruising
    state[plant.ENGINE] = state[plant.SHAFT] = plan.cruising * ratio or plant.IDLE
    if not mismatch.structure.plain:
        plant.settle(state, around.coolant[0], around.ambient[0], p)
    situation = np.zeros(1, plant.SITUATION)
    s = situation[0]
    if plan.cruising:
        s["phase"], s["gear"], s["ratio"] = plant.DRIVING, len(PER_METRE), ratio
    s["locked"], s["sign"] = 1, 1.0
    s["setpoint"] = s["engine_before"] = state[plant.ENGINE]
    s["friction"] = around.friction[0]
    growth = plant.expansion(state[plant.BODY], state[plant.DISC], p)
    s["slave"] = s["port"] = plant.zero_reference(0.0, s, p) - p["position_origin"] + growth
    s["plate"] = s["plate_before"] = s["slave"] + p["play"]  # it came to rest while closing
    return state, situation


def _quantities(
    fast: Floats, around: Surroundings, drawn: Values, effects: Mapping[str, Values]
) -> Mapping[str, Reading]:
    """What each sensor reads, without noise, as a function of time."""
    time = np.arange(len(fast)) * SPACING

    def column(index: int, delay: float = 0.0) -> Reading:
        return lambda t: np.interp(t - delay, time, fast[:, index])

    slave = column(2, effects["position_delay"]["delay"])
    torque = column(4, effects["torque_delay"]["delay"])
    above = drawn["position_origin"] + effects["position_offset"]["offset"]
    gain = 1 + effects["torque_gain"]["change"]
    return {
        "engine_speed": column(0),
        "input_shaft_speed": column(1),
        "slave_position": lambda t: above + slave(t),
        "motor_position": column(3),
        "engine_torque": lambda t: gain * torque(t) + np.interp(t, around.time, around.torque_bias),
        "coolant_temp": lambda t: np.interp(t, around.time, around.coolant),
        "ambient_temp": lambda t: np.interp(t, around.time, around.ambient),
        "vehicle_speed": column(5),
    }
