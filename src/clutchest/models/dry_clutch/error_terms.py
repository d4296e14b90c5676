"""Errors of the dry clutch's equations that no effect describes."""

from __future__ import annotations

from collections.abc import Mapping

from clutchest.models.declarations import Separation
from clutchest.models.error_terms import ErrorTerm

# A reading that the equations take as an input is corrected, so that there the sign turns.
_ENGINES_MAP = ("engine_speed", "engine_torque", "coolant_temp", "ambient_temp")
# A report is made from the fuel; boost, and what it is filtered by, make it early or late.
_REPORT = (*_ENGINES_MAP, "engine_torque_rate")
# What is bolted to an engine is shaken by it, in a truck by the road, dragged along by jerks, and
# moved as torque rocks the engine and pushes shafts along.
_ACTUATOR = (
    "slave_position",
    "position_rate",
    "recent_movement",
    "engine_torque",
    "engine_speed",
    "engine_acceleration",
    "vehicle_speed",
    "vehicle_acceleration",
    "temp_housing",
    "ambient_temp",
    "time",
)
_WARMTH = (  # of what is there, and what made it
    "temp_disc",
    "temp_body",
    "temp_housing",
    "coolant_temp",
    "ambient_temp",
    "energy",
    "time",
)
# What wears also creeps and swells; how fast the engine or the truck goes does nothing to it.
_WEARS = ("slip_speed", "slave_position", *_WARMTH)
# How much slip energy wears depends on the contact, and on how long it has been run in.
_WEARS_BY_ENERGY = ("slip_speed", "slave_position", "temp_disc", "temp_body", "energy", "time")
_HEATS = (  # flows between what is warm, stirred by what turns, through what touches
    "slip_speed",
    "engine_speed",
    "input_shaft_speed",
    "vehicle_speed",
    "slave_position",
    *_WARMTH,
)
# What an engine burns warms what is bolted to it, and what its exhaust passes.
_WARMED_BY_THE_ENGINE = (*_HEATS, "engine_torque")
# The rate of the slip is none of these: it is the reading's own noise that it would go with.  Nor
# is the torque's report: what is off by it, is off in the report.
_ENGINES_BALANCE = (
    *_HEATS,
    "position_rate",
    "zero_position",
    "friction",
    "torque_bias",
    "temp_disc_peak",
    "temp_body_peak",
)
_ENGINES = (*_ENGINES_BALANCE, "vehicle_acceleration")  # oil in the sump surges with it
# Not the slip's power, of which the torque itself is a part, nor the engine's torque, which is what
# the clutch's balances as it slips: it follows from friction.
_ADDED = (*_ENGINES_BALANCE, "slip_rate")
# A lining that rests takes up moisture and dries as it slips, and each engagement polishes it.  How
# the engine speeds up is no cause of friction, but what follows from it.
_FRICTION = (*_ADDED, "slip_power", "rest_time", "recent_slip", "engagements", "slip_angle")
_CLOCKS = ("engine_speed", "time")  # messages are sent by the revolution, or by a clock
# What boost holds back comes later as the torque grows than as it falls.
_REPORTS_CLOCKS = (*_CLOCKS, "engine_torque_rate")
_SHAFTS_CLOCKS = ("input_shaft_speed", "time")  # its teeth are counted by its own revolution
ERROR_TERMS: Mapping[str, ErrorTerm] = {
    "torque": ErrorTerm(
        "torque",
        {"sliding_torque": lambda value, g: value * (1 + 0.1 * g)},
        covariates=_FRICTION,
        size=10.0,
        unit="%",
    ),
    "torque, added": ErrorTerm(
        "torque",
        {"sliding_torque": lambda value, g: value + 30.0 * g * (value > 0.0)},
        covariates=_ADDED,
        size=30.0,
        unit="Nm",
    ),
    "engine_speed": ErrorTerm(
        "engine_speed",
        {"true_engine_torque": lambda value, g: value - 30.0 * g},
        covariates=_ENGINES,
        size=30.0,
        unit="Nm",
    ),
    "disc_heat": ErrorTerm(
        "disc_heat",
        {"disc_heat": lambda value, g: value + 500.0 * g},
        covariates=_HEATS,
        slow=True,
        size=500.0,
        unit="W",
    ),
    "disc_heat, exchanged": ErrorTerm(
        "disc_heat",
        {"conductance_disc_body": lambda value, g: value * (1 + 0.5 * g)},
        covariates=_HEATS,
        slow=True,
        size=50.0,
        unit="%",
    ),
    "body_heat": ErrorTerm(
        "body_heat",
        {"body_heat": lambda value, g: value + 500.0 * g},
        covariates=_WARMED_BY_THE_ENGINE,
        slow=True,
        size=500.0,
        unit="W",
    ),
    "housing_heat": ErrorTerm(
        "housing_heat",
        {"housing_heat": lambda value, g: value + 200.0 * g},
        covariates=_WARMED_BY_THE_ENGINE,
        slow=True,
        size=200.0,
        unit="W",
    ),
    "zero_position": ErrorTerm(
        "zero_position",
        {"zero_position_rate": lambda value, g: value + 3e-4 * g},
        covariates=_WEARS,
        slow=True,
        size=3e-4,
        unit="mm/s",
    ),
    "zero_position, worn": ErrorTerm(
        "zero_position",
        {"wear_per_energy": lambda value, g: value + 0.3 * g},
        covariates=_WEARS_BY_ENERGY,
        slow=True,
        size=0.3,
        unit="mm/MJ",
    ),
    "sensor:engine_torque": ErrorTerm(
        "sensor:engine_torque",
        {"engine_torque": lambda value, g: value / (1 + 0.1 * g)},
        covariates=_REPORT,
        size=10.0,
        unit="%",
    ),
    "sensor:engine_torque, added": ErrorTerm(
        "sensor:engine_torque",
        {"engine_torque": lambda value, g: value - 30.0 * g},
        covariates=_REPORT,
        size=30.0,
        unit="Nm",
    ),
    "sensor:slave_position": ErrorTerm(
        "sensor:slave_position",
        {
            "slave_position": lambda value, g: value - 0.1 * g,
            "zero_position_reading": lambda value, g: value + 0.1 * g,
        },
        covariates=_ACTUATOR,
        size=0.1,
        unit="mm",
    ),
    "sensor:input_shaft_speed": ErrorTerm(
        "sensor:input_shaft_speed",
        {"input_shaft_speed": lambda value, g: value / (1 + 0.02 * g)},
        covariates=("input_shaft_speed",),
        size=2.0,
        unit="%",
    ),
    "timing:engine_torque": ErrorTerm(
        "timing:engine_torque", late=("engine_torque", 0.02), covariates=_REPORTS_CLOCKS
    ),
    "timing:slave_position": ErrorTerm(
        "timing:slave_position", late=("slave_position", 0.02), covariates=_CLOCKS
    ),
    "timing:input_shaft_speed": ErrorTerm(
        "timing:input_shaft_speed", late=("input_shaft_speed", 0.02), covariates=_SHAFTS_CLOCKS
    ),
}

