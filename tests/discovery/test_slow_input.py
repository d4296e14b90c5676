"""An effect of the user's on an input that comes seldom, or late."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.discovery.discover import discover
from clutchest.reading import read_log
from clutchest.reading.tables import write_signals
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle, load_vehicle

SLOPE, AMBIENT = 0.2, 30.0  # 1/(10 K); °C, at which the torque is so much higher
OWN = """
from clutchest.models.effects import Effect, Number

class WithAmbient(Effect):
    name, model, equation = "with_ambient", "dry_clutch", "torque"
    parameters = (Number("slope", "1/(10 K)", -0.5, 0.5),)

    def terms(self, g):
        return {"sliding_torque": lambda torque, q:
                torque * (1 + g.slope * (q.ambient_temp - 20) / 10)}
"""


@pytest.fixture(scope="module")
def stated(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    """The truck with the effect in its file, its slope exact."""
    folder = tmp_path_factory.mktemp("own")
    own, truck = folder / "own.py", clutchest.load_vehicle("truck")
    own.write_text(OWN, encoding="utf-8")
    text = truck.path.read_text(encoding="utf-8").replace(
        'name = "truck"', f'name = "own"\neffects_files = ["{own.name}"]', 1
    )
    for path in (file.path for file in truck.dbc):
        text = text.replace(f'"{path.name}"', f'"{path.as_posix()}"', 1)
    text += f"\n[effects.with_ambient]\nslope = {SLOPE}\n"
    (folder / "own.toml").write_text(text, encoding="utf-8")
    return load_vehicle(folder / "own.toml", trust=True)


@pytest.fixture(scope="module")
def drive() -> Signals:
    """Of a truck whose torque is so much higher throughout."""
    effects = {"friction_level": {"change": SLOPE}}
    return clutchest.simulate("truck", "launches", 3, effects, duration=600.0, nominal=True)


def table(folder: Path, drive: Signals, time: Floats, value: Floats) -> Path:
    """The drive as a table with this ambient column; an empty cell wherever it has no sample."""
    ambient = Signal.of("ambient_temp", "°C", time, value)
    signals = replace(drive, signals={**drive.signals, "ambient_temp": ambient}, truth=None)
    path = folder / "drive.parquet"
    write_signals(signals, path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "period", "noise"),
    [(0.37, 1.0, 0.0), (0.37, 1.0, 0.5), (200.0, 1.0, 0.0), (200.0, 60.0, 0.0), (0.0, 0.1, 0.5)],
)
def test_a_slow_or_late_input_is_no_error(tmp_path, stated, drive, first, period, noise):
    time = np.arange(first, drive.end, period)
    value = AMBIENT + noise * np.random.default_rng(5).normal(size=len(time))
    answer = discover(read_log([table(tmp_path, drive, time, value)], stated), stated)
    assert answer.verdict == "none", answer.sentence


@pytest.mark.slow
def test_an_error_of_a_slow_input_is_detected(tmp_path, stated, drive):
    """Its column 10 K off: the model's torque is 20 % of the truth off, by that column."""
    time = np.arange(0.37, drive.end, 1.0)
    path = table(tmp_path, drive, time, np.full(len(time), AMBIENT + 10.0))
    answer = discover(read_log([path], stated), stated)
    assert answer.verdict == "named", answer.sentence
    (cause,) = answer.causes
    assert cause.effect == "friction_level"
    change, off = cause.parameters["change"], (1.0 + SLOPE) / (1.0 + 2.0 * SLOPE) - 1.0
    assert abs(change.value - off) < 3.0 * change.std
