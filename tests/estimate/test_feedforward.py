"""The model turned round: its course meets the request on the generator's rig, obeys the supply and
knows the estimated free play, the friction and the direction of loading."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import clutchest
from clutchest.cli import app
from clutchest.errors import ClutchestError
from clutchest.estimate.feedforward import PERIOD, Feedforward, feedforward
from clutchest.estimate.replay import replay
from clutchest.generator.alsd import plant
from clutchest.generator.alsd.effects import EFFECTS, numbers
from clutchest.generator.alsd.generate import run
from clutchest.generator.effects import complete
from clutchest.signals import Floats
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

ON, OFF, END = 0.2, 1.0, 1.4  # s
TIME = np.arange(round(END / PERIOD) + 1) * PERIOD


def step(height: float) -> Floats:
    return np.interp(TIME, (ON, ON + 0.015, OFF, OFF + 0.015), (0.0, height, height, 0.0))


def planned(height: float, **more: object) -> Feedforward:
    return feedforward("alsd_rig", (TIME, step(height)), **more)


def torque(current: Floats, **changed: float) -> Floats:
    """Of the generator's nominal rig, at a slip of 25 rpm, some parameters changed."""
    values = {key: p.value for key, p in load_vehicle("alsd_rig").parameters.items()}
    record = numbers(
        values | changed, complete({}, EFFECTS, {}), values["friction_coefficient"], {}
    )
    profile = np.zeros(len(current), plant.PROFILE)
    profile["asked"], profile["driven"], profile["oil"] = current, 25 * np.pi / 30, 60.0
    return run(profile, record)["clutch_torque"]


@pytest.mark.parametrize("height", [2314.0, 1217.0, 323.0])
def test_the_generators_rig_meets_the_request(height: float) -> None:
    """What is left is below a tenth of the request, where a constant gain misses by a third."""
    settled = (TIME > ON + 0.4) & (TIME < OFF)
    error = (torque(planned(height).columns["current_request"]) - height)[settled]
    assert np.sqrt(np.mean(error**2)) < 0.1 * height
    by_gain = torque(step(height) / 187.0)
    excess = by_gain[(TIME > ON) & (TIME < OFF)].max() - height
    assert np.abs(by_gain[settled] - height).mean() > 1.2 * np.abs(error).mean() or excess > 0.2


def test_no_overshoot_where_a_constant_gain_overshoots() -> None:
    pressed = (TIME > ON) & (TIME < OFF)
    ours = torque(planned(1217.0).columns["current_request"])[pressed].max()
    theirs = torque(step(1217.0) / 187.0)[pressed].max()
    assert ours < 1.05 * 1217.0 < 1.5 * 1217.0 < theirs


def test_the_supplys_voltage_limits_it() -> None:
    """u = R i + K_v ω stays within 12 V, and at the start it is all used."""
    vehicle = load_vehicle("alsd_rig")
    p = {key: value.value for key, value in vehicle.parameters.items()}
    columns = planned(2314.0).columns
    change = np.gradient(columns["current"], PERIOD)
    warm = 1 + p["resistance_temp_coefficient"] * (60.0 - p["armature_reference_temp"])
    voltage = p["armature_resistance"] * warm * columns["current"]
    voltage += p["back_emf_constant"] * columns["motor_speed"]
    quiet = np.abs(change) < 500.0  # A/s: within a row
    assert np.abs(voltage[quiet]).max() < 1.02 * p["supply_voltage"]
    assert voltage.max() > 0.95 * p["supply_voltage"]


def test_the_loop_is_in_the_current() -> None:
    """The same torque takes more current when it was reached from below than from above."""
    time = np.arange(round(4.0 / PERIOD) + 1) * PERIOD
    request = np.interp(time, (0.2, 1.5, 2.0, 3.3), (400.0, 1400.0, 1400.0, 400.0))
    columns = feedforward("alsd_rig", (time, request)).columns
    rising, falling = (float(np.interp(t, time, columns["current"])) for t in (0.85, 2.65))
    assert np.interp(0.85, time, request) == pytest.approx(np.interp(2.65, time, request))
    assert rising > 1.2 * falling
    at = [float(np.interp(t, time, columns["motor_angle"])) for t in (0.85, 2.65)]
    assert at[0] == pytest.approx(at[1], rel=0.01)


def test_the_way_through_the_free_play() -> None:
    """Motor at home while nothing is asked; then free play and backlash come before any torque."""
    vehicle = load_vehicle("alsd_rig")
    p = {key: value.value for key, value in vehicle.parameters.items()}
    columns = planned(1217.0).columns
    assert np.abs(columns["motor_angle"][: round(ON / PERIOD)]).max() < 0.01
    first = int(np.argmax(columns["friction_potential"] > 1.0))
    way = p["gear_ratio"] * (p["gear_backlash"] + p["ball_ramp_ratio"] * p["free_play"])
    assert way < columns["motor_angle"][first] < 1.15 * way


