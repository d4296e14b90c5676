"""Whatever a public name is given, what is wrong with it is said by clutchest, not by Python."""

from __future__ import annotations

import inspect

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.monitor.settings import MonitorSettings


class Odd:
    """A value of no use."""


# Of no use to any parameter below.
NONSENSE = {"an object": Odd(), "a complex number": 2j, "a table": pd.DataFrame(), "bytes": b"x"}


@pytest.fixture(scope="module")
def at_hand():
    """What the calls below are made on."""
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.read_log("demo", truck, (0, 100))
    return truck, signals, clutchest.replay(signals, truck)


def calls(at_hand, out):
    """Public name → what is called, and what it may be called with."""
    truck, signals, run = at_hand
    one, request = signals["engine_speed"], ([0.0, 0.2], [0.0, 100.0])
    innovations = run.tracks[0].innovations
    return {
        "analyse_fleet": (
            clutchest.analyse_fleet,
            {"places": "nowhere", "vehicle": "truck", "out": out, "rate": 10.0, "workers": 1},
        ),
        "diagnose": (clutchest.diagnose, {"run": run, "progress": None}),
        "discover": (
            clutchest.discover,
            {"signals": signals, "vehicle": truck, "holdout": None, "effects_files": ()},
        ),
        "feedforward": (
            clutchest.feedforward,
            {"vehicle": "alsd_rig", "request": request, "state": None},
        ),
        "filterpy_of": (clutchest.filterpy_of, {"vehicle": truck, "signals": signals}),
        "identify_vehicle": (
            clutchest.identify_vehicle,
            {"name": "noise", "signals": signals, "vehicle": truck, "holdout": None},
        ),
        "load_vehicle": (clutchest.load_vehicle, {"v": "truck"}),
        "read_log": (clutchest.read_log, {"paths": "demo", "vehicle": truck, "window": (0, 9)}),
        "replay": (
            clutchest.replay,
            {
                **{"signals": signals, "vehicle": truck, "rate": 10.0, "state": None},
                **{"engine": "kernel", "progress": None},
            },
        ),
        "save": (clutchest.save, {"result": run, "path": out}),
        "simulate": (
            clutchest.simulate,
            {"vehicle": "truck", "scenario": "city", "seed": 0, "effects": None, "duration": 5.0},
        ),
        "view": (clutchest.view, {"run": run, "diagnosis": None, "width": 9, "height": 9}),
        "write_run": (clutchest.write_run, {"run": run, "out": out, "formats": ()}),
        "Run.save": (run.save, {"path": out}),
        "Vehicle.save": (truck.save, {"path": out / "mine.toml"}),
        "Vehicle.with_parameters": (truck.with_parameters, {"engine_inertia": 1.0}),
        "Run.track": (run.track, {"drive": 0}),
        "Run.estimate": (run.estimate, {"name": "temp_disc", "drive": 0}),
        "Run.plot": (run.plot, {"drive": 0}),
        "Run.about": (run.about, {"columns": ["time"]}),
        "Run[]": (lambda name: run[name], {"name": "temp_disc"}),
        "Innovations.of": (innovations.of, {"name": innovations.names[0]}),
        "Signals": (clutchest.Signals, {"signals": {}}),
        "Signals[]": (lambda name: signals[name], {"name": "engine_speed"}),
        "Signals.between": (signals.between, {"start": 0.0, "end": 5.0}),
        "Signals.has_samples_of": (signals.has_samples_of, {"other": signals}),
        "Signal.of": (
            clutchest.Signal.of,
            {"name": "x", "unit": "", "time": [0, 1], "value": [0, 1], "why": None},
        ),
        "Signal.take": (one.take, {"rows": slice(3)}),
        "Signal.between": (one.between, {"start": 0.0, "end": 5.0}),
        "Signal.then": (one.then, {"later": one}),
        "Signal.joined": (clutchest.Signal.joined, {"parts": [one]}),
        "Signal.at": (one.at, {"time": np.zeros(2), "gap": 1.0}),
    }


NAMES = [
    *("analyse_fleet", "diagnose", "discover", "feedforward", "filterpy_of", "identify_vehicle"),
    *("load_vehicle", "read_log", "replay", "save", "simulate", "view", "write_run"),
    *("Run.save", "Vehicle.save", "Vehicle.with_parameters", "Run.track", "Run.estimate"),
    *("Run.plot", "Run.about", "Run[]", "Innovations.of", "Signals", "Signals[]"),
    *("Signals.between", "Signals.has_samples_of", "Signal.of", "Signal.take", "Signal.between"),
    *("Signal.then", "Signal.joined", "Signal.at"),
]


def test_every_public_function_is_called_with_nonsense():
    public = (getattr(clutchest, name) for name in clutchest.__all__)
    functions = {each.__name__ for each in public if inspect.isfunction(each)}
    assert functions and functions <= {*NAMES}


