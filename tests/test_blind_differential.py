"""The differential's part of the blind suite: its cases are the same every time, its outsiders act,
and its table adds up."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clutchest import load_vehicle
from clutchest.generator.alsd.outsider import SLICE
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.simulated import simulate

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
SIZED = {
    "rig-steps": {
        "supply_drop": {"resistance": [0.02, 0.1]},
        "pack_stiffness": {"change": [0.1, 0.3]},
        "motor_friction": {"change": [0.4, 0.5]},  # twice that is more than plausible
    },
    "rig-ramps": {
        "supply_drop": {"resistance": [0.01, 0.1]},
        "pack_stiffness": {"change": [0.2, 0.5]},
    },
}


@pytest.fixture(scope="module", autouse=True)
def blind() -> Iterator[None]:
    """The suite stands beside the benchmarks, not in the package."""
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


def outsiders() -> dict[str, Any]:
    from blind.differential_outsiders import OUTSIDERS

    return dict(OUTSIDERS)


@pytest.fixture
def sized(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    from blind import differential

    monkeypatch.setattr(differential, "SCENARIOS", tuple(SIZED))
    (tmp_path / differential.SIZES).write_text(json.dumps(SIZED))
    return tmp_path


def test_an_effect_is_hidden_where_it_shows_best_twice_as_large_as_is_seen(sized: Path):
    from blind.differential import cases

    found = cases(["effect"], range(2), sized)
    assert [(c.scenario, c.effects) for c in found] == [
        *[("rig-steps", {"pack_stiffness": {"change": 0.2}})] * 2,
        *[("rig-ramps", {"supply_drop": {"resistance": 0.02}})] * 2,
    ]


def test_cases_are_the_same_every_time_and_share_no_seed(sized: Path):
    from blind.differential import cases

    parts = ("null", "effect", "two", "outsider")
    all_cases = [cases([part], range(3), sized) for part in parts]
    assert all_cases == [cases([part], range(3), sized) for part in parts]
    assert cases(["two"], range(1, 3), sized) == all_cases[2][1:]
    seeds = [{case.seed for case in of} for of in all_cases]
    assert len(set(chain.from_iterable(seeds))) == sum(map(len, seeds))
    assert all(len(case.effects) == 2 for case in all_cases[2])
    for case in all_cases[3]:
        outsider = outsiders()[case.outsider]
        assert case.scenario in outsider.scenarios
        assert 0.0 < case.size < outsider.largest


def test_outsiders_falsify_equations_that_there_are_over_drivers_that_are_known():
    machine = machine_of("alsd")
    terms = machine.error_terms.values()
    assert len(outsiders()) >= 8 and not set(outsiders()) & set(machine.effects)
    for outsider in outsiders().values():
        assert set(outsider.equations) <= {term.equation for term in terms}
        known = {name for term in terms for name in term.covariates}
        assert outsider.drivers[0] in known and set(outsider.scenarios) <= {*machine.scenario_names}


@pytest.mark.slow
@pytest.mark.parametrize("name", range(8))
def test_an_outsider_acts_from_the_half_of_the_largest_on(name: int):
    from differential_runs import vehicle_of

    kind = list(outsiders().values())[name]
    scenario = kind.scenarios[0]
    plain, acted = (
        simulate(vehicle_of(scenario), scenario, 1, duration=24.0, nominal=True, outsider=outsider)
        for outsider in (None, kind(kind.largest / 2.0))
    )
    assert plain.truth and acted.truth
    shown = ("clutch_torque", "motor_angle", "motor_speed")
    for column in shown:
        off = acted.truth.columns[column] - plain.truth.columns[column]
        if np.abs(off).max() > 0.01 * np.abs(plain.truth.columns[column]).max():
            return
    pytest.fail(f"{kind.name} changes nothing of {', '.join(shown)}")


def record(verdict: str, **of: Any) -> dict[str, Any]:
    common = {"scenario": "coast", "seed": 1, "effects": {}, "seconds": 10.0, "sets": []}
    return {**common, "verdict": verdict, **of}


def test_the_table_adds_up():
    from blind.differential_table import lines, rows

    drop = {"supply_drop": {"resistance": 0.1}}
    records = [
        record("none"),
        record("unknown", where={"equation": "torque", "drivers": ["time"]}),
        record("error"),
        record(
            "named",
            effects=drop,
            sets=[["supply_drop"]],
            sizes={"supply_drop.resistance": [0.13, 0.01]},
        ),
        record(
            "ambiguous", effects=drop | {"angle_offset": {"offset": 1.0}}, sets=[["supply_drop"]]
        ),
        record(
            "unknown",
            outsider="cogging",
            size=0.01,
            where={"equation": "motor", "drivers": ["time", "motor_angle", "motor_speed"]},
        ),
        record(
            "named",
            outsider="cogging",
            size=0.01,
            sets=[["motor_friction"]],
            refuted=["motor_friction"],
            where={"equation": "current", "drivers": ["motor_angle"]},
        ),
    ]
    value = {row.what: (row.count, row.value) for row in rows(records)}
    assert value["false findings, all scenarios"] == (2, 0.5)
    assert value["all detected effects: named right"] == (1, 1.0)
    assert value["all pairs: both named"] == (1, 0.0)
    assert value["sizes of what is named: within 2 σ"] == (1, 0.0)
    assert value["all outsiders: unknown, or form refuted"] == (2, 1.0)
    assert value["all outsiders: equation"] == (2, 0.5)
    assert value["all outsiders: driver in the first two"] == (2, 1.0)
    assert value["runs without an answer"] == (7, 1 / 7)
    assert lines(records) == [
        "supply_drop 0.1 (0.13 ± 0.01), coast 1: named: supply_drop",
        "supply_drop 0.1 and angle_offset 1, coast 1: ambiguous: supply_drop",
        "cogging 0.01 Nm, coast 1: unknown: motor over time, motor_angle",
        "cogging 0.01 Nm, coast 1: named: motor_friction (form refuted: motor_friction)",
    ]


def test_laws_are_called_as_often_as_they_take_it():
    from blind import differential_outsiders

    assert differential_outsiders.SLICE == SLICE


@pytest.mark.slow
def test_a_fit_does_not_stay_where_numbers_of_a_part_run_away():
    """Half of this run, in which another consumer takes the voltage, is fitted best by numbers with
    which the whole has no finite likelihood."""
    from blind.differential_outsiders import OUTSIDERS

    seed, size = 42533, 0.3643385355278228
    hidden = OUTSIDERS["shared_supply"](size, seed % 7 / 7.0)
    signals = simulate("alsd_rig", "rig-ramps", seed, {}, duration=60.0, outsider=hidden)
    effects = tuple(machine_of("alsd").effects.values())
    problem = Problem.of(signals, load_vehicle("alsd_rig"), effects, discrepant=True)
    fitted = with_fitted_gains(problem)
    there = Objective.of(fitted).linearise_at(fitted.begin, active=fitted.nuisances)
    assert np.isfinite(there.cost)
