"""The smallest folder to copy: a heated plate, whose table has a row a second."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.discovery.discover import discover
from clutchest.reading import read_log
from clutchest.reading.table_inspection import inspect_tables
from clutchest.vehicle import load_vehicle
from foreign_machines import MACHINES, module, vehicle


def test_a_slow_table_is_drafted_with_its_scatter_and_its_gap(tmp_path):
    """Written with all digits, a column's own steps say nothing of its noise."""
    generate = module("plate", "generate")
    generate.record(3, 600).to_csv(tmp_path / "own.csv", index=False)
    for name in ("plate.py", "plate.toml"):
        (tmp_path / name).write_text((MACHINES / "plate" / name).read_text(encoding="utf-8"))
    found = inspect_tables([tmp_path / "own.csv"], str(tmp_path / "plate.py"))
    draft = tmp_path / "draft.toml"
    found.write_vehicle(draft, draft)
    known = (tmp_path / "plate.toml").read_text(encoding="utf-8")
    numbers = known[known.index("[parameters]") : known.index("[modes]")]
    draft.write_text(draft.read_text(encoding="utf-8") + "\n" + numbers, encoding="utf-8")
    drafted = load_vehicle(draft, trust=True)
    assert drafted.modes["gap"] == 3.0
    for name, noise in generate.NOISE.items():
        assert drafted.signals[name].noise == pytest.approx(noise, rel=0.25)
        assert drafted.signals[name].period == 1.0
    assert len(read_log([tmp_path / "own.csv"], drafted)["middle"].time) == 600


@pytest.mark.slow
def test_what_was_hidden_in_the_plate_is_named(tmp_path):
    """Where its heater stands until the next row; taken for lines between rows, it is not."""
    generate, car = module("plate", "generate"), vehicle("plate")
    table = generate.record(1)
    found = {}
    for name, rows in (("held", generate.held(table)), ("lines", table)):
        rows.to_csv(tmp_path / f"{name}.csv", index=False)
        found[name] = discover(read_log([tmp_path / f"{name}.csv"], car), car)
    [cause] = found["held"].causes
    assert (found["held"].verdict, cause.effect) == ("named", "radiation")
    factor = found["held"].summary()["causes"][0]["parameters"]["factor"]
    assert abs(factor["value"] - generate.RADIATION) < 3.0 * factor["std"]
    assert found["lines"].verdict == "unknown"


def test_rows_at_the_end_of_a_step_hold_inputs_alone():
    generate = module("plate", "generate")
    table = generate.record(1, 20)
    held = generate.held(table)
    assert len(held) == 2 * len(table)
    assert held["middle"].count() == len(table)
    steps = held["power"].to_numpy().reshape(-1, 2)
    assert np.array_equal(steps[:, 0], steps[:, 1])