SEPARATING_SENSORS = (
    Separation(
        ("zero_position", "sensor:slave_position"),
        "a second position sensor, or the thickness of the pads measured once,",
    ),
    Separation(("torque", "sensor:engine_torque"), "a torque sensor on the gearbox input shaft"),
    Separation(("torque", "disc_heat"), "a temperature sensor near the disc"),
    Separation(("disc_heat", "body_heat"), "a temperature sensor on the pressure plate"),
)

# The sensor that would show an error in each equation by itself.
SENSOR_FOR = {
    "torque": "a torque sensor on the gearbox input shaft",
    "disc_heat": "a temperature sensor near the disc",
    "body_heat": "a temperature sensor on the pressure plate",
    "housing_heat": "a temperature sensor on the clutch housing",
    "zero_position": "the thickness of the pads, measured once,",
    "sensor:slave_position": "a second position sensor",
    "": "a second sensor, or a clock that its signals share,",
}

# Covariates beside inputs, states, time and slip energy: quantities by name, rates, and
# the highest value so far of states, since overheating changes a lining for good.
COVARIATES = {"slip_speed": "rad/s", "slip_power": "W"}  # a surface is hot before any mass is
SMOOTH_OVER = {"compression": "mm"}
RATES = {
    "position_rate": "slave_position",
    "slip_rate": "slip_speed",  # friction may lag
    "vehicle_acceleration": "vehicle_speed",
    "engine_torque_rate": "engine_torque",  # boost builds up more slowly than fuel
}
# A place of the disc meets the same one of the flywheel after a turn of the slip; a hose swells
# while the clutch is held.
TURNS = {"slip_angle": "slip_speed"}
DEPARTURES = {"recent_movement": "slave_position"}
PEAKS = {"temp_disc_peak": "temp_disc", "temp_body_peak": "temp_body"}
