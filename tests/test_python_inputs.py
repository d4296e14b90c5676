"""What is wrong in a call is said in one line, and nothing that was asked for is passed over."""

from __future__ import annotations

import copy
import json
import pickle

import pytest

import clutchest
from clutchest.errors import ClutchestError


def city(**more):
    return clutchest.simulate("truck", "city", **{"duration": 5.0, **more})


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"duratoin": 5.0}, "simulate has no option 'duratoin'; did you mean 'duration'"),
        ({"seed": -1}, "seed -1: expected a whole number, 0 or more"),
        ({"duration": "x"}, "duration: expected a number or None, not 'x'"),
        ({"nominal": "no"}, "nominal: expected True or False, not 'no'"),
        ({"mismatch": "city"}, "mismatch: expected a Mismatch, not 'city'"),
        ({"outsider": 3}, "outsider: expected an Outsider or None, not 3"),
        ({"disturbances": {"friction_std": "x"}}, "disturbance 'friction_std': expected a number"),
        ({"effects_files": "my.py"}, "effects_files: expected a list, not 'my.py'"),
        ({"effects_files": ["my.py"]}, "my.py: no such file"),
        ({"seed": 1.5}, "seed: expected a whole number, not 1.5"),
        ({"effects": "wear"}, "effects: expected {'wear': {'amount': 0.5}}, not str"),
        ({"effects": {"wear": 1}}, "effect 'wear': expected numbers by name, not 1"),
        ({"effects": {"wear": {"amount": "x"}}}, "effect 'wear': expected numbers by name"),
        ({"effects": {"wear": {"amount": None}}}, "effect 'wear': expected numbers by name"),
    ],
)
def test_of_a_simulation(more, said):
    with pytest.raises(ClutchestError) as caught:
        city(**more)
    assert str(caught.value).startswith(said)


def test_a_run_stands_for_its_signals_and_no_other_result_for_any():
    run = clutchest.replay("demo", "truck")
    again = clutchest.replay(run, "truck")
    assert again.summary["frames"] == run.summary["frames"] > 0
    with pytest.raises(ClutchestError, match="expected signals, a log or a run, not a Diagnosis"):
        clutchest.replay(clutchest.diagnose(run), "truck")


def test_a_run_is_no_state():
    run = clutchest.replay("demo", "truck")
    with pytest.raises(ClutchestError, match=r"; expected what a replay has left: Run\.final"):
        clutchest.replay("demo", "truck", state=run)


@pytest.mark.parametrize("window", [5, (1, 2, 3), "12", ("a", "b"), (5, 2), (-1, 5)])
def test_a_window_that_is_none(window):
    with pytest.raises(ClutchestError):
        clutchest.read_log("demo", "truck", window)


def test_a_window_is_a_pair():
    part = clutchest.read_log("demo", "truck", (60, None))
    whole = clutchest.read_log("demo", "truck")
    assert part.end == pytest.approx(whole.end - 60.0, abs=0.02)


@pytest.mark.parametrize("value", ["x", None, float("nan")])
def test_a_parameter_that_is_no_number(value):
    truck = clutchest.load_vehicle("truck")
    with pytest.raises(ClutchestError, match=r"engine_inertia: .* is no finite number"):
        truck.with_parameters(engine_inertia=value)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("engine_inertia", -3.0, r"engine_inertia = -3 kg m², expected 0\.001 … inf"),
        ("heat_fraction_body", 1.7, "heat_fraction_body = 1.7, expected 0 … 1"),
    ],
)
def test_a_parameter_that_no_vehicle_file_may_have(key, value, said):
    truck = clutchest.load_vehicle("truck")
    with pytest.raises(ClutchestError, match=said):
        truck.with_parameters(**{key: value})


def test_a_parameter_that_is_unlikely_is_named_as_one_of_a_file_is():
    heavy = clutchest.load_vehicle("truck").with_parameters(engine_inertia=50.0)
    said = "unlikely: engine_inertia = 50 kg m^2, such machines have 0.02 … 20"
    assert said in clutchest.replay("demo", heavy).warnings
    assert heavy.with_parameters(engine_inertia=3.0).notes == ()


def test_parameters_are_fixed():
    truck = clutchest.load_vehicle("truck")
    with pytest.raises(ClutchestError, match=r"expected vehicle\.with_parameters\(KEY=VALUE\)"):
        truck.parameters["engine_inertia"] = 4.0
    with pytest.raises(ClutchestError, match="fixed"):
        truck.parameters.pop("engine_inertia")
    with pytest.raises(ClutchestError, match="no parameter 'engine_inerta'; did you mean"):
        truck.parameters["engine_inerta"]
    assert copy.deepcopy(truck) == pickle.loads(pickle.dumps(truck)) == truck


def test_a_summary_is_json():
    drive = city(seed=3, duration=120.0, effects={"torque_gain": {"change": -0.3}})
    diagnosis = clutchest.diagnose(drive, "truck")
    assert diagnosis.faults and diagnosis.isolability
    assert json.loads(json.dumps(diagnosis.summary(), allow_nan=False)) == diagnosis.summary()


def test_a_request_that_is_no_number():
    with pytest.raises(ClutchestError, match=r"request: expected times and values, numbers: .*'x'"):
        clutchest.feedforward("alsd_rig", ([0, 1], [0, "x"]))
