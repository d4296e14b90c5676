"""Whole healthy drives, each of another truck: simulated, read over its bus, judged."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import clutchest
from clutchest.diagnosis.blocks import blocks_of
from clutchest.diagnosis.drive import effects_for
from clutchest.diagnosis.equations import watch
from clutchest.diagnosis.faults import model_faults
from clutchest.diagnosis.predicted import since
from clutchest.diagnosis.streams import Streams

DURATION = 1800.0  # s
SCENARIOS = ("city", "launches", "heating")
# What heat does beyond the spreads of the vehicle file: no fault, and no monitor may fail by it.
CONFOUNDERS = (
    {},
    {"transmission_heat_path": {"conductance": 6.0}},
    {"coolant_coupling": {"change": 0.3}},
    {"housing_airflow": {"slope": 0.5}},
)


def record(task: tuple[str, str, int, int, Path]) -> Path:
    """Judge one drive and keep what came out; a record that is there already is kept."""
    vehicle, scenario, seed, confounder, out = task
    path = out / f"{scenario}-{seed}-{confounder}.npz"
    if path.is_file():
        return path
    truck = clutchest.load_vehicle(vehicle)
    signals = clutchest.simulate(truck, scenario, seed, CONFOUNDERS[confounder], duration=DURATION)
    streams = Streams(truck)
    streams.take(signals, signals.end)
    blocks = blocks_of(signals, truck, effects_for(truck.model))
    watched = watch(blocks, model_faults(truck.model), 1.0, DURATION / 3600.0)
    columns = watched.columns
    whole = since(blocks, columns, watched.residuals.before, 0, len(blocks))
    unfinished = path.with_suffix(".part.npz")
    np.savez_compressed(
        unfinished, begin=blocks.begin, end=blocks.end, count=blocks.count,
        z=watched.residuals.z.astype("f4"), information=watched.residuals.information.astype("f4"),
        surprise=watched.residuals.surprise.astype("f4"),
        score=whole.score.astype("f4"),
        told=np.diagonal(whole.information, axis1=1, axis2=2).astype("f4"),
        failed=np.array([j.fault.name for j in watched.faults if j.detected is not None], "U40"),
        misfit=watched.misfit_detected is not None,
        streams=np.array([t.name for t in streams.tests if t.alarms], "U40"),
        monitors=np.array([t.name for t in streams.tests if t.threshold is not None], "U40"),
    )  # fmt: skip
    unfinished.rename(path)
    return path
