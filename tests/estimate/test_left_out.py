"""A vehicle file's effects, in logs that lack the signals which would show them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from bench import Bench
from clutchest.estimate import whole_log
from clutchest.estimate.replay import replay
from clutchest.models import machine_of

EFFECTS = {
    "friction_level": {"change": 0.1},
    "position_delay": {"delay": 0.02},
    "expansion_body": {"change": 0.1},
}


@pytest.mark.parametrize(
    ("missing", "kept"),
    [
        ("slave_position", ["expansion_body"]),
        ("input_shaft_speed", ["expansion_body"]),
        ("vehicle_speed", list(EFFECTS)),
    ],
)
def test_a_model_takes_the_effects_that_its_signals_show(
    missing: str, kept: list[str], bench: Callable[[str], Bench]
) -> None:
    b = bench("dry_clutch")
    model = machine_of("dry_clutch").equations(set(b.signals) - {missing})
    compiled = whole_log.compile_model(replace(b.vehicle, effects=EFFECTS), model)
    assert [effect.name for effect in compiled.model.effects] == kept


def test_replay_says_which_effects_it_leaves_out(bench: Callable[[str], Bench]) -> None:
    b = bench("dry_clutch")
    some = {name: s for name, s in b.signals.signals.items() if name != "slave_position"}
    run = replay(replace(b.signals, signals=some), replace(b.vehicle, effects=EFFECTS))
    assert (
        "without friction_level, position_delay: the signals at hand do not show it"
        in (run.summary["warnings"])
    )
