"""A vehicle: one TOML file that maps its bus signals and states its parameters."""

from clutchest.vehicle.file import load_vehicle
from clutchest.vehicle.text import dump_vehicle
from clutchest.vehicle.vehicle import (
    BusSignal,
    Estimation,
    HealthyGain,
    ParameterValue,
    SignalMap,
    SmoothError,
    TableColumn,
    Vehicle,
)

__all__ = [
    "BusSignal",
    "Estimation",
    "HealthyGain",
    "ParameterValue",
    "SignalMap",
    "SmoothError",
    "TableColumn",
    "Vehicle",
    "dump_vehicle",
    "load_vehicle",
]
