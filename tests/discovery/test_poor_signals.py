"""Signals that tell little get an answer that says so."""

from __future__ import annotations

from dataclasses import replace

import pytest

import clutchest
from clutchest.discovery.discover import discover
from clutchest.record.discovery_report import title

TRUCK = clutchest.load_vehicle("truck")


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["slave_position", "input_shaft_speed"])
def test_without_a_signal_nothing_is_claimed(lost):
    signals = clutchest.simulate(
        TRUCK, "launches", 81, {"friction_level": {"change": -0.3}}, duration=150.0
    )
    kept = {name: signal for name, signal in signals.signals.items() if name != lost}
    answer = discover(replace(signals, signals=kept), TRUCK)
    assert answer.verdict == "none"
    assert "friction_level" not in {i.effect for i in answer.identifiability if i.excited}
    assert "friction_level" in answer.unexcited, "or a script would take it for excluded"
    if not any(i.excited for i in answer.identifiability):
        assert "neither confirm nor refute" in answer.sentence
        assert title(answer) == "the data are not informative"
    [said] = [words for words in answer.warnings if lost in words]
    assert said.startswith(f"not tested, because there is no {lost}: ")
    assert "friction_level" in said
