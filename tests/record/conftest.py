"""A run as the estimator would give it, made from a simulated drive and its truth."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from clutchest.estimate.observability import Information
from clutchest.estimate.run import Engagement, Estimate, Innovations, Run, Track
from clutchest.models import machine_of
from clutchest.signals import Signals
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

MODES = ("open", "slipping", "locked", "retracted")


@pytest.fixture(scope="session")
def truck():
    return load_vehicle("truck")


@pytest.fixture(scope="session")
def drive(truck) -> Signals:
    return simulate(truck, "launches", seed=3, duration=40.0, nominal=True)


@pytest.fixture(scope="session")
def run(truck, drive) -> Run:
    return run_of(truck, drive)


@pytest.fixture(scope="session")
def two_drives(truck, drive) -> Run:
    later = replace(drive, start_ns=drive.start_ns + 86_400_000_000_000, sources=("second.log",))
    return run_of(truck, replace(drive, later=(later,)))


def run_of(vehicle, signals: Signals) -> Run:
    """Estimates that scatter about the truth as their standard deviations say."""
    tracks = tuple(track_of(vehicle, drive, seed) for seed, drive in enumerate(signals.drives))
    last = tracks[-1]
    states = {
        name: {
            "value": e.value[-1],
            "std": e.std[-1],
            "valid": bool(e.valid[-1]),
            "why": None if e.valid[-1] else "no launch yet",
            "needs": None if e.valid[-1] else "a launch",
            "information_bits": {"total": 2.5, "slipping": 2.0, "retracted": 0.5},
            "informed_at_s": last.time[-1],
            "not_observable_now": None,
            "moves_with": {},
        }
        for name, e in last.states.items()
    }
    innovations = last.innovations
    sensors = {}
    for name in innovations.names:
        _, misfit, std = innovations.of(name)
        sensors[name] = {
            "count": len(misfit),
            "innovation_rms": np.sqrt(np.mean(misfit**2)),
            "nis_mean": np.mean((misfit / std) ** 2),
        }
    summary = {
        "frames": signals.counts.frames,
        "frames_decoded": signals.counts.decoded,
        "frames_rejected": dict(signals.counts.rejected),
        "duration_s": signals.end,
        "states": states,
        "sensors": sensors,
        "log_likelihood": float("nan"),
        "wear": {"words": ["Worn 0.14 ± 0.05 mm of 3 mm.", "Left: 140 MJ [95 %: 36 to 200]."]},
        "engagements": [
            {"drive": number, **asdict(event)}
            for number, track in enumerate(tracks)
            for event in track.engagements
        ],
        "warnings": ["parameter 'kiss_point' is a guess"],
    }
    provenance = {"clutchest": "0.1.0", "vehicle_hash": vehicle.hash, "parameters_hash": "beef"}
    return Run(vehicle, signals, tracks, summary, {"states": states}, provenance)


def track_of(vehicle, drive: Signals, seed: int) -> Track:
    rng = np.random.default_rng(seed)
    truth = drive.truth
    time = np.arange(0.0, drive.end, 0.1)
    spread = {"°C": 3.0, "mm": 0.05, "1": 0.03, "rad/s": 0.1, "Nm": 8.0, "mm/MJ": 0.003}
    states = {}
    for state in machine_of(vehicle.model).states:
        value = np.interp(time, truth.time, truth.columns[state.name])
        std = spread[state.unit] * (1 + 4 * np.exp(-time / 10))
        error = std * rng.normal() * 0.7
        states[state.name] = Estimate(value + error, std, std < 3 * spread[state.unit])
    torque = np.interp(time, truth.time, truth.columns["clutch_torque"])
    always = np.ones(len(time), bool)
    slipping = np.interp(time, truth.time, truth.columns["mode"] == "slipping") > 0.5
    energy = np.cumsum(np.where(slipping, 4e3, 0.0))
    speed = drive["engine_speed"]
    n = len(speed)
    innovations = Innovations(
        ("engine_speed", "zero_position"),
        speed.time,
        (np.arange(n) % 25 == 0).astype(np.int8),
        rng.normal(0, 0.1, n),
        np.full(n, 0.1),
    )
    return Track(
        time,
        np.where(slipping, 1, 2).astype(np.uint8),
        MODES,
        states,
        Estimate(torque, np.full(len(time), 25.0), always),
        Estimate(energy, 0.03 * energy, always),
        innovations,
        (Engagement(3.1, 1.9, 52e3, 1.8e3, 640.0, 96.0),),
        -12.5,
        Information((), time, np.zeros(len(time), np.uint8), np.zeros((len(time), 0)), MODES),
    )
