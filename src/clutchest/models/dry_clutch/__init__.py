"""The heavy-truck dry clutch of [ME12]: ``equations``, ``symbols``, ``regimes``, ``error_terms``,
one file per effect in ``effects``, per fault in ``faults``, per part left out in ``unmodelled``."""

from __future__ import annotations

from typing import Any

from clutchest.models.declarations import Comparison, Driving, Event, Wear
from clutchest.models.dry_clutch.delays import DELAY_RELATIONS
from clutchest.models.dry_clutch.equations import DRY_CLUTCH, at_rest, for_signals
from clutchest.models.dry_clutch.error_terms import (
    COVARIATES,
    DEPARTURES,
    ERROR_TERMS,
    PEAKS,
    RATES,
    SENSOR_FOR,
    SEPARATING_SENSORS,
    SMOOTH_OVER,
    TURNS,
)
from clutchest.models.dry_clutch.manoeuvres import MANOEUVRES
from clutchest.models.dry_clutch.own_effects import TruckEffects
from clutchest.models.dry_clutch.procedures import (
    PROCEDURES,
    RELATIVE_STATES,
    TORQUE,
    ZERO_POSITION,
)
from clutchest.models.dry_clutch.regimes import RULES
from clutchest.models.dry_clutch.symbols import COLUMNS, SEPARATING_MANOEUVRES
from clutchest.models.effects import effects_in
from clutchest.models.fault import Demand, Follower, faults_in
from clutchest.models.machine import Machine


def _generate(request: Any) -> Any:
    """The generator's truck, loaded when it is asked for."""
    from clutchest.generator import generate

    return generate(request)


def _scenarios() -> tuple[str, ...]:
    from clutchest.generator import SCENARIOS

    return tuple(SCENARIOS)


MACHINE = Machine(
    name="dry_clutch",
    what="dry clutch of a heavy truck",
    states=DRY_CLUTCH.states,
    parameters=DRY_CLUTCH.parameters,
    inputs=DRY_CLUTCH.inputs,
    sensors=DRY_CLUTCH.sensors,
    columns=COLUMNS,
    equations=for_signals,
    at_rest=at_rest,
    regimes=RULES,
    output="transmitted_torque",
    event=Event("temp_disc", slip=("engine_speed", "input_shaft_speed")),
    wear=Wear(
        state="zero_position",
        nominal="zero_position_ref",
        unit="mm",
        part="pads",
        rate_state="wear_rate",
        same_as=("position_offset",),
    ),
    driving=Driving(
        "engine_torque", "engine_inertia", "engine_speed", "input_shaft_speed", "engine_torque_max"
    ),
    overview=("engine_speed", "input_shaft_speed", "slave_position"),
    limits={"wear": "mm"},
    error_terms=ERROR_TERMS,
    covariates=COVARIATES,
    smooth_over=SMOOTH_OVER,
    rates=RATES,
    peaks=PEAKS,
    turns=TURNS,
    departures=DEPARTURES,
    effects=effects_in("clutchest.models.dry_clutch.effects"),
    unmodelled=effects_in("clutchest.models.dry_clutch.unmodelled"),
    separating_sensors=SEPARATING_SENSORS,
    sensor_for=SENSOR_FOR,
    compared=Comparison("measured_torque", "clutch_torque", "Nm", "clutch torque", "torque"),
    separating_manoeuvres=SEPARATING_MANOEUVRES,
    faults=faults_in("clutchest.models.dry_clutch.faults"),
    fault_signals=("slave_position", "input_shaft_speed", "engine_torque", "engine_speed"),
    followers=(Follower("actuator", "motor_position", "slave_position", 1.5),),
    demands=(
        Demand(
            "engine_torque",
            "Nm",
            ("engine_torque_demand", "engine_torque_request"),
            "accelerator_pedal",
            "engine_torque_max",
        ),
    ),
    procedures=PROCEDURES,
    relative_states=RELATIVE_STATES,
    pictures=(TORQUE, ZERO_POSITION),
    delay_relations=DELAY_RELATIONS,
    generate=_generate,
    scenarios=_scenarios,
    manoeuvres=MANOEUVRES,
    own_effects=TruckEffects,
    template="truck",
    car_template="gt350",
    check_equations=False,
)
