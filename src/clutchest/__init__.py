"""Clutch temperatures, wear and friction from production CAN signals, with honest uncertainty.

>>> import clutchest
>>> vehicle = clutchest.load_vehicle("truck")
>>> run = clutchest.replay(clutchest.read_log("demo", vehicle), vehicle)
>>> run.to_pandas()
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clutchest.diagnosis.diagnose import diagnose
    from clutchest.diagnosis.result import Diagnosis
    from clutchest.discovery.discover import discover
    from clutchest.discovery.result import Discovery
    from clutchest.errors import ClutchestError
    from clutchest.estimate.estimated_series import EstimatedSeries
    from clutchest.estimate.feedforward import Feedforward, feedforward
    from clutchest.estimate.filterpy_engine import filterpy_of
    from clutchest.estimate.replay import replay
    from clutchest.estimate.run import Engagement, Estimate, Innovations, Run, Track
    from clutchest.fleet.fleet import Fleet, analyse_fleet
    from clutchest.fleet.fleet import analyse_fleet as fleet
    from clutchest.identify import identify_vehicle
    from clutchest.identify import identify_vehicle as identify
    from clutchest.identify.fit import Fit
    from clutchest.monitor.monitor import Monitor
    from clutchest.reading import read_log
    from clutchest.record.files import write_run
    from clutchest.record.notebook import view
    from clutchest.saving import save
    from clutchest.signals import Signal, Signals
    from clutchest.simulated import simulate
    from clutchest.vehicle import Vehicle, load_vehicle

__version__ = "0.1.0"

# Loaded when first asked for: `import clutchest` itself stays quick.
_HOMES = {
    "ClutchestError": "clutchest.errors",
    "Diagnosis": "clutchest.diagnosis.result",
    "Discovery": "clutchest.discovery.result",
    "Engagement": "clutchest.estimate.run",
    "Estimate": "clutchest.estimate.run",
    "EstimatedSeries": "clutchest.estimate.estimated_series",
    "Feedforward": "clutchest.estimate.feedforward",
    "Innovations": "clutchest.estimate.run",
    "Monitor": "clutchest.monitor.monitor",
    "Run": "clutchest.estimate.run",
    "Signal": "clutchest.signals",
    "Signals": "clutchest.signals",
    "Track": "clutchest.estimate.run",
    "Vehicle": "clutchest.vehicle",
    "analyse_fleet": "clutchest.fleet.fleet",
    "diagnose": "clutchest.diagnosis.diagnose",
    "discover": "clutchest.discovery.discover",
    "feedforward": "clutchest.estimate.feedforward",
    "Fleet": "clutchest.fleet.fleet",
    "Fit": "clutchest.identify.fit",
    "filterpy_of": "clutchest.estimate.filterpy_engine",
    "identify_vehicle": "clutchest.identify",
    "load_vehicle": "clutchest.vehicle",
    "read_log": "clutchest.reading",
    "replay": "clutchest.estimate.replay",
    "save": "clutchest.saving",
    "simulate": "clutchest.simulated",
    "view": "clutchest.record.notebook",
    "write_run": "clutchest.record.files",
}

__all__ = [
    "ClutchestError",
    "Diagnosis",
    "Discovery",
    "Engagement",
    "Estimate",
    "EstimatedSeries",
    "Feedforward",
    "Fit",
    "Fleet",
    "Innovations",
    "Monitor",
    "Run",
    "Signal",
    "Signals",
    "Track",
    "Vehicle",
    "__version__",
    "analyse_fleet",
    "diagnose",
    "discover",
    "feedforward",
    "filterpy_of",
    "fleet",
    "identify",
    "identify_vehicle",
    "load_vehicle",
    "read_log",
    "replay",
    "save",
    "simulate",
    "view",
    "write_run",
]


_MODULES = ("can", "fleet", "identify", "machine")  # the middle two are called by their own name


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"clutchest.{name}")
    if name not in _HOMES:
        from clutchest.errors import alike

        hint = alike(name, __dir__())
        raise AttributeError(f"module 'clutchest' has no attribute '{name}'{hint}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *_MODULES})