@pytest.mark.slow
def test_the_estimate_of_a_drive_is_used() -> None:
    """A specimen with a third less friction, whose free play has grown by half: its own log tells,
    and the request is met better by it."""
    effects = {"friction_level": {"change": -0.3}, "free_play_growth": {"growth": 1e-4}}
    log = simulate("alsd_rig", "rig-steps", 1, effects, duration=14.0, nominal=True)
    state = replay(log, "alsd_rig").final
    known = planned(1217.0, state=state)
    assert known.taken["friction"] == pytest.approx(0.7, abs=0.03)
    assert known.taken["free_play"] == pytest.approx(2.9e-4, abs=5e-6)
    assert re.search(r"estimated: free play 0\.2\d+ mm, friction 0\.\d+$", known.shown().line)
    assert set(known.to_pandas().attrs["units"]) == set(known.columns)
    specimen = {"friction_coefficient": 0.7 * 0.11, "free_play": 2.9e-4}
    settled = (TIME > ON + 0.4) & (TIME < OFF)
    missed = [
        np.abs(torque(plan.columns["current_request"], **specimen)[settled] - 1217.0).mean()
        for plan in (planned(1217.0), known)
    ]
    assert missed[1] < 0.3 * missed[0]


def test_refused() -> None:
    with pytest.raises(ClutchestError, match=r"no inverse; .* alsd_car, alsd_rig have one"):
        feedforward("truck", (TIME, step(100.0)))
    with pytest.raises(ClutchestError, match="as many"):
        feedforward("alsd_rig", (TIME[:-1], step(100.0)))
    with pytest.raises(ClutchestError, match="times and values, not 3 columns"):
        feedforward("alsd_rig", (TIME, TIME, TIME))
    with pytest.raises(ClutchestError, match="times and values, numbers: dates, not s"):
        feedforward("alsd_rig", (pd.date_range("2024-01-01", periods=len(TIME)), step(100.0)))
    with pytest.raises(ClutchestError, match="state of 'truck'"):
        planned(100.0, state={"vehicle": "truck"})
    with pytest.raises(ClutchestError, match="lasts 0 s"):
        feedforward("alsd_rig", ((0.0,), (1.0,)))


def test_the_same_request_in_other_forms() -> None:
    known = feedforward("alsd_rig", (TIME, step(500.0))).columns["current"]
    table = pd.DataFrame({"time": TIME, "torque_request": step(500.0)})
    for request in ([TIME, step(500.0)], np.array([TIME, step(500.0)]), table, [table]):
        np.testing.assert_array_equal(feedforward("alsd_rig", request).columns["current"], known)


def test_command(tmp_path: Path) -> None:
    """A table in, ``feedforward.parquet`` out; the Python call gives the same."""
    request = tmp_path / "request.csv"
    pd.DataFrame({"time": TIME, "torque_request": step(500.0)}).to_csv(request, index=False)
    command = ["feedforward", str(request), "--vehicle", "alsd_rig", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*command, "--format", "csv"])
    assert result.exit_code == 0, result.output
    text = pd.read_csv(tmp_path / "feedforward.csv")
    assert list(text) == list(pd.read_parquet(tmp_path / "feedforward.parquet"))
    table = pd.read_parquet(tmp_path / "feedforward.parquet")
    assert {"time", "torque_request", "current", "motor_angle"} <= set(table)
    same = clutchest.feedforward("alsd_rig", request).to_pandas()
    np.testing.assert_allclose(table["current"], same["current"])
    assert same.attrs["units"]["motor_angle"] == "rad"


def test_a_request_beyond_the_actuator_is_said() -> None:
    assert not planned(2314.0).unmet
    beyond = planned(1e7)
    reached = beyond.columns["friction_potential"].max()
    assert beyond.unmet == f"the request is not met: {reached:.4g} Nm at most, of 1e+07 Nm"
    assert beyond.shown().line.endswith(beyond.unmet)


OWN_COLUMNS = '[columns]\nmotor_angle = "phi"\ntorque_request = "M_soll"\n\n[parameters]'


def test_only_columns_that_the_inverse_uses_are_missed(tmp_path: Path) -> None:
    """A vehicle file with columns of its own, and a table of nothing but the request."""
    text = load_vehicle("alsd_rig").path.read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.replace("[parameters]", OWN_COLUMNS), "utf-8")
    request = tmp_path / "request.csv"
    pd.DataFrame({"Zeit": TIME, "M_soll [Nmm]": 1e3 * step(900.0)}).to_csv(request, index=False)
    found = feedforward(tmp_path / "mine.toml", request)
    assert found.warnings == ()
    assert found.columns["torque_request"].max() == pytest.approx(900.0)
    np.testing.assert_allclose(found.columns["current"], planned(900.0).columns["current"])


def test_a_hole_in_the_request_is_said(tmp_path: Path) -> None:
    """As empty cells and as rows that are not there; not between the corners of a polygon."""
    table = pd.DataFrame({"time": TIME, "torque_request": step(900.0)})
    hole = (TIME > 0.5) & (TIME < 0.8)
    empty = table.assign(torque_request=table["torque_request"].mask(hole))
    for rows in (empty, table[~hole]):
        rows.to_csv(tmp_path / "request.csv", index=False)
        (warning,) = feedforward("alsd_rig", tmp_path / "request.csv").warnings
        assert warning == "torque_request: no value from 0.5 to 0.8 s: a straight line is taken"
    assert planned(900.0).warnings == ()
    assert feedforward("alsd_rig", ([0.0, 0.1, 1.0, 1.1], [0.0, 900.0, 900.0, 0.0])).warnings == ()


def test_a_request_of_words_says_which_cell(tmp_path: Path) -> None:
    (tmp_path / "request.csv").write_text("time,torque_request\n0,0\n1,much\n")
    with pytest.raises(ClutchestError, match=r"lasts 0 s.*row 3: torque_request 'much' is not a"):
        feedforward("alsd_rig", tmp_path / "request.csv")
