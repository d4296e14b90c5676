"""Signals that a program makes itself, of arrays that it has."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest

import clutchest
from clutchest import Signal, Signals
from clutchest.errors import ClutchestError


@pytest.fixture(scope="module")
def demo() -> Signals:
    return clutchest.read_log("demo", "truck")


def in_unit(demo: Signals, name: str, unit: str, value: np.ndarray) -> Signals:
    """The same with one signal in another unit."""
    return Signals({**demo.signals, name: Signal.of(name, unit, demo[name].time, value)}, end=240.0)


def test_the_unit_of_a_signal_counts(demo: Signals) -> None:
    """Kelvin taken for °C gave a housing of 200 °C, and called it valid."""
    known = clutchest.replay(Signals(demo.signals, end=240.0), "truck").summary["states"]
    for name, unit, value in (
        ("coolant_temp", "K", demo["coolant_temp"].value + 273.15),
        ("engine_speed", "1/min", demo["engine_speed"].value * 30 / np.pi),
    ):
        run = clutchest.replay(in_unit(demo, name, unit, value), "truck")
        assert run.signals[name].unit == demo[name].unit
        for state, one in run.summary["states"].items():
            assert one["value"] == pytest.approx(known[state]["value"], abs=1e-3), state
    with pytest.raises(ClutchestError, match="signal 'coolant_temp' is in V, expected a unit such"):
        clutchest.replay(in_unit(demo, "coolant_temp", "V", demo["coolant_temp"].value), "truck")


def test_without_an_end_it_is_that_of_the_last_sample(demo: Signals) -> None:
    made = Signals(demo.signals)
    assert made.end == max(signal.time[-1] for signal in demo.values())
    run = clutchest.replay(made, "truck")
    assert run.summary["duration_s"] == pytest.approx(made.end, abs=0.01)


def test_what_is_no_signal_is_named() -> None:
    with pytest.raises(ClutchestError, match="signal 'engine_speed': expected a Signal, not"):
        Signals({"engine_speed": np.ones(3)})  # type: ignore[dict-item]
    with pytest.raises(ClutchestError, match="signal 'x': 1 of its times are no numbers"):
        Signal.of("x", "", [0.0, nan, 1.0], [0.0, 1.0, 2.0])


def test_modules_are_attributes_and_other_names_have_a_hint() -> None:
    assert clutchest.machine.Machine and clutchest.can.read_frames
    assert {"can", "machine"} <= {*dir(clutchest)}
    with pytest.raises(AttributeError, match="no attribute 'load_log'; did you mean 'read_log'"):
        _ = clutchest.load_log