def test_the_calls_are_those_that_are_named(at_hand, tmp_path):
    assert [*calls(at_hand, tmp_path)] == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_nonsense(name, at_hand, tmp_path):
    function, valid = calls(at_hand, tmp_path / "out")[name]
    for parameter in valid:
        for what, value in NONSENSE.items():
            with pytest.raises(ClutchestError) as caught:
                function(**{**valid, parameter: value})
                pytest.fail(f"{parameter} took {what}")
            assert "\n" not in str(caught.value)
    if name.endswith("[]"):
        return
    with pytest.raises(ClutchestError, match="misspelt"):
        function(**{**valid, "misspelt": 1})
    assert not (tmp_path / "out").exists(), "was begun"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda run: clutchest.view(3), "run: expected a Run, not 3"),
        (lambda run: clutchest.view(), "view: expected run"),
        (
            lambda run: clutchest.view(run, widht=3),
            "view has no option 'widht'; did you mean 'width'?",
        ),
        (lambda run: clutchest.write_run(3, "out"), "run: expected a Run, not 3"),
        (
            lambda run: clutchest.write_run(run, "out", formats="csv"),
            "formats: expected a list, not 'csv'",
        ),
        (lambda run: run.save(3), "path: expected a path, not 3"),
        (
            lambda run: run.save("out", report=True, inovations=1),
            "write_run has no option 'inovations'",
        ),
        (lambda run: run.save("a.csv", report=True), "save: 'report' is an option of a folder"),
        (
            lambda run: run.estimate("temp_disk"),
            "no estimate 'temp_disk'; did you mean 'temp_disc'",
        ),
        (lambda run: run.track("first"), "drive: expected a whole number, not 'first'"),
        (
            lambda run: clutchest.replay(run, run.vehicle, rate=None),
            "rate: expected a number, not None",
        ),
        (lambda run: clutchest.replay(run, {}), "vehicle: expected a Vehicle or a path, not {}"),
        (
            lambda run: clutchest.load_vehicle(run),
            "v: expected a Vehicle or a path, not a Run, whose .vehicle is one",
        ),
        (
            lambda run: clutchest.replay(run, "truck", state=[]),
            "state: expected a mapping or None, not []",
        ),
        (
            lambda run: clutchest.replay(run, "truck", progress=3),
            "progress: expected a function or None, not 3",
        ),
        (
            lambda run: clutchest.analyse_fleet([], "truck", "out"),
            "no place of logs is given; expected a folder",
        ),
        (
            lambda run: clutchest.discover(run, "truck", effects_files="a.py"),
            "effects_files: expected a list, not 'a.py'",
        ),
        (
            lambda run: clutchest.discover(run, "truck", effects_files=["a.py", 3]),
            "effects_files: expected a path in the list, not 3",
        ),
        (
            lambda run: clutchest.Signal.joined([run.signals["engine_speed"], run]),
            "parts: expected a Signal in the list, not a Run",
        ),
        (lambda run: clutchest.Monitor(None, "truck"), "bus: expected a BusABC, not None"),
        (lambda run: clutchest.Signal.joined([]), "parts: expected one signal at least"),
        (
            lambda run: clutchest.Signal.of("x", "", [0, 1], [0, 1, 2]),
            "signal 'x': (2,) times, (3,) values",
        ),
        (lambda run: clutchest.simulate("truck", "city", effects=[]), "effects: expected {"),
        (
            lambda run: MonitorSettings(rat=3),
            "MonitorSettings has no option 'rat'; did you mean 'rate'?",
        ),
        (
            lambda run: run.tracks[0].innovations.of("engine_sped"),
            "no sensor 'engine_sped'; did you mean 'engine_speed'?",
        ),
    ],
)
def test_what_is_said_of_it(call, said, at_hand, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ClutchestError) as caught:
        call(at_hand[2])
    assert str(caught.value).startswith(said)
    assert not [*tmp_path.iterdir()]


def test_what_has_no_truth_is_not_said_to_have_one(at_hand):
    """A drive that was not simulated has None there, and None is allowed here."""
    with pytest.raises(ClutchestError, match=r"expected a Vehicle, a path or None, not Signals$"):
        clutchest.diagnose(at_hand[0], at_hand[1])


def test_what_serves_is_let_through():
    """Numbers of numpy, lists for tuples and for arrays, and what only type checkers know."""

    @checked
    def all_of(*names: str, number: float, whole: int, row: clutchest.Signals | NotThere) -> int:  # type: ignore[name-defined]  # noqa: F821
        return len(names)

    assert all_of("a", "b", number=np.float32(2), whole=np.int64(2), row=5) == 2
    with pytest.raises(ClutchestError, match="whole: expected a whole number, not True"):
        all_of(number=1, whole=True, row=5)
    with pytest.raises(ClutchestError, match="names: expected a text, not 3"):
        all_of(3, number=1, whole=1, row=5)
    with pytest.raises(ClutchestError, match=r"track: too many positional arguments.*takes drive"):
        _track(1, 2)
    assert clutchest.Signal.of("x", "", (0, 1), [1, 2]).value.tolist() == [1.0, 2.0]


@checked
def _track(drive: int) -> int:
    return drive
