"""The active limited-slip differential of [ID08], equation by equation.

[ID08] V. Ivanović, J. Deur, Z. Herold, M. Hancock, F. Assadian, "Modeling and Experimental
Validation of Active Limited Slip Differential Clutch Dynamics", IMECE2008-67411, ASME 2008.
Equation and figure numbers are the paper's.  One file per part: ``dc_motor`` (1)–(3),
``motor_friction`` (4)–(6), ``ball_ramp`` (7)–(9), ``belleville`` (10), ``pack`` Fig. 6b,
``driveline`` Fig. 7, ``friction`` Fig. 8 and its alternatives, ``controller``, ``thermal``.

``full`` puts all of them together for simulation; ``reduced`` is what the ``estimator`` runs on.
"""

from __future__ import annotations

from collections.abc import Container
from typing import Any

from clutchest.models.alsd.actuator import ACTUATOR
from clutchest.models.alsd.error_terms import (
    COVARIATES,
    DURATIONS,
    ERROR_TERMS,
    PEAKS,
    RATES,
    SENSOR_FOR,
    SEPARATING_SENSORS,
    TURNS,
)
from clutchest.models.alsd.estimator import ALSD, at_rest, for_signals
from clutchest.models.alsd.experiments import BENCHES, EXPERIMENTS
from clutchest.models.alsd.fitted import to_fit
from clutchest.models.alsd.inverse import INVERSE
from clutchest.models.alsd.judder import JUDDER
from clutchest.models.alsd.manoeuvres import MANOEUVRES
from clutchest.models.alsd.own_effects import DifferentialEffects
from clutchest.models.alsd.parameters import PARAMETERS
from clutchest.models.alsd.regimes import RULES
from clutchest.models.alsd.symbols import COLUMNS, SENSORS, SEPARATING_MANOEUVRES, STATES
from clutchest.models.declarations import Event, OutputTracking, Storing, Wear
from clutchest.models.effects import effects_in
from clutchest.models.fault import faults_in
from clutchest.models.machine import Machine


def _generate(request: Any) -> Any:
    """The generator's plant, loaded when it is asked for."""
    from clutchest.generator import alsd

    return alsd.generate(request)


def _scenarios() -> tuple[str, ...]:
    from clutchest.generator import alsd

    return tuple(alsd.SCENARIOS)


def _scenarios_with(signals: Container[str]) -> tuple[str, ...]:
    from clutchest.generator.alsd.scenarios import scenarios_with

    return tuple(scenarios_with(signals))


MACHINE = Machine(
    name="alsd",
    what="active limited-slip differential",
    states=STATES,
    parameters=PARAMETERS,
    inputs=ALSD.inputs,
    sensors=SENSORS,
    columns=COLUMNS,
    equations=for_signals,
    fitted=to_fit,
    at_rest=at_rest,
    regimes=RULES,
    output="transmitted_torque",
    event=Event("temp_pack", slip=("slip_speed",)),
    overview=("clutch_torque", "shaft_torque", "armature_voltage", "armature_current"),
    tracking=OutputTracking(
        drive="armature_current",
        least=0.5,  # A: friction alone holds the motor
        measured=("clutch_torque", "shaft_torque"),
        onset=20.0,  # Nm: four times the noise of a torque sensor
        unit="Nm",
        request="torque_request",
    ),
    judder=JUDDER,
    inverse=INVERSE,
    wear=Wear(
        state="free_play",
        nominal="free_play",
        unit="m",
        part="clutch pack",
        sign=1.0,
        effect="free_play_growth",
        amount="growth",
    ),
    storing=Storing(
        "motor_angle",
        (("armature_voltage", "armature_current"), ("armature_current", "motor_angle")),
    ),
    limits={"wear": "m"},
    error_terms=ERROR_TERMS,
    covariates=COVARIATES,
    rates=RATES,
    peaks=PEAKS,
    turns=TURNS,
    durations=DURATIONS,
    effects=effects_in("clutchest.models.alsd.effects"),
    separating_sensors=SEPARATING_SENSORS,
    sensor_for=SENSOR_FOR,
    separating_manoeuvres=SEPARATING_MANOEUVRES,
    faults=faults_in("clutchest.models.alsd.faults"),
    actuators=(ACTUATOR,),
    fault_signals=("armature_voltage", "armature_current", "motor_angle"),
    experiments=EXPERIMENTS,
    benches=BENCHES,
    generate=_generate,
    scenarios=_scenarios,
    scenarios_with=_scenarios_with,
    manoeuvres=MANOEUVRES,
    own_effects=DifferentialEffects,
    template="alsd_rig",
    check_equations=False,
    reservations={
        "discover": "of healthy simulated logs of the differential 10 of 859 got a finding "
        "(docs/alsd-results.md)",
    },
)
